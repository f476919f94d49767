"""Delays first: the time from the motors' commands to their answer, by cross-correlation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.ndimage import uniform_filter1d

from quadsim.identify.geometry import Geometry
from quadsim.identify.prepared import Prepared

EARLIEST = -0.02  # shortest and longest time from command to answer that is looked for [s]
LATEST = 0.25
TREND = 0.5  # slower changes than over this time are taken out before the comparison [s]
SMOOTH = 0.01  # derivatives are averaged over this time [s]
USUAL = 0.04  # time of vehicles whose log shows none [s]


def answer_time(parts: Sequence[Prepared], geometry: Geometry) -> float:
    """Return the time from the motors' commands to their effect, delay and lag together [s]."""
    lags: list[float] = []
    weights: list[float] = []
    for part in parts:
        for command, answer in _pairs(part, geometry):
            lag, correlation = _peak(command, answer, part.usable, part.stretch.dt)
            lags.append(lag)
            weights.append(max(correlation, 0.0) ** 2 * part.stretch.duration)
    if not sum(weights):
        return USUAL
    # The pair that correlates best in most of the time decides.
    order = np.argsort(lags)
    share = np.cumsum(np.array(weights)[order]) / sum(weights)
    return float(max(np.array(lags)[order][np.searchsorted(share, 0.5)], 0.005))


def spins_other_way(parts: Sequence[Prepared], geometry: Geometry) -> bool:
    """Return whether the vehicle yaws against the reaction torques of quadsim's rotors."""
    toward = against = 0.0
    for part in parts:
        if part.has_single and part.rates is not None:
            torque = part.command**2 @ geometry.signs[2]
            slope = _slope(part.rates[:, 2], part.stretch.dt)
            toward += _peak(torque, slope, part.usable, part.stretch.dt)[1] * part.stretch.duration
            against += (
                _peak(-torque, slope, part.usable, part.stretch.dt)[1] * part.stretch.duration
            )
    return against > toward


def _slope(values: np.ndarray, dt: float) -> np.ndarray:
    """Return the smoothed derivative of a signal."""
    width = max(round(SMOOTH / dt), 1)
    return uniform_filter1d(np.gradient(values, dt, axis=0), width, axis=0)


def _pairs(part: Prepared, geometry: Geometry) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield commands and answers that rise together: thrust, and torques about x and y."""
    stretch = part.stretch
    single = part.command**2
    if stretch.specific_force is not None:
        yield single.sum(axis=1), np.nan_to_num(stretch.specific_force[:, 2])
    if part.rates is not None and part.has_single:
        slope = _slope(part.rates, stretch.dt)
        for k in range(2):
            yield single @ geometry.signs[k], slope[:, k]


def _peak(
    command: np.ndarray, answer: np.ndarray, usable: np.ndarray, dt: float
) -> tuple[float, float]:
    """Return the time by which the answer is later, and the correlation there."""
    width = max(round(TREND / dt), 3)
    command, answer = (
        np.where(usable, values - uniform_filter1d(values, width), 0.0)
        for values in (command, answer)
    )
    size = float(np.linalg.norm(command) * np.linalg.norm(answer))
    if not size:
        return USUAL, 0.0
    shifts = np.arange(round(EARLIEST / dt), round(LATEST / dt) + 1)
    padded = 2 ** int(np.ceil(np.log2(2 * len(command))))
    spectrum = np.conj(np.fft.rfft(command, padded)) * np.fft.rfft(answer, padded)
    products = np.fft.irfft(spectrum, padded)[shifts] / size
    best = int(np.argmax(products))
    return float(shifts[best] * dt), float(products[best])
