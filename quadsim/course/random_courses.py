"""Random courses from a seed: gates around a loop at random heights.

Each course passes the checks of a course file.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from quadsim.course.course import Course, parse_course
from quadsim.files.strict_yaml import FileError
from quadsim.rotation import Vec3
from quadsim.streams import course_stream

# [m] width and height of every gate
OPENING = 1.5
# [m] between two gates in turn, at least
APART = 4.0
# [m] from a straight leg to the frames of other gates, at least
CLEAR = 1.2
# number of gates, least and most
GATES = (5, 9)
# [m] of each gate from the middle of the loop, least and most
RADIUS = (5.0, 12.0)
# [m] of gates' centres, least and most
HEIGHT = (1.1, 4.0)
# [rad] standard deviation of a gate's direction from the loop's direction
TURN = 0.7


class Leg(NamedTuple):
    """A straight line to a gate."""

    begin: Vec3
    # index of the gate that it leads to
    to: int
    # index of the gate from which it leads; None: the start
    since: int | None


def random_courses(number: int, seed: int) -> tuple[Course, ...]:
    """Return different random courses, named `random_SEED_1` and on.

    The same arguments give the same courses, and a larger `number` only adds courses at the end.

    Args:
        number: number of courses, at least 1.
        seed: seed, at least 0.

    Raises:
        ValueError: an argument is below its least value.

    Examples:
        >>> from quadsim.course.random_courses import random_courses
        >>> [course.name for course in random_courses(2, seed=1)]
        ['random_1_1', 'random_1_2']
    """
    for name, value, least in (("number", number, 1), ("seed", seed, 0)):
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise ValueError(f"{name}: expected a whole number of at least {least}, got {value!r}")
    return tuple(
        _course(f"random_{seed}_{k}", course_stream(seed, k)) for k in range(1, number + 1)
    )


def _course(name: str, stream: np.random.SeedSequence) -> Course:
    """Draw courses until one is valid, and return it."""
    rng = np.random.default_rng(stream)
    while True:
        try:
            course = parse_course(_draw(rng), f"{name}.yaml")
        except FileError:
            continue
        if _legs_are_free(course):
            return course


def _draw(rng: np.random.Generator) -> str:
    """Draw a course and return it as YAML; it need not be valid."""
    # Gates stand around the loop, to the left or to the right.
    n = int(rng.integers(GATES[0], GATES[1] + 1))
    way = rng.choice([-1, 1])
    spread = rng.uniform(-0.3, 0.3, n)
    first = rng.uniform(0, 2 * np.pi)
    angles = way * (np.arange(n) + spread) * 2 * np.pi / n + first
    radii = rng.uniform(*RADIUS, n)
    heights = rng.uniform(*HEIGHT, n)
    p = np.column_stack([radii * np.cos(angles), radii * np.sin(angles), heights]).round(2)

    # They face along the loop, from the previous to the next gate, with a random turn.
    along = np.roll(p, -1, 0) - np.roll(p, 1, 0)
    yaws = np.degrees(np.arctan2(along[:, 1], along[:, 0]) + rng.normal(0, TURN, n))
    yaws = (np.mod(yaws + 180, 360) - 180).round()

    # The start lies in front of the first gate.
    yaw = np.radians(yaws[0])
    start = (p[0] - rng.uniform(4, 7) * np.array([np.cos(yaw), np.sin(yaw), 0])).round(2)
    start[2] = 0.5
    x, y, z = start

    low = np.minimum(p.min(0), start) - 4
    high = np.maximum(p.max(0), start) + 4
    spans = [
        [float(np.floor(a)), float(np.ceil(b))] for a, b in zip(low[:2], high[:2], strict=True)
    ]
    gates = [
        f"  - {{position: [{x:g}, {y:g}, {z:g}], yaw_deg: {yaw:g}}}"
        for (x, y, z), yaw in zip(p, yaws, strict=True)
    ]
    lines = [
        "source: made at random by `race courses --generate`",
        "loop: true\nlaps: 3",
        f"opening: [{OPENING}, {OPENING}]",
        f"bounds: [{spans[0]}, {spans[1]}, [0, {high[2] - 1:.1f}]]",
        f"start: {{position: [{x:g}, {y:g}, {z:g}], yaw_deg: {yaws[0]:g}}}",
        "gates:",
        *gates,
        "",
    ]
    return "\n".join(lines)


def _legs_are_free(course: Course) -> bool:
    """Return whether all legs are long enough and clear of the frames of other gates."""
    gates = course.gates
    legs = [Leg(course.start.position, to=0, since=None)]
    legs += [Leg(gate.position, (k + 1) % len(gates), k) for k, gate in enumerate(gates)]
    return all(_leg_is_free(course, leg) for leg in legs)


def _leg_is_free(course: Course, leg: Leg) -> bool:
    """Return whether a leg is long enough and clear of the frames of other gates."""
    line = np.linspace(leg.begin, course.gates[leg.to].position, 25)
    if np.linalg.norm(line[-1] - line[0]) < APART:
        return False
    others = [gate for k, gate in enumerate(course.gates) if k not in (leg.to, leg.since)]
    return all(
        gate.frame_distance((x, y, z)) >= CLEAR for gate in others for x, y, z in line.tolist()
    )
