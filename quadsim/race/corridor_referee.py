"""The referee of a corridor: ends a drive that reaches the goal, touches a wall or gets stuck."""

from __future__ import annotations

from collections.abc import Sequence
from math import dist

import numpy as np

from quadsim.course import Vec3
from quadsim.course.corridor import Corridor
from quadsim.race.events import Event

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

    def observe(self, t0: float, p0: Vec3, t1: float, p1: Vec3, contacts: Sequence[str] = ()) -> list[Event]:
        """Judge one physics step. A leg that was driven to its end line is a `pass`, with the leg as its gate."""
        c, p = self._corridor, np.array(p1[:2])
        events = []
        if (p - c.points[self.passed + 1]) @ c.ends[self.passed] >= 0:
            self.passed += 1
            events.append(self._event("pass", t0, p0, t1, p1))
        if np.linalg.norm(p - self._moved[1]) > 1.0:
            self._moved = t1, p
        if self.passed == len(c.lengths):
            self.outcome = "finished"
        elif abs(c.offset(self.passed, p)) > self._room:
            self.outcome = "crashed"
            events.append(self._event("wall", t0, p0, t1, p1))
        elif t1 - self._moved[0] > STUCK or t1 >= self._timeout:
            self.outcome = "stuck" if t1 - self._moved[0] > STUCK else "timeout"
            events.append(self._event(self.outcome, t0, p0, t1, p1))
        return events

    def _event(self, kind: str, t0: float, p0: Vec3, t1: float, p1: Vec3) -> Event:
        leg = min(self.passed - (kind == "pass"), len(self._corridor.lengths) - 1)
        left = self._corridor.offset(leg, np.array(p1[:2]))
        speed = dist(p0[:2], p1[:2]) / (t1 - t0)
        return Event(t1, kind, self.passed if kind == "pass" else 0, 1, (left, 0.0), speed, (p1[0], p1[1], 0.0))
