"""The course that is known in flight: the map, corrected near the vehicle."""

from __future__ import annotations

from dataclasses import replace
from math import hypot

from quadsim.course import Course
from quadsim.course.frames import frame_numbers
from quadsim.rotation import Vec3


class KnownCourse:
    """The map of a course, with true positions of gates and obstacles that have been near.

    The true position of a gate or an obstacle is known from the first instant at which the
    vehicle's horizontal distance to it is less than `known_from`. The passes through one frame
    become known together.
    """

    def __init__(self, mapped: Course, flown: Course, known_from: float):
        """Begin with the map.

        Args:
            mapped: the course of the map.
            flown: the same course with true positions.
            known_from: horizontal distance within which true positions become known [m].
        """
        self._mapped = mapped
        self._flown = flown
        self._known_from = known_from
        self._frames = frame_numbers(mapped.gates)
        self._known_frames: set[int] = set()
        self._known_obstacles: set[int] = set()
        self._course: Course | None = None

    def seen_from(self, position: Vec3) -> Course | None:
        """Return the course that is known after the vehicle has been at a position.

        The same object is returned until something new is known.

        Args:
            position: position of the vehicle [m].

        Returns:
            The course, None as long as only the map is known.
        """
        frames = {
            number
            for number, gate in zip(self._frames, self._flown.gates, strict=True)
            if self._is_near(position, gate.position)
        }
        obstacles = {
            k
            for k, obstacle in enumerate(self._flown.obstacles)
            if self._is_near(position, obstacle.centre)
        }
        if frames <= self._known_frames and obstacles <= self._known_obstacles:
            return self._course
        self._known_frames |= frames
        self._known_obstacles |= obstacles
        self._course = self._known()
        return self._course

    def _is_near(self, position: Vec3, place: Vec3) -> bool:
        return hypot(position[0] - place[0], position[1] - place[1]) < self._known_from

    def _known(self) -> Course:
        """Return the map with the known true positions."""
        gates = [
            there if number in self._known_frames else mapped
            for number, mapped, there in zip(
                self._frames, self._mapped.gates, self._flown.gates, strict=True
            )
        ]
        obstacles = [
            there if k in self._known_obstacles else mapped
            for k, (mapped, there) in enumerate(
                zip(self._mapped.obstacles, self._flown.obstacles, strict=True)
            )
        ]
        return replace(self._mapped, gates=tuple(gates), obstacles=tuple(obstacles))
