"""Gates and the start, as plain values."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from quadsim.course.opening import (
    FRAME_DEPTH,
    Bar,
    InGate,
    distance_to_frame,
    frame_bars,
    outer_half_sizes,
    rectangle_corners,
)
from quadsim.rotation import Vec3, euler_matrix, in_frame


@dataclass(frozen=True)
class Gate:
    """A rectangular opening in a flat frame.

    The gate frame has x along the legal passage, y to the left and z up. Sizes, planes and sides of
    the opening are computed in quadsim.course.opening.

    Examples:
        >>> from quadsim import Gate
        >>> level = {"yaw": 0.0, "pitch": 0.0, "roll": 0.0}  # [rad]
        >>> gate = Gate((5.0, 0.0, 2.0), **level, opening=(1.5, 1.5), frame_width=0.2)
        >>> gate.to_local((6.0, 0.5, 2.0))
        InGate(along=1.0, left=0.5, up=0.0)
    """

    # centre of the opening, ENU [m]
    position: Vec3
    # [rad]; a positive pitch turns the passage down
    yaw: float
    pitch: float
    roll: float
    # width (y) and height (z) [m]
    opening: tuple[float, float]
    # width of the bars around the opening [m]
    frame_width: float
    # depth of the bars along the passage [m]
    frame_depth: float = field(default=FRAME_DEPTH, kw_only=True)

    @cached_property
    def rotation(self) -> np.ndarray:
        """The rotation from gate to world axes, with the columns passage, left and up.  (3, 3)"""
        return euler_matrix(self.yaw, self.pitch, self.roll)

    @cached_property
    def axes(self) -> tuple[Vec3, Vec3, Vec3]:
        """The gate's axes passage, left and up in the world, as plain floats."""
        passage, left, up = self.rotation.T.tolist()
        return tuple(passage), tuple(left), tuple(up)

    def to_local(self, p: Vec3) -> InGate:
        """Return a point of the world in the gate frame [m]."""
        c = self.position
        return InGate(*in_frame((p[0] - c[0], p[1] - c[1], p[2] - c[2]), *self.axes))

    def to_local_rows(self, points: np.ndarray) -> InGate:
        """Return points of the world in the gate frame [m].

        Args:
            points: points in the world [m]  (n, 3).

        Returns:
            An InGate of three arrays (n,).
        """
        away = points - self.position
        return InGate(*(away @ self.rotation).T)

    def to_world(self, p: InGate) -> Vec3:
        """Return a point of the gate frame in the world [m]."""
        x, y, z = (self.position + self.rotation @ p).tolist()
        return x, y, z

    @property
    def bars(self) -> tuple[Bar, Bar, Bar, Bar]:
        """The four bars of the frame, in the gate frame."""
        return frame_bars(self.opening, self.frame_width, self.frame_depth)

    def corners(self, border: float = 0.0) -> np.ndarray:
        """Return the corners of the opening, `border` [m] farther out, in the world.  (4, 3)"""
        local = rectangle_corners(outer_half_sizes(self.opening, border))
        return self.position + local @ self.rotation.T

    def frame_distance(self, point: Vec3) -> float:
        """Return the distance from a point of the world to the nearest bar [m].

        Bars are taken as flat; the distance is 0 on a bar.
        """
        return distance_to_frame(self.to_local(point), self.opening, self.frame_width)


@dataclass(frozen=True)
class EstimatedGate(Gate):
    """A gate at its estimated position, with the uncertainty of the estimate."""

    # standard deviation of the position relative to the vehicle, the largest of x, y and z [m]
    std: float = 0.0

    @classmethod
    def of(cls, gate: Gate, moved: Vec3, std: float) -> EstimatedGate:
        """Return a gate at an estimated displacement from its position on the map.

        Args:
            gate: gate of the map.
            moved: displacement of the gate from the map [m].
            std: standard deviation of its position relative to the vehicle [m].
        """
        x, y, z = gate.position
        dx, dy, dz = moved
        return cls(
            position=(x + dx, y + dy, z + dz),
            yaw=gate.yaw,
            pitch=gate.pitch,
            roll=gate.roll,
            opening=gate.opening,
            frame_width=gate.frame_width,
            frame_depth=gate.frame_depth,
            std=std,
        )


@dataclass(frozen=True)
class Start:
    """The pose in which a flight begins, at rest.

    Examples:
        >>> from quadsim import Start
        >>> start = Start(position=(0.0, 0.0, 1.0), yaw=1.57)
    """

    # [m]
    position: Vec3
    # [rad]
    yaw: float
