"""The openings that a point mass flies through, in order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from quadsim.course import Course
from quadsim.course.opening import free_half_sizes
from quadsim.value.leg import States

# Least half size of an opening [m]: the vehicle may be wider than it.
SMALLEST = 0.02
# The numbers of a crossing: offset from the middle to the left and up [m], velocity along the
# passage, to the left and up [m/s]
CROSSING = ("left", "up", "v_along", "v_left", "v_up")


@dataclass(frozen=True, eq=False)
class Passages:
    """Openings in the order of the flight.

    A *crossing* is a state in an opening: five numbers, see CROSSING.
    """

    position: np.ndarray  # middle of each opening [m]  (K, 3)
    # columns: unit vectors along the passage, to the left and up  (K, 3, 3)
    rotation: np.ndarray
    half: np.ndarray  # half width and half height within which the point mass passes [m]  (K, 2)

    def __len__(self) -> int:
        return len(self.position)

    def states(self, crossings: np.ndarray, k: int | slice = slice(None)) -> States:
        """Return positions and velocities of crossings in the world.

        Args:
            crossings: of one opening (..., 5), or of all of them (..., K, 5).
            k: which opening; default: all of them.
        """
        rotation = self.rotation[k]
        offset = np.einsum("...ij,...j->...i", rotation[..., 1:], crossings[..., :2])
        velocity = np.einsum("...ij,...j->...i", rotation, crossings[..., 2:])
        return States(self.position[k] + offset, velocity)


def passages_of(course: Course, radius: float, laps: int) -> Passages:
    """Return the openings of a race.

    Args:
        course: the course.
        radius: radius of the vehicle, by which an opening is smaller on each side [m].
        laps: number of laps.
    """
    gates = course.gates * laps
    half = [free_half_sizes(gate.opening, radius) for gate in gates]
    return Passages(
        position=np.array([gate.position for gate in gates], float),
        rotation=np.array([gate.rotation for gate in gates], float),
        half=np.maximum(half, SMALLEST),
    )
