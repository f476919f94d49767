"""Budget: of long logs, only the spans in which the motions change most are fitted."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from quadsim.identify.stretches import Stretch, cropped, total_time

MOST_TIME = 300.0  # in flight, that is fitted; a minute of manoeuvres is enough [s]
SPAN = 15.0  # duration of the spans that are compared [s]


class _Span(NamedTuple):
    """Neighbouring rows of a stretch."""

    part: int
    rows: slice
    spread: np.ndarray  # standard deviation of each motion, 0 for one that is not logged


def liveliest(parts: Sequence[Stretch]) -> list[Stretch]:
    """Return the spans in which the motions change most, together of at most MOST_TIME.

    Each motion in turn, a body rate, a velocity or the mean command, takes the span in which it
    changes most, so that a log with little yaw keeps its yaw. Neighbouring spans stay one stretch.
    Logs that are not longer are returned as they are.
    """
    if total_time(parts) <= MOST_TIME:
        return list(parts)
    spans = [span for k, part in enumerate(parts) for span in _spans(k, part)]
    spread = np.array([span.spread for span in spans])
    times = [float(np.sum(parts[part].flying[rows])) * parts[part].dt for part, rows, _ in spans]
    # The spans of each motion, the one in which it changes most first
    orders = [np.argsort(-column) for column in spread.T if np.any(column > 0.0)]
    chosen: set[int] = set()
    for each in chain.from_iterable(zip(*orders, strict=True)):
        if sum(times[k] for k in chosen | {int(each)}) > MOST_TIME:
            break
        chosen.add(int(each))
    return [cropped(parts[part], rows) for part, rows in _joined(spans, chosen)]


def _spans(part: int, stretch: Stretch) -> list[_Span]:
    """Return the spans of a stretch; the last one may be up to twice as long."""
    each = round(SPAN / stretch.dt)
    count = max(len(stretch) // each, 1)
    found = []
    for k in range(count):
        rows = slice(k * each, (k + 1) * each if k < count - 1 else len(stretch))
        found.append(_Span(part, rows, _spread(stretch, rows)))
    return found


def _spread(part: Stretch, rows: slice) -> np.ndarray:
    """Return the standard deviations of body rates, velocities and mean command in some rows."""
    drives = (part.motor_commands, part.rotor_speeds, part.thrust_setpoint, part.throttle)
    drive = next((each for each in drives if each is not None), None)
    mean = None if drive is None else drive.reshape(len(part), -1).mean(axis=1, keepdims=True)
    found = []
    for values, width in ((part.body_rates, 3), (part.velocity, 3), (mean, 1)):
        mine = np.zeros((0, width)) if values is None else values[rows]
        mine = mine[np.all(np.isfinite(mine), axis=1)]
        found.append(np.std(mine, axis=0) if len(mine) else np.zeros(width))
    return np.concatenate(found)


def _joined(spans: Sequence[_Span], chosen: set[int]) -> list[tuple[int, slice]]:
    """Return the chosen rows of each stretch, neighbouring spans together."""
    found: list[tuple[int, slice]] = []
    for k in sorted(chosen):
        span = spans[k]
        if found and found[-1][0] == span.part and found[-1][1].stop == span.rows.start:
            found[-1] = (span.part, slice(found[-1][1].start, span.rows.stop))
        else:
            found.append((span.part, span.rows))
    return found
