"""The referee of a corridor: ends a drive that reaches the goal, touches a wall or gets stuck."""

from __future__ import annotations

from collections.abc import Sequence

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
        c, p = self._corridor, np.array(p1[:2])
        if (p - c.points[self.passed + 1]) @ c.ends[self.passed] >= 0:
            self.passed += 1
        if np.linalg.norm(p - self._moved[1]) > 1.0:
            self._moved = t1, p
        if self.passed == len(c.lengths):
            self.outcome = "finished"
        elif abs(c.offset(self.passed, p)) > self._room:
            self.outcome = "crashed"
        elif t1 - self._moved[0] > STUCK:
            self.outcome = "stuck"
        elif t1 >= self._timeout:
            self.outcome = "timeout"
        return []
