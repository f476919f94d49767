"""The amount of the gates' colour in a pixel, and its steps along lines in the picture."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# Colour of the gates, 0 to 1
ORANGE = (0.9, 0.43, 0.1)
# [px] half the length over which the two sides of a step are compared
HALF = 2
# least step of the signal, of numbers up to 255
STEP = 7.0
# share of the largest step from which the first one counts, seen from the expected place
LIKELY = 0.6


class Signal:
    """The weight of the gates' colour in each pixel, which is zero for grey."""

    def __init__(self, colour: tuple[float, float, float]):
        """Set the colour of the gates, red, green and blue from 0 to 1."""
        away = np.array(colour) - np.mean(colour)
        self._weights = (away / np.linalg.norm(away)).astype(np.float32)

    def of(self, rgb: np.ndarray) -> np.ndarray:
        """Return the signal of a picture.  (height, width) float32"""
        return rgb @ self._weights


class Steps(NamedTuple):
    """The step of the signal that was found on each line."""

    # from the middle of the line along the line [px]  (n,)
    shift: np.ndarray
    # whether there is a step  (n,) bool
    found: np.ndarray


def steps(signal: np.ndarray, pixel: np.ndarray, normal: np.ndarray, reach: np.ndarray) -> Steps:
    """Return the best upward step of the signal along each line.

    Among the steps that are nearly as large as the largest, the step nearest to the middle of the
    line is chosen. A parabola through its neighbours gives its position between pixels.

    Args:
        signal: weight of the gates' colour in each pixel  (height, width).
        pixel: middle of each line [px]  (n, 2).
        normal: unit direction of each line  (n, 2).
        reach: distance from its middle to which each line is searched [px]  (n,).
    """
    if not len(pixel):
        return Steps(np.zeros(0), np.zeros(0, bool))
    longest = int(np.ceil(reach.max()))
    offsets = np.arange(-longest - HALF - 1, longest + HALF + 2)
    values = sampled(signal, pixel[:, None] + offsets[:, None] * normal[:, None])  # (n, m)
    # mean over HALF pixels after a place minus the mean before it, counted between two samples
    total = np.concatenate([np.zeros((len(values), 1)), np.cumsum(values, axis=1)], axis=1)
    after = total[:, 2 * HALF :] - total[:, HALF:-HALF]
    before = total[:, HALF:-HALF] - total[:, : -2 * HALF]
    rise = (after - before) / HALF  # (n, m - 2 HALF + 1)
    place = offsets[0] + HALF - 0.5 + np.arange(rise.shape[1])
    allowed = abs(place) <= reach[:, None]
    inner = np.where(allowed, rise, -np.inf)
    peak = np.zeros_like(allowed)
    peak[:, 1:-1] = (inner[:, 1:-1] >= rise[:, :-2]) & (inner[:, 1:-1] > rise[:, 2:])
    height = np.where(peak, inner, -np.inf)
    largest = height.max(axis=1)
    likely = height >= np.maximum(LIKELY * largest, STEP)[:, None]
    best = np.argmin(np.where(likely, abs(place), np.inf), axis=1)
    found = likely.any(axis=1)
    row = np.arange(len(rise))
    best = np.clip(best, 1, rise.shape[1] - 2)
    low, mid, high = rise[row, best - 1], rise[row, best], rise[row, best + 1]
    bend = low - 2.0 * mid + high
    part = np.where(bend < 0.0, 0.5 * (low - high) / np.where(bend < 0.0, bend, -1.0), 0.0)
    return Steps(place[best] + np.clip(part, -0.5, 0.5), found)


def sampled(signal: np.ndarray, pixel: np.ndarray) -> np.ndarray:
    """Return the signal at pixels (..., 2), interpolated bilinearly."""
    height, width = signal.shape
    u = np.clip(pixel[..., 0] - 0.5, 0.0, width - 1.001)
    v = np.clip(pixel[..., 1] - 0.5, 0.0, height - 1.001)
    column = u.astype(np.int32)
    row = v.astype(np.int32)
    right = (u - column).astype(np.float32)
    down = (v - row).astype(np.float32)
    at = row * width + column
    flat = signal.ravel()
    top = flat[at] + right * (flat[at + 1] - flat[at])
    below = flat[at + width] + right * (flat[at + width + 1] - flat[at + width])
    return top + down * (below - top)
