"""From a RawLog to a FlightLog: bad rows and readings are left out and counted.

In this order: rows without a time; rows whose time stands still or goes back; readings that are
impossible or at which a sensor saturates, which become NaN; then gaps in time and jumps of the
pose, at which the log is divided into pieces. Signals of which nothing is left are left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from quadsim.logs.flight_log import SIGNALS, FlightLog
from quadsim.logs.motion_checks import expect_motion
from quadsim.logs.raw_log import LogError, RawLog
from quadsim.logs.unit_checks import expect_units

# Rows that lie behind the time reached before are out of order if there are no more than this;
# more of them mean that the clock has started anew.
MOST_OUT_OF_ORDER = 20
MOST_RESTARTS = 100
# A step of time is a gap if it is longer than this multiple of the median step.
GAP = 4.5
# Rows of the shortest piece
SHORTEST_PIECE = 10
FEWEST_ROWS = 50
# A pose that moves faster, and farther, has jumped [m/s], [m], [rad/s], [rad].
FASTEST = 80.0
FARTHEST = 0.5
FASTEST_TURN = 100.0
LARGEST_TURN = 1.0
# A sensor saturates this close to its largest reading.
NEAR = 0.998
# Share of impossible readings above which the whole signal is in another unit. Rates in deg/s, read
# as rad/s, are impossible in the fastest turns alone.
MOST_IMPOSSIBLE = 0.5
MOST_IMPOSSIBLE_RATES = 0.01
RATES = ("body_rates", "rate_setpoints")
# Share of times that fall above which the rows are in the reverse order
MOST_FALLING = 0.9
# Shares of missing readings between which a line names them; a slower sensor lacks most.
TOLD_MISSING = (0.001, 0.5)
# A command just outside of 0 to 1 is a matter of rounding.
ROUNDING = 1e-3


def cleaned(raw: RawLog) -> FlightLog:
    """Return the log that a fit can use.

    Raises:
        LogError: too little is left, or a signal is in another unit than was expected.
    """
    if len(raw.t) < FEWEST_ROWS:
        raise LogError(f"{raw.name}: expected at least {FEWEST_ROWS} rows, got {len(raw.t)}")
    remarks = list(raw.remarks)
    rows, t, restarts = _in_order(raw, remarks)
    signals = {}
    for name, readings in raw.signals.items():
        _count_missing(name, readings[rows], remarks)
        found = _possible(name, readings[rows], raw, remarks)
        if np.isfinite(found).any():
            signals[name] = found
    if not signals:
        raise LogError(f"{raw.name}: expected readings of a signal beside the time, got none")
    start = float(t[0])
    t -= start
    expect_units(raw.name, t, signals)
    expect_motion(raw.name, t, signals)
    breaks = restarts | _gaps(t, remarks) | _jumps(t, signals, remarks)
    pieces = tuple(_pieces(breaks, len(t)))
    if not pieces:
        raise LogError(
            f"{raw.name}: expected spans of {SHORTEST_PIECE} rows without a gap, got none"
        )
    missing = [SIGNALS[name].words for name in SIGNALS if name not in signals]
    if missing:
        remarks.append(f"not in this log: {', '.join(missing)}")
    table: dict[str, Any] = {name: signals.get(name) for name in SIGNALS}
    return FlightLog(
        name=raw.name, t=t, **table, pieces=pieces, remarks=tuple(remarks), start=start
    )


def _in_order(raw: RawLog, remarks: list[str]) -> tuple[np.ndarray, np.ndarray, set[int]]:
    """Return the rows whose time can be used, their times, and at which of them the clock restarts.

    After a restart the times continue one second later.
    """
    rows = np.flatnonzero(np.isfinite(raw.t))
    if len(rows) < len(raw.t):
        remarks.append(f"rows left out, without a time: {len(raw.t) - len(rows)}")
    t = raw.t[rows].astype(float)
    falls = int(np.sum(np.diff(t) < 0.0))
    if falls > MOST_FALLING * len(t):
        wanted = "time: expected times that rise from row to row"
        raise LogError(f"{raw.name}: {wanted}, got {falls} of {len(t)} that fall: sort the rows")
    out_of_order = 0
    starts = []
    while len(t):
        # The latest time before each row
        reached = np.maximum.accumulate(t)
        behind = np.zeros(len(t), bool)
        behind[1:] = t[1:] <= reached[:-1]
        if not behind.any():
            break
        first = int(np.argmax(behind))
        forward = np.flatnonzero(~behind[first:])
        length = int(forward[0]) if len(forward) else len(t) - first
        repeated = bool(t[first] == reached[first - 1])
        if length > MOST_OUT_OF_ORDER and not repeated and first > 1 and t[first] > t[first - 2]:
            # One row that lies far ahead, not the clock
            out_of_order += 1
            rows = np.delete(rows, first - 1)
            t = np.delete(t, first - 1)
            continue
        if length > MOST_OUT_OF_ORDER and not repeated:
            starts.append(rows[first])
            t[first:] += t[first - 1] + 1.0 - t[first]
            if len(starts) > MOST_RESTARTS:
                raise LogError(f"{raw.name}: expected times that rise, got a random order")
            continue
        # All short spans before the next restart are left out at once.
        drop = _short_spans(behind, t)
        out_of_order += int(drop.sum())
        rows = rows[~drop]
        t = t[~drop]
    if out_of_order:
        remarks.append(f"rows left out, whose time stood still or went back: {out_of_order}")
    if starts:
        remarks.append(f"the clock started anew {len(starts)} times")
    if len(t) < FEWEST_ROWS:
        wanted = f"expected at least {FEWEST_ROWS} rows whose time rises"
        raise LogError(f"{raw.name}: {wanted}, got {len(t)}")
    restarts = {int(np.searchsorted(rows, start)) for start in starts}
    return rows, t, restarts


def _short_spans(behind: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return which rows are out of order, before the first long span of rows that are.  (n,)"""
    edges = np.diff(np.concatenate(([0], behind.astype(int), [0])))
    begins = np.flatnonzero(edges == 1)
    ends = np.flatnonzero(edges == -1)
    repeated = t[begins] == t[begins - 1]
    short = (ends - begins <= MOST_OUT_OF_ORDER) | repeated
    usable = np.cumsum(~short) == 0
    drop = np.zeros(len(t), bool)
    for begin, end in zip(begins[usable], ends[usable], strict=True):
        drop[begin:end] = True
    return drop


def _possible(name: str, readings: np.ndarray, raw: RawLog, remarks: list[str]) -> np.ndarray:
    """Return a signal whose impossible and saturated readings are NaN.

    Raises:
        LogError: most of them are, so that the signal is in another unit.
    """
    signal = SIGNALS[name]
    found = np.array(readings, float)
    known = np.isfinite(found)
    found[~known] = np.nan
    total = int(known.sum())
    if not total:
        return found
    slack = ROUNDING if signal.least == 0.0 else 0.0
    with np.errstate(invalid="ignore"):
        wrong = known & ((found < signal.least - slack) | (found > signal.largest + slack))
        saturated = np.zeros_like(wrong)
        if name in raw.largest:
            saturated = known & ~wrong & (np.abs(found) >= NEAR * raw.largest[name])
    if wrong.sum() > (MOST_IMPOSSIBLE_RATES if name in RATES else MOST_IMPOSSIBLE) * total:
        usual = float(np.median(np.abs(found[wrong])))
        wanted = (
            f"expected {signal.words} [{signal.unit}] from {signal.least:g} to {signal.largest:g}"
        )
        advice = "correct unit, zero or full of the mapping"
        raise LogError(f"{raw.name}: {name}: {wanted}, got values like {usual:.4g}: {advice}")
    if name == "quaternion":
        wrong |= _without_length(found)
    for problem, which in (("impossible", wrong), ("saturated", saturated)):
        if which.any():
            remarks.append(f"{signal.words}: readings left out, {problem}: {int(which.sum())}")
    found[wrong | saturated] = np.nan
    if name == "quaternion":
        found /= np.linalg.norm(found, axis=1, keepdims=True)
    elif slack:
        np.clip(found, signal.least, signal.largest, out=found)
    return found


def _count_missing(name: str, readings: np.ndarray, remarks: list[str]) -> None:
    """Tell how many rows of a signal have no reading, unless its sensor is a slower one."""
    missing = ~np.isfinite(readings if readings.ndim == 1 else readings.sum(axis=1))
    least, most = TOLD_MISSING
    if least < np.mean(missing) < most:
        remarks.append(f"{SIGNALS[name].words}: rows without a reading: {int(missing.sum())}")


def _without_length(quaternions: np.ndarray) -> np.ndarray:
    """Return which numbers belong to a quaternion whose length is not near 1.  (n, 4)"""
    length = np.linalg.norm(quaternions, axis=1)
    with np.errstate(invalid="ignore"):
        wrong = np.abs(length - 1.0) > 0.1
    return np.repeat(wrong[:, None], 4, axis=1) & np.isfinite(quaternions)


def _gaps(t: np.ndarray, remarks: list[str]) -> set[int]:
    """Return the rows that follow a gap."""
    steps = np.diff(t)
    found = np.flatnonzero(steps > GAP * np.median(steps)) + 1
    if len(found):
        longest = float(steps[found - 1].max())
        total = float(steps[found - 1].sum())
        remarks.append(f"gaps: {len(found)}, the longest {longest:.3g} s, together {total:.3g} s")
    return set(found.tolist())


def _jumps(t: np.ndarray, signals: dict[str, np.ndarray], remarks: list[str]) -> set[int]:
    """Return the rows at which the pose has jumped, as it does when an estimator is reset."""
    found: set[int] = set()
    if "position" in signals:
        found |= _jumped(t, signals["position"], FASTEST, FARTHEST)
    if "quaternion" in signals:
        # The chord between unit quaternions is half the angle, and q and -q are one attitude.
        q = signals["quaternion"]
        inner = np.sum(q[1:] * q[:-1], axis=1)
        same_sign = (
            q * np.cumprod(np.concatenate(([1.0], np.where(inner < 0.0, -1.0, 1.0))))[:, None]
        )
        found |= _jumped(t, 2.0 * same_sign, FASTEST_TURN, LARGEST_TURN)
    if found:
        remarks.append(f"jumps of the pose: {len(found)}")
    return found


def _jumped(t: np.ndarray, values: np.ndarray, fastest: float, farthest: float) -> set[int]:
    """Return the rows at which a signal moves faster and farther than a vehicle can."""
    moved = np.linalg.norm(np.diff(values, axis=0), axis=1)
    with np.errstate(invalid="ignore"):
        jumped = (moved > farthest) & (moved > fastest * np.diff(t))
    return set((np.flatnonzero(jumped) + 1).tolist())


def _pieces(breaks: set[int], rows: int) -> Iterator[slice]:
    """Yield the spans between breaks that are long enough."""
    edges = [0, *sorted(breaks - {0}), rows]
    for first, last in pairwise(edges):
        if last - first >= SHORTEST_PIECE:
            yield slice(first, last)
