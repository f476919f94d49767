"""Budget: of long logs, the spans that tell most are fitted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from quadsim.identify.stretches import Stretch, cropped, total_time

MOST_TIME = 300.0  # in flight, that is fitted; a minute of manoeuvres is enough [s]
SPAN = 15.0  # duration of the spans that are compared [s]
MOVING = ("motor_commands", "rotor_speeds", "thrust_setpoint", "body_rates", "velocity")


class _Span(NamedTuple):
    """Neighbouring rows of a stretch."""

    part: int
    rows: slice
    spread: np.ndarray  # standard deviation of each signal, NaN for one that is missing


def liveliest(parts: Sequence[Stretch]) -> list[Stretch]:
    """Return the spans of MOST_TIME in which commands, rates and velocities change most.

    Neighbouring spans stay one stretch. Logs that are not longer are returned as they are.
    """
    if total_time(parts) <= MOST_TIME:
        return list(parts)
    spans = [span for k, part in enumerate(parts) for span in _spans(k, part)]
    spread = np.array([span.spread for span in spans])
    known = np.isfinite(spread)
    usual = np.sum(np.where(known, spread, 0.0), axis=0) / np.maximum(np.sum(known, axis=0), 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.nanmean(np.where(usual > 0.0, spread / usual, np.nan), axis=1)
    chosen: set[int] = set()
    time = 0.0
    for k in np.argsort(-change):
        span = spans[k]
        flying = parts[span.part].flying[span.rows]
        time += float(np.sum(flying)) * parts[span.part].dt
        if time > MOST_TIME:
            break
        chosen.add(int(k))
    return [cropped(parts[part], rows) for part, rows in _joined(spans, chosen)]


def _spans(part: int, stretch: Stretch) -> list[_Span]:
    """Return the spans of a stretch; the last one may be up to twice as long."""
    each = round(SPAN / stretch.dt)
    count = max(len(stretch) // each, 1)
    found = []
    for k in range(count):
        rows = slice(k * each, (k + 1) * each if k < count - 1 else len(stretch))
        spread = [_spread(getattr(stretch, name), rows) for name in MOVING]
        found.append(_Span(part, rows, np.array(spread)))
    return found


def _spread(values: np.ndarray | None, rows: slice) -> float:
    """Return the standard deviation of a signal over some rows, NaN if it is missing."""
    if values is None:
        return np.nan
    mine = values[rows].reshape(rows.stop - rows.start, -1)
    mine = mine[np.all(np.isfinite(mine), axis=1)]
    return float(np.sqrt(np.sum(np.var(mine, axis=0)))) if len(mine) else np.nan


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
