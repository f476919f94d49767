"""A corridor of two walls along a polygonal centre line, and the rules of a drive.

At a bend, one leg ends and the next begins at the line that halves the angle.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

STUCK = 5.0  # [s] within a metre of one place, after which a drive counts as stuck


@dataclass(frozen=True)
class Corridor:
    """A corridor in the plane."""

    width: float  # between the walls [m]
    # centre line from the start to the goal [m]; every leg is longer than its bends need
    points: tuple[tuple[float, float], ...]

    @cached_property
    def directions(self) -> np.ndarray:
        """The unit vectors along the legs.  (legs, 2)"""
        legs = np.diff(np.array(self.points), axis=0)
        return legs / np.linalg.norm(legs, axis=1, keepdims=True)

    @cached_property
    def lengths(self) -> np.ndarray:
        """The lengths of the legs [m].  (legs,)"""
        return np.linalg.norm(np.diff(np.array(self.points), axis=0), axis=1)

    @cached_property
    def ends(self) -> np.ndarray:
        """The unit normals of the lines at which legs end.  (legs, 2)

        The normals point forwards, at a bend along the mean direction of both legs.
        """
        before = self.directions
        after = np.vstack([before[1:], before[-1:]])
        both = before + after
        return both / np.linalg.norm(both, axis=1, keepdims=True)

    def offset(self, leg: int, p: np.ndarray) -> float:
        """Return the distance of a point from a leg's centre line, positive to the left [m].

        Args:
            leg: index, from 0.
            p: point (2,) [m].
        """
        ex, ey = self.directions[leg]
        dx, dy = p - self.points[leg + 1]
        return float(ex * dy - ey * dx)

    def is_beyond(self, leg: int, p: np.ndarray) -> bool:
        """Return whether a point (2,) [m] is beyond the line that ends the leg."""
        return bool((p - self.points[leg + 1]) @ self.ends[leg] >= 0)

    def walls(self) -> np.ndarray:
        """Return the left and the right wall as polylines.  (2, points, 2)"""
        directions = np.vstack([self.directions[:1], self.directions])
        normals = np.vstack([self.directions[:1], self.ends])
        # At each point the walls lie on the end line, farther apart if it crosses obliquely.
        across = np.stack([-normals[:, 1], normals[:, 0]], axis=1)
        reach = 0.5 * self.width / (normals * directions).sum(axis=1, keepdims=True)
        return np.stack([self.points + reach * across, self.points - reach * across])


# A zig-zag in the spirit of the paper's off-road experiment, whose own corridor is not published:
# legs of 21 m between turns of 101 to 112 degrees to alternate sides, so that the wheel has to be
# held near its lock for seconds and turned to the other lock on the next leg.
ZIGZAG = Corridor(
    width=9.0,
    points=(
        (6.0, 0.0),
        (20.0, 0.0),  # then 112 degrees left
        (12.0, 20.0),  # 101 right
        (33.0, 24.0),  # 101 left
        (25.0, 44.0),  # 101 right
        (40.0, 46.9),
    ),
)


class DriveReferee:
    """Judges a drive along a corridor.

    A drive finishes at the goal. It crashes if the vehicle's side touches a wall, is stuck after
    STUCK seconds within a metre of one place, and ends at the time limit.
    """

    def __init__(self, corridor: Corridor, half_width: float, timeout: float):
        """Begin at the start of the corridor.

        Args:
            corridor: the corridor.
            half_width: half of the vehicle's width [m].
            timeout: time limit [s].
        """
        self.outcome: str | None = None  # None until the drive has ended
        self.legs = 0  # number of completed legs
        self._corridor = corridor
        self._timeout = timeout
        self._most_offset = corridor.width / 2 - half_width
        # Time and place of the last progress by a metre.
        self._moved_at = 0.0
        self._moved_to = np.array(corridor.points[0])

    def observe(self, t: float, p: np.ndarray) -> None:
        """Judge the position p (2,) [m] at the time t [s], at the end of a physics step."""
        if self._corridor.is_beyond(self.legs, p):
            self.legs += 1
        if np.linalg.norm(p - self._moved_to) > 1.0:
            self._moved_at = t
            self._moved_to = p

        if self.legs == len(self._corridor.lengths):
            self.outcome = "finished"
        elif abs(self._corridor.offset(self.legs, p)) > self._most_offset:
            self.outcome = "crashed"
        elif t - self._moved_at > STUCK:
            self.outcome = "stuck"
        elif t >= self._timeout:
            self.outcome = "timeout"
