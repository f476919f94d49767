"""How far along the course: metres of straight legs through the gates, and the gap between two flights at one place."""

from __future__ import annotations

import numpy as np

from quadsim.course import Course


class Legs:
    """The straight legs from the start through the gates of every lap."""

    def __init__(self, course: Course, laps: int):
        centres = np.array([course.start.position, *(g.position for g in course.gates * laps)])  # (legs + 1, 3)
        self._from, self._to = centres, np.vstack([centres[1:], centres[-1]])  # after the finish: the last gate
        self.gates = len(course.gates)
        self.ends = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(centres, axis=0), axis=1)))  # [m]  (legs + 1,)

    @property
    def length(self) -> float:
        """Of the whole race [m]."""
        return float(self.ends[-1])

    @property
    def lap_ends(self) -> np.ndarray:
        """Progress at which each lap ends [m]."""
        return self.ends[self.gates :: self.gates]

    def progress(self, p: np.ndarray, passed: np.ndarray) -> np.ndarray:
        """[m] at positions p (n, 3) after so many gates: the share d0 / (d0 + d1) of the leg, by the distances from
        its two ends. It moves on from the gate at once, also where the way leads round. Never less than before.  (n,)
        """
        k = np.minimum(np.asarray(passed, int), len(self.ends) - 1)
        d0, d1 = (np.linalg.norm(p - end[k], axis=1) for end in (self._from, self._to))
        legs = np.append(np.diff(self.ends), 0.0)[k]
        return np.maximum.accumulate(self.ends[k] + legs * d0 / np.maximum(d0 + d1, 1e-9))


def time_at(place: np.ndarray, t: np.ndarray, progress: np.ndarray) -> np.ndarray:
    """When a flight was first this far along [s]; nan where it has not been.  (n,)"""
    first = np.flatnonzero(np.diff(progress, prepend=-1.0) > 0)  # a flight that hovers gets no farther
    if not len(first):
        return np.full(len(place), np.nan)
    return np.interp(place, progress[first], t[first], left=np.nan, right=np.nan)


def gap(place: np.ndarray, flight: tuple, reference: tuple) -> np.ndarray:
    """Seconds that a flight (t, progress) is behind the reference at each place; negative is ahead.  (n,)"""
    return time_at(place, *flight) - time_at(place, *reference)
