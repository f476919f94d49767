"""Find flights that overshoot a gate and return to it, from positions and gates alone.

Stored runs can therefore be examined, too. In front of a gate the vehicle flies forward, along the
passage, until it has passed. It has turned back if, after it came close to its next gate in forward
flight, it flies backward by one opening before it has passed: it missed the opening, or could not
make the turn and fell back. Manoeuvres that a course requires are not counted, because they begin
without an approach: the turn after a passed gate, the way around a gate that faces away, and the
loop to a gate beside another.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TypedDict

import numpy as np

from quadsim.course import Course, Gate
from quadsim.course.opening import approach_length
from quadsim.files.strict_yaml import FileError
from quadsim.record.run import RecordedRun

# Openings from the gate's centre within which a vehicle is close
CLOSE = 3.0


class TurnedBack(TypedDict):
    """A place where a flight turned back: gate and lap, from 1, and time [s].

    At that time the vehicle was an opening behind its farthest point.
    """

    gate: int
    lap: int
    t: float


def turned_back(run: RecordedRun) -> list[TurnedBack]:
    """Return the places where a run turned back, at most one for each gate of each lap.

    A run whose course cannot be read has none.
    """
    x = run.telemetry
    positions = np.stack([x["px"], x["py"], x["pz"]], axis=1)
    # A plant that blew up has positions beyond all numbers
    with suppress(FileError), np.errstate(all="ignore"):
        course = run.course
        return turns(course, x["t"], positions, x["passed"])
    return []


def turns(course: Course, t: np.ndarray, p: np.ndarray, passed: np.ndarray) -> list[TurnedBack]:
    """Return the places where a path turned back.

    Args:
        course: the gates.
        t: times [s].  (n,)
        p: positions [m].  (n, 3)
        passed: gates passed until then.  (n,)
    """
    found: list[TurnedBack] = []
    for count in np.unique(passed).tolist():
        lap, gate = divmod(count, len(course.gates))
        own = passed == count
        rows = _turned(course.gates[gate], p[own])
        if len(rows):
            found.append({"gate": gate + 1, "lap": lap + 1, "t": float(t[own][rows[0]])})
    return found


def _turned(gate: Gate, p: np.ndarray) -> np.ndarray:
    """Return the indices of the positions (n, 3) at which the vehicle has turned back."""
    opening = approach_length(gate.opening)
    along = gate.to_local_rows(p).along
    distance = np.linalg.norm(p - gate.position, axis=1)
    # It has approached if it was an opening in front of the gate before, and has flown forward
    # by one since
    farthest_back = np.minimum.accumulate(along)
    approached = (farthest_back <= -opening) & (along - farthest_back >= opening)
    close = distance <= CLOSE * opening
    # From the farthest point it then reached it has fallen back by an opening
    farthest = np.maximum.accumulate(np.where(approached & close, along, -np.inf))
    return np.flatnonzero(farthest - along >= opening)
