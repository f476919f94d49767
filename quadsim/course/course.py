"""Course: gates, obstacles, start, bounds and laps as plain values.

They are read from YAML by quadsim.course.course_file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import dist
from pathlib import Path
from typing import Annotated, Any, TypedDict, Unpack

import numpy as np

from quadsim.course.obstacles import Obstacle
from quadsim.course.opening import (
    Bar,
    InGate,
    distance_to_frame,
    frame_bars,
    outer_half_sizes,
    rectangle_corners,
)
from quadsim.files.strict_yaml import setting, unit
from quadsim.rotation import Vec3, euler_matrix, in_frame

Second = Annotated[float, unit("s", gt=0)]


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

    @cached_property
    def rotation(self) -> np.ndarray:
        """The rotation world from gate, with the columns passage, left and up.  (3, 3)"""
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
            points: (n, 3) [m].

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
        return frame_bars(self.opening, self.frame_width)

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
        """Return a gate that is estimated to stand off the map.

        Args:
            gate: gate of the map.
            moved: its displacement from the map [m].
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


@dataclass(frozen=True)
class Published:
    """A time on these gates that others have published."""

    who: Annotated[str, setting("authors of the time")]
    time: Annotated[float, setting("time on these gates", unit="s", gt=0)]


class CourseChanges(TypedDict, total=False):
    """The keys of a course file."""

    name: str
    source: str
    loop: bool
    laps: int
    opening: Sequence[float]
    frame_width: float
    bounds: Sequence[Sequence[float]] | None
    start: Start | Mapping[str, Any]
    gates: Sequence[Gate | Mapping[str, Any]]
    obstacles: Sequence[Obstacle | Mapping[str, Any]]
    published: Sequence[Published | Mapping[str, Any]]


@dataclass(frozen=True)
class Course:
    """Gates to pass in order, from a standing start, and obstacles to keep clear of.

    Examples:
        >>> import quadsim
        >>> course = quadsim.load_course("figure8")
        >>> course.loop, round(course.lap_length, 1)
        (True, 74.4)
        >>> course.gates[0].position
        (0.0, 0.0, 1.5)
    """

    name: str
    source: str
    gates: tuple[Gate, ...]
    start: Start
    # ((x_min, x_max), (y_min, y_max), (z_min, z_max)) [m]
    bounds: tuple[tuple[float, float], ...]
    # whether the first gate comes after the last; a lap ends at the last gate
    loop: bool
    laps: int
    published: tuple[Published, ...]
    # the YAML it came from, kept with every run
    text: str
    # numbered from 1
    obstacles: tuple[Obstacle, ...] = ()

    def __repr__(self) -> str:
        """Return one short line; `to_yaml` has all numbers."""
        parts = [f"{len(self.gates)} gates"]
        if self.obstacles:
            parts.append(f"{len(self.obstacles)} obstacles")
        parts.append(f"{self.laps} laps" if self.loop else "open")
        return f"<Course {self.name}: {', '.join(parts)}>"

    @cached_property
    def lap_length(self) -> float:
        """The length of straight lines through the gates once [m].

        On a loop they are closed, on an open course they begin at the start.
        """
        centres = [gate.position for gate in self.gates]
        before = [centres[-1] if self.loop else self.start.position, *centres[:-1]]
        return sum(dist(a, b) for a, b in zip(before, centres, strict=True))

    def but(self, **changes: Unpack[CourseChanges]) -> Course:
        """Return the course with other gates, obstacles or laps, checked as a course file is.

        Default bounds are computed anew. Published times are dropped where gates or obstacles
        change, as they are times on the gates of before.

        Args:
            changes: keys of a course file, see docs/courses.md. `gates` and `obstacles` take Gate,
                Box and Cylinder objects, whose angles are in radians, or mappings as in a file.

        Raises:
            SettingError: an entry cannot be used, or the gates do not fit together (a ValueError).

        Examples:
            >>> from dataclasses import replace
            >>> import quadsim
            >>> course = quadsim.load_course("figure8")
            >>> first, *others = course.gates
            >>> raised = course.but(laps=1, gates=[replace(first, position=(0, 0, 2.5)), *others])
            >>> raised.gates[0].position, raised.laps
            ((0.0, 0.0, 2.5), 1)
        """
        from quadsim.course.course_file import changed  # here: it imports this module

        return changed(self, changes)

    def to_yaml(self, path: str | Path | None = None) -> str:
        """Return the course as a course file, which `load_course` reads to an equal course.

        That is the course's text where it describes the course; otherwise angles are equal up to
        the rounding of degrees.

        Args:
            path: a file to write; its name becomes the course's if the text has none. None writes
                nothing.

        Raises:
            SettingError: no course file describes this course (a ValueError).
            FileError: the file cannot be written.

        Examples:
            >>> import quadsim
            >>> short = quadsim.load_course("figure8").but(name="short", laps=1)
            >>> text = short.to_yaml("short.yaml")
            >>> quadsim.load_course("short.yaml").laps
            1
        """
        from quadsim.course.course_file import as_yaml
        from quadsim.files.yaml_text import written

        return written(as_yaml(self), path)

    def points(self, frames: bool = True) -> np.ndarray:
        """Return the points that a view of the course has to show.  (n, 3)

        Args:
            frames: whether these are the corners of frames and obstacles, or gates' centres alone;
                the start is one of them in either case.
        """
        start = np.array([self.start.position])
        if not frames:
            return np.vstack([start, [gate.position for gate in self.gates]])
        of_gates = [gate.corners(gate.frame_width) for gate in self.gates]
        of_obstacles = [obstacle.corners() for obstacle in self.obstacles]
        return np.vstack([start, *of_gates, *of_obstacles])
