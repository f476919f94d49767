"""Draft: a course that is being edited, as an immutable record.

A draft has the entries of a course file, in the file's units, and may have faults. Every edit
returns a new draft, so that undo returns to the previous draft. `errors` match `race check`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import acos, cos, degrees, radians, sin
from typing import Any, Literal, NamedTuple

from quadsim.course import Course, Gate
from quadsim.course.course import course_entries, course_errors, course_of
from quadsim.course.course_file import (
    OF_FRAMES,
    BoxEntry,
    CourseFile,
    CylinderEntry,
    GateEntry,
    ObstacleEntry,
    Point,
    StartEntry,
    in_flown_order,
    written_entries,
)
from quadsim.files.strict_yaml import FileError
from quadsim.files.yaml_text import dump
from quadsim.rotation import Quaternion, euler_angles, from_euler, product
from quadsim.web.course.numbers import (
    ATTITUDE,
    POSITION,
    Number,
    Part,
    Values,
    as_obstacle,
    numbers_of,
    with_numbers,
)

# distance from a gate to a new gate behind it [m]
APART = 5.0
# distance from a gate to a new obstacle on its left [m]
BESIDE = 3.0
# Largest number of gates, and of obstacles, of a draft
MOST = 100
# Steps of a handle [m, deg]
STEP = 0.01
TURN = 0.1
# Smallest drawn size [m]; a size of 0 may be typed, and is then an error
DRAWN = 0.01

Kind = Literal["start", "bounds", "gate", "obstacle"]


class Item(NamedTuple):
    """A part of a course that can be chosen."""

    kind: Kind
    # index within its kind, from 0
    index: int = 0

    def __str__(self) -> str:
        """Return the name on the page; gates and obstacles count from 1."""
        return f"{self.kind} {self.index + 1}" if self.kind in ("gate", "obstacle") else self.kind


START = Item("start")
BOUNDS = Item("bounds")


class Pose(NamedTuple):
    """The position [m] and the attitude of a handle in the scene."""

    position: Point
    attitude: Quaternion


@dataclass(frozen=True)
class Draft:
    """The entries of a course file, and the chosen item.

    Every gate of a draft has its own opening and frame; obstacles are boxes or cylinders.
    """

    entries: CourseFile
    item: Item = START

    @classmethod
    def empty(cls) -> Draft:
        """Return a start without gates."""
        start = StartEntry(position=(0.0, 0.0, 1.0), yaw_deg=0.0)
        return cls(CourseFile(opening=(1.5, 1.5), start=start, gates=()))

    @classmethod
    def copy_of(cls, course: Course) -> Draft:
        """Return a copy of a course without published times, which apply to its gates only.

        Raises:
            FileError: the course's text is not a course.
        """
        given = in_flown_order(course_entries(course))
        own = [
            replace(gate, **{key: getattr(gate, key) or getattr(given, key) for key in OF_FRAMES})
            for gate in given.gates
        ]
        source = f"edited on the page of quadsim, from {course.name}"
        entries = replace(given, name=None, source=source, gates=tuple(own), published=())
        return cls(entries, Item("gate", 0))

    @property
    def items(self) -> tuple[Item, ...]:
        """The items that can be chosen."""
        gates = [Item("gate", i) for i in range(len(self.entries.gates))]
        obstacles = [Item("obstacle", i) for i in range(len(self.entries.obstacles))]
        return (START, *gates, *obstacles, BOUNDS)

    def choose(self, item: Item) -> Draft:
        """Choose an item, or the start if there is no item of this number."""
        return replace(self, item=item if item in self.items else START)

    # Numbers that are typed.

    def numbers(self) -> dict[Number, float]:
        """Return the numbers of the chosen item."""
        return numbers_of(self._chosen)

    def with_numbers(self, changed: Values) -> Draft:
        """Return the draft with changed numbers of the chosen item.

        Raises:
            KeyError: the item has no such number.
        """
        part = with_numbers(self._chosen, changed)
        index = self.item.index
        match part:
            case GateEntry():
                gates = self.entries.gates
                return self.with_course(gates=(*gates[:index], part, *gates[index + 1 :]))
            case BoxEntry() | CylinderEntry():
                old = self.entries.obstacles
                obstacles = (*old[:index], as_obstacle(part), *old[index + 1 :])
                return self.with_course(obstacles=obstacles)
            case StartEntry():
                return self.with_course(start=part)
        return self.with_course(bounds=part)

    def with_course(self, **changed: Any) -> Draft:
        """Return the draft with changed entries of the whole course, such as laps."""
        return replace(self, entries=replace(self.entries, **changed))

    # Moves by a handle.

    @property
    def pose(self) -> Pose | None:
        """The pose of the chosen item; None for the bounds."""
        numbers = self.numbers()
        if self.item == BOUNDS:
            return None
        x, y, z = (numbers[axis] for axis in POSITION)
        yaw, pitch, roll = (radians(numbers.get(angle, 0.0)) for angle in ATTITUDE)
        return Pose((x, y, z), from_euler(yaw, pitch, roll))

    def moved_to(self, pose: Pose) -> Draft:
        """Return the draft with the chosen item near a pose, in steps of STEP and TURN.

        A coordinate and an attitude that differ by less than half a step stay as they are.
        """
        before = self.pose
        if before is None:
            return self
        changed: dict[Number, float] = {}
        for axis, old, new in zip(POSITION, before.position, pose.position, strict=True):
            if abs(new - old) > STEP / 2:
                changed[axis] = _stepped(new, STEP)
        if _between(before.attitude, pose.attitude) > TURN / 2:
            has = self.numbers()
            for angle, new in zip(ATTITUDE, euler_angles(pose.attitude), strict=True):
                if angle in has:
                    changed[angle] = _stepped(degrees(new), TURN)
        return self.with_numbers(changed) if changed else self

    # Items that are added, reordered and deleted.

    def add_gate(self) -> Draft:
        """Add and choose a gate behind the chosen gate, or behind the last one.

        Raises:
            ValueError: the draft has the largest number of gates.
        """
        gates = self.entries.gates
        _expect_room(gates, "gates")
        is_gate = self.item.kind == "gate"
        index = self.item.index + 1 if is_gate else len(gates)
        start = self.entries.start
        before = gates[index - 1] if index else None
        last = before or GateEntry(
            position=start.position,
            yaw_deg=start.yaw_deg,
            **{key: getattr(self.entries, key) for key in OF_FRAMES},
        )
        ahead = radians(last.yaw_deg)
        x, y, z = last.position
        # Horizontal direction only, so that a gate that points down does not lead below the ground
        position = (x + APART * cos(ahead), y + APART * sin(ahead), max(z, 1.5 * _half(last)))
        rounded = tuple(_stepped(each, STEP) for each in position)
        gate = replace(last, position=rounded, pitch_deg=0.0, roll_deg=0.0)
        return self._with_gates((*gates[:index], gate, *gates[index:]), index)

    def add_box(self) -> Draft:
        """Add a box on the ground, left of the chosen item.

        Raises:
            ValueError: the draft has the largest number of obstacles.
        """
        x, y = self._beside()
        box = BoxEntry(centre=(x, y, 1.0), size=(0.5, 0.5, 2.0))
        return self._with_obstacle(ObstacleEntry(box=box))

    def add_pole(self) -> Draft:
        """Add a pole on the ground, left of the chosen item.

        Raises:
            ValueError: the draft has the largest number of obstacles.
        """
        x, y = self._beside()
        pole = CylinderEntry(base=(x, y, 0.0), radius=0.1, height=3.0)
        return self._with_obstacle(ObstacleEntry(cylinder=pole))

    def shift(self, by: int) -> Draft:
        """Move the chosen gate to an earlier (-1) or later (1) place in the order.

        A move beyond the first or the last place, and a move of another item, have no effect.
        """
        index = self.item.index + by
        gates = list(self.entries.gates)
        if self.item.kind != "gate" or not 0 <= index < len(gates):
            return self
        gates.insert(index, gates.pop(self.item.index))
        return self._with_gates(tuple(gates), index)

    def delete(self) -> Draft:
        """Return the draft without the chosen gate or obstacle; bounds become the default ones.

        The start stays.
        """
        index = self.item.index
        match self.item.kind:
            case "gate":
                gates = self.entries.gates
                return self._with_gates((*gates[:index], *gates[index + 1 :]), index)
            case "obstacle":
                obstacles = self.entries.obstacles
                left = (*obstacles[:index], *obstacles[index + 1 :])
                without = self.with_course(obstacles=left)
                return without.choose(Item("obstacle", min(index, len(left) - 1)))
            case "bounds":
                return self.with_course(bounds=None)
        return self

    # The described course.

    def text(self) -> str:
        """Return the text of the course file, without entries at their defaults."""
        return dump(written_entries(self.entries))

    def errors(self, name: str) -> list[FileError]:
        """Return the errors that `race check` would report for the file, in its order."""
        return course_errors(self.text(), f"{name}.yaml")

    def course(self, name: str = "draft") -> Course:
        """Return the course, even if it has errors."""
        return course_of(self.entries, name, self.text())

    def drawn(self) -> Course:
        """Return the course for drawing, with sizes of at least DRAWN [m]."""
        course = self.course()
        return replace(
            course,
            gates=tuple(map(_drawn_gate, course.gates)),
            obstacles=tuple(
                replace(obstacle, **_drawn_sizes(obstacle)) for obstacle in course.obstacles
            ),
        )

    @property
    def _chosen(self) -> Part:
        """The entry of the chosen item."""
        match self.item.kind:
            case "start":
                return self.entries.start
            case "gate":
                return self.entries.gates[self.item.index]
            case "obstacle":
                obstacle = self.entries.obstacles[self.item.index]
                part = obstacle.box or obstacle.cylinder
                if part is not None:
                    return part
        x, y, z = self.entries.bounds or self.course().bounds
        return x, y, z

    def _with_gates(self, gates: tuple[GateEntry, ...], index: int) -> Draft:
        """Return the draft with these gates, of which one is chosen."""
        return self.with_course(gates=gates).choose(Item("gate", min(index, len(gates) - 1)))

    def _with_obstacle(self, obstacle: ObstacleEntry) -> Draft:
        """Return the draft with an additional obstacle, which is chosen."""
        obstacles = self.entries.obstacles
        _expect_room(obstacles, "obstacles")
        draft = self.with_course(obstacles=(*obstacles, obstacle))
        return draft.choose(Item("obstacle", len(obstacles)))

    def _beside(self) -> tuple[float, float]:
        """Return a position left of the chosen item; for the bounds, left of the start [m]."""
        pose = self.pose or self.choose(START).pose
        if pose is None:
            return 0.0, BESIDE
        yaw, _, _ = euler_angles(pose.attitude)
        x, y, _ = pose.position
        return _stepped(x - BESIDE * sin(yaw), STEP), _stepped(y + BESIDE * cos(yaw), STEP)


def _stepped(value: float, step: float) -> float:
    """Return the nearest multiple of a step, as a number of few digits; -0.0 becomes 0.0."""
    return round(round(value / step) * step, 6) + 0.0


def _between(a: Quaternion, b: Quaternion) -> float:
    """Return the angle between two attitudes [deg]."""
    w, _, _, _ = product((a[0], -a[1], -a[2], -a[3]), b)
    return 2.0 * degrees(acos(min(abs(w), 1.0)))


def _half(gate: GateEntry) -> float:
    """Return half the height of a gate's opening [m]."""
    return gate.opening[1] / 2 if gate.opening else 0.0


def _expect_room(present: Sequence[object], what: str) -> None:
    """Raise ValueError if the largest number is reached."""
    if len(present) >= MOST:
        raise ValueError(f"{what}: expected at most {MOST} on the page, got {len(present)} already")


def _drawn_gate(gate: Gate) -> Gate:
    width, height = gate.opening
    return replace(
        gate,
        opening=(max(width, DRAWN), max(height, DRAWN)),
        frame_width=max(gate.frame_width, DRAWN),
        frame_depth=max(gate.frame_depth, DRAWN),
    )


def _drawn_sizes(obstacle: Any) -> dict[str, Any]:
    """Return the sizes of an obstacle for drawing."""
    if hasattr(obstacle, "size"):
        return {"size": tuple(max(size, DRAWN) for size in obstacle.size)}
    return {name: max(getattr(obstacle, name), DRAWN) for name in ("radius", "height")}
