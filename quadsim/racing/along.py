"""A vehicle's progress in a race, which decides who is ahead.

A vehicle has passed some gates, and is near the straight leg to the next one. The share of the leg
that it has covered is d0 / (d0 + d1), where d0 and d1 are its distances from the two ends of the
leg. The share grows right after a gate, even if the vehicle first has to turn away from the next
one, where the distance to the next gate grows as well. On the first leg, before which vehicles
stand on a grid, the share is 1 - d1 / length, which is below 0 behind the start. The rules of a
race, its results and the page compare vehicles by this measure.
"""

from __future__ import annotations

from math import dist
from typing import NamedTuple, TypeVar

import numpy as np

from quadsim.course import Course
from quadsim.rotation import Vec3

Distance = TypeVar("Distance", float, np.ndarray)

# Distance of the two ends of a leg below which a vehicle on it counts as at its start [m]
SAME_PLACE = 1e-9


class Along(NamedTuple):
    """The progress of a vehicle; the vehicle with the larger progress is ahead.

    Examples:
        >>> from quadsim.racing.along import Along
        >>> Along(passed=3, share=0.2) > Along(passed=2, share=0.9)
        True
    """

    # gates passed since the start
    passed: int
    # of the leg to the next gate, up to 1; below 0 behind the start
    share: float

    @classmethod
    def of(cls, course: Course, passed: int, position: Vec3) -> Along:
        """Return the progress of a vehicle.

        Args:
            course: the course.
            passed: number of gates that the vehicle has passed.
            position: position of the vehicle [m].
        """
        gates = course.gates
        end = gates[passed % len(gates)].position
        to_end = dist(position, end)
        if not passed:
            return cls(0, share_of_first_leg(to_end, dist(course.start.position, end)))
        start = gates[(passed - 1) % len(gates)].position
        return cls(passed, share_of_leg(dist(position, start), to_end))


def share_of_leg(d0: Distance, d1: Distance) -> Distance:
    """Return the share of a leg that a vehicle has covered, from 0 to 1.

    Args:
        d0, d1: distances from the start and from the end of the leg [m].
    """
    return d0 / (d0 + d1 + SAME_PLACE)


def share_of_first_leg(d1: Distance, length: float) -> Distance:
    """Return the share of the first leg that is covered, which is below 0 behind the start.

    Args:
        d1: distance from the first gate [m].
        length: distance of the start from the first gate [m].
    """
    return 1.0 - d1 / max(length, SAME_PLACE)


class Legs:
    """The straight legs from the start through the gates of every lap.

    Attributes:
        gates: number of gates of a lap.
        ends: length of the race up to the start and up to each gate [m]  (legs + 1,)
        length: length of the whole race [m]
        lap_ends: length of the race up to the end of each lap [m]  (laps,)
    """

    def __init__(self, course: Course, laps: int):
        """Compute the legs of a race.

        Args:
            course: the course.
            laps: number of laps.
        """
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
        """Return the distances along the race that a flight has reached; they never decrease.

        Args:
            p: positions of the vehicle over time [m]  (n, 3)
            passed: number of gates passed at each position  (n,)

        Returns:
            The distance [m]  (n,).
        """
        leg = np.minimum(np.asarray(passed, int), len(self.ends) - 1)
        d0 = np.linalg.norm(p - self._from[leg], axis=1)
        d1 = np.linalg.norm(p - self._to[leg], axis=1)
        lengths = np.append(np.diff(self.ends), 0.0)
        on_first = share_of_first_leg(d1, float(lengths[0]))
        share = np.where(leg == 0, on_first, share_of_leg(d0, d1))
        return np.maximum.accumulate(self.ends[leg] + lengths[leg] * share)
