"""Traces: logged signals beside their predictions by the fitted numbers, for a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from quadsim.identify.geometry import Geometry
from quadsim.identify.numbers import FitNumbers
from quadsim.identify.prepared import Prepared
from quadsim.identify.problem import CHANNELS, Channel, single_thrusts

DURATION = 5.0  # of a trace [s]
PIECE = 0.5  # predictions that need initial values begin anew after this time [s]
UNITS = {"force": "m/s²", "rate": "rad/s", "velocity": "m/s"}


class Trace(NamedTuple):
    """One measured signal and its prediction."""

    channel: str  # "force", "rate" or "velocity"
    axis: str
    unit: str
    t: np.ndarray  # in the log [s]  (n,)
    measured: np.ndarray  # (n,)
    predicted: np.ndarray  # (n,)


def traces(
    parts: Sequence[Prepared], numbers: FitNumbers, geometry: Geometry, turning: Sequence[int]
) -> tuple[Trace, ...]:
    """Return traces of the liveliest seconds of the longest stretch.

    Args:
        parts: stretches of the logs.
        numbers: what predicts.
        geometry: what is not fitted.
        turning: axes about which the rotors explain the rotation.
    """
    part = max(parts, key=lambda each: int(np.sum(each.usable)))
    rows = _liveliest(part)
    found = []
    for channel in CHANNELS:
        measured = channel.measured(part)
        if measured is None:
            continue
        lag = numbers.force_lag if channel.is_late else 0.0
        single = single_thrusts(part, numbers, lag)
        predicted = channel.predicted(part, numbers, geometry, single)
        for k in _axes(channel, part, turning):
            here = measured[rows, k]
            found.append(
                Trace(
                    channel=channel.name,
                    axis="xyz"[k],
                    unit=UNITS[channel.name],
                    t=part.stretch.start + part.stretch.dt * np.arange(rows.start, rows.stop),
                    measured=here,
                    predicted=_begun_anew(here, predicted[rows, k], part.stretch.dt)
                    if channel.free
                    else predicted[rows, k],
                )
            )
    return tuple(found)


def _axes(channel: Channel, part: Prepared, turning: Sequence[int]) -> tuple[int, ...]:
    """Return the axes that a channel compares."""
    if channel.name == "rate":
        return tuple(turning)
    return (2,) if channel.name == "force" and part.v_body is None else (0, 1, 2)


def _liveliest(part: Prepared) -> slice:
    """Return the rows in which the commands change most."""
    count = min(round(DURATION / part.stretch.dt), len(part.usable))
    change = np.abs(np.diff(part.command, axis=0, prepend=part.command[:1])).sum(axis=1)
    sums = np.concatenate([[0.0], np.cumsum(np.where(part.usable, change, -1.0))])
    first = int(np.argmax(sums[count:] - sums[:-count]))
    return slice(first, first + count)


def _begun_anew(measured: np.ndarray, predicted: np.ndarray, dt: float) -> np.ndarray:
    """Return a prediction that begins anew at the measured value in each piece."""
    shown = predicted.copy()
    length = max(round(PIECE / dt), 2)
    for begin in range(0, len(shown), length):
        piece = slice(begin, begin + length)
        shown[piece] += measured[begin] - predicted[begin]
        # A gap shows that a new piece begins.
        shown[min(begin + length, len(shown)) - 1] = np.nan
    return shown
