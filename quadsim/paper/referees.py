"""The referees of flights in the plane: a drive along a corridor, and a flight without gates of a
given duration."""

from __future__ import annotations

from collections.abc import Sequence
from math import dist

import numpy as np

from quadsim.course.corridor import Corridor
from quadsim.race.events import Event
from quadsim.rotation import Vec3

STUCK = 5.0  # [s] within a metre of one place


class CorridorReferee:
    """Finished at the goal; crashed where the vehicle's side touches a wall; stuck; timeout."""

    lap = 1

    def __init__(self, corridor: Corridor, half_width: float, timeout: float):
        """half_width: of the vehicle [m]; timeout [s]"""
        self.outcome: str | None = None
        self.passed = 0  # legs
        self._corridor, self._timeout = corridor, timeout
        self._room = corridor.width / 2 - half_width
        self._moved = (0.0, np.array(corridor.points[0]))  # time and place of the last metre made

    @property
    def next_gate(self) -> int:
        """Index of the leg that is driven."""
        return self.passed

    def observe(
        self, t0: float, p0: Vec3, t1: float, p1: Vec3, contacts: Sequence[str] = ()
    ) -> list[Event]:
        """Judge one physics step. A leg that was driven to its end line is a `pass`, with the leg
        as its gate."""
        c, p, leg = self._corridor, np.array(p1[:2]), self.passed
        events = []
        if (p - c.points[leg + 1]) @ c.ends[leg] >= 0:
            self.passed += 1
            events.append(_event("pass", self.passed, c.offset(leg, p), t0, p0, t1, p1))
        if np.linalg.norm(p - self._moved[1]) > 1.0:
            self._moved = t1, p
        if self.passed == len(c.lengths):
            self.outcome = "finished"
            return events
        left = c.offset(self.passed, p)
        if abs(left) > self._room:
            self.outcome = "crashed"
            events.append(_event("wall", 0, left, t0, p0, t1, p1))
        elif t1 - self._moved[0] > STUCK or t1 >= self._timeout:
            self.outcome = "stuck" if t1 - self._moved[0] > STUCK else "timeout"
            events.append(_event(self.outcome, 0, left, t0, p0, t1, p1))
        return events


class DurationReferee:
    """Finished after so many seconds; the end counts as the one gate that is passed."""

    lap, next_gate = 1, 0

    def __init__(self, duration: float):
        """duration [s]"""
        self.outcome: str | None = None
        self.passed = 0
        self._duration = duration

    def observe(
        self, t0: float, p0: Vec3, t1: float, p1: Vec3, contacts: Sequence[str] = ()
    ) -> list[Event]:
        """Judge one physics step."""
        if t1 < self._duration - 0.5 * (t1 - t0):
            return []
        self.outcome, self.passed = "finished", 1
        return [_event("pass", 1, 0.0, t0, p0, t1, p1)]


def _event(kind: str, gate: int, left: float, t0: float, p0: Vec3, t1: float, p1: Vec3) -> Event:
    """At the end of a step, `left` [m] of the centre line."""
    return Event(
        t1, kind, gate, 1, (left, 0.0), dist(p0[:2], p1[:2]) / (t1 - t0), (p1[0], p1[1], 0.0)
    )
