"""Legs: the distance of a vehicle along a race."""

from __future__ import annotations

import numpy as np

from quadsim.course import Course


class Legs:
    """The straight legs from the start through the gates of every lap.

    Attributes:
        gates: number of gates of a lap.
        ends: length of the way to the start and to each gate [m]  (legs + 1,)
        length: length of the whole race [m]
        lap_ends: length of the way to the end of each lap [m]  (laps,)
    """

    def __init__(self, course: Course, laps: int):
        gates = [gate.position for gate in course.gates]
        centres = np.array([course.start.position, *gates * laps])
        self._from = centres
        # After the finish follows a leg of zero length at the last gate.
        self._to = np.vstack([centres[1:], centres[-1]])
        lengths = np.linalg.norm(np.diff(centres, axis=0), axis=1)
        self.gates = len(course.gates)
        self.ends = np.append(0.0, np.cumsum(lengths))
        self.length = float(self.ends[-1])
        self.lap_ends = self.ends[self.gates :: self.gates]

    def progress(self, p: np.ndarray, passed: np.ndarray) -> np.ndarray:
        """Return the distances of positions along the race.

        On a leg the distance is the share d0 / (d0 + d1) of the leg, by the distances d0 and d1
        from its two ends: the result grows right after a gate, even on a detour, and never
        decreases.

        Args:
            p: positions [m]  (n, 3)
            passed: number of gates passed at each  (n,)

        Returns:
            The length of the way [m]  (n,)
        """
        leg = np.minimum(np.asarray(passed, int), len(self.ends) - 1)
        d0 = np.linalg.norm(p - self._from[leg], axis=1)
        d1 = np.linalg.norm(p - self._to[leg], axis=1)
        lengths = np.append(np.diff(self.ends), 0.0)[leg]
        along = self.ends[leg] + lengths * d0 / np.maximum(d0 + d1, 1e-9)
        return np.maximum.accumulate(along)
