"""Flights that overshoot a gate and return to it, read off positions and gates alone: so of stored
runs too.

In front of a gate the vehicle flies forward, along the passage, until it has passed. It has turned
back where, after flying forward in front of its next gate and coming close, it flies backward by
one opening and has still not passed: it missed the opening, or could not make the turn and fell
back. What a course asks for is not counted: the swing out of a gate just passed, the way round one
that faces away and the loop to a gate beside begin with no approach.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TypedDict

import numpy as np

from quadsim.course import Course, Gate, parse_course
from quadsim.course.opening import approach_length
from quadsim.files.strict_yaml import FileError
from quadsim.record.run import Run, system_of

CLOSE = 3.0  # openings from the gate's centre


class TurnedBack(TypedDict):
    """Where a flight turned back."""

    gate: int  # 1-based
    lap: int  # 1-based
    t: float  # when it was an opening behind its farthest point [s]


def turned_back(run: Run) -> list[TurnedBack]:
    """Once at most for each gate of each lap; none of other systems than a quadrotor, and of a
    course that cannot be read."""
    x = run.telemetry
    if system_of(run.spec) == "quadrotor":
        p = np.stack([x[name] for name in ("px", "py", "pz")], axis=1)  # (frames, 3)
        # a plant that blew up has positions beyond all numbers
        with suppress(FileError), np.errstate(all="ignore"):
            return turns(
                parse_course(run.spec["course_text"], run.spec["course"]), x["t"], p, x["passed"]
            )
    return []


def turns(course: Course, t: np.ndarray, p: np.ndarray, passed: np.ndarray) -> list[TurnedBack]:
    """t (n,) [s], p (n, 3) [m], passed (n,): gates passed until then."""
    found: list[TurnedBack] = []
    for k in np.unique(passed).tolist():
        lap, gate = divmod(k, len(course.gates))
        own = passed == k
        if len(when := _turned(course.gates[gate], p[own])):
            found.append({"gate": gate + 1, "lap": lap + 1, "t": float(t[own][when[0]])})
    return found


def _turned(gate: Gate, p: np.ndarray) -> np.ndarray:
    """Return the rows of the way to the gate at which it has been turned back.  p (n, 3)"""
    opening = approach_length(gate.opening)
    along = gate.to_local_rows(p).along
    distance = np.linalg.norm(p - gate.position, axis=1)
    # It has approached where it was an opening in front of the gate before, and has flown forward
    # by one since
    farthest_back = np.minimum.accumulate(along)
    approached = (farthest_back <= -opening) & (along - farthest_back >= opening)
    close = distance <= CLOSE * opening
    # From the farthest point it then reached it has fallen back by an opening
    farthest = np.maximum.accumulate(np.where(approached & close, along, -np.inf))
    return np.flatnonzero(farthest - along >= opening)
