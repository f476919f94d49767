"""The referee of a flight without gates: it ends after a given time."""

from __future__ import annotations

from collections.abc import Sequence
from math import dist

from quadsim.course import Vec3
from quadsim.race.events import Event


class DurationReferee:
    """Finished after so many seconds; the end counts as the one gate that is passed."""

    lap, next_gate = 1, 0

    def __init__(self, duration: float):
        """duration [s]"""
        self.outcome: str | None = None
        self.passed = 0
        self._duration = duration

    def observe(self, t0: float, p0: Vec3, t1: float, p1: Vec3, contacts: Sequence[str] = ()) -> list[Event]:
        """Judge one physics step."""
        if t1 < self._duration - 0.5 * (t1 - t0):
            return []
        self.outcome, self.passed = "finished", 1
        return [Event(t1, "pass", 1, 1, (0.0, 0.0), dist(p0[:2], p1[:2]) / (t1 - t0), (p1[0], p1[1], 0.0))]
