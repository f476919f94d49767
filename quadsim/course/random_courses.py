"""Random courses: gates around a loop at random heights, each course checked as a file is, from a
seed alone."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count

import numpy as np

from quadsim.course.course import Course
from quadsim.course.course_file import parse_course
from quadsim.files.strict_yaml import FileError
from quadsim.streams import course_stream

OPENING = 1.5  # of every gate [m]
APART = 4.0  # two gates in turn, at least [m]
CLEAR = 1.2  # a straight leg from the frames of other gates, at least [m]
GATES = (5, 9)
RADIUS = (5.0, 12.0)  # of each gate from the middle of the loop [m]
HEIGHT = (1.1, 4.0)  # of gates' centres [m]
TURN = 0.7  # standard deviation of a gate's direction around that of the loop [rad]


def random_courses(number: int, seed: int) -> tuple[Course, ...]:
    """So many different courses, `random_SEED_1` and on. Same numbers, same courses; more begin
    with the same.

    Raises ValueError for a number or seed below what makes sense.
    """
    for name, value, least in (("number", number, 1), ("seed", seed, 0)):
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise ValueError(f"{name}: expected a whole number of at least {least}, got {value!r}")
    return tuple(
        _course(f"random_{seed}_{k}", course_stream(seed, k)) for k in range(1, number + 1)
    )


def _course(name: str, stream: np.random.SeedSequence) -> Course:
    """The first that is valid among those drawn."""
    rng = np.random.default_rng(stream)
    for text in (_text(rng) for _ in count()):
        try:
            course = parse_course(text, f"{name}.yaml")
        except FileError:
            continue
        if all(_legs_are_free(course)):
            return course
    raise AssertionError("unreachable")


def _text(rng: np.random.Generator) -> str:
    """A course as YAML; whether it is valid is not known yet."""
    n = int(rng.integers(GATES[0], GATES[1] + 1))
    way = rng.choice([-1, 1])  # round the loop to the left or to the right
    angles = way * (np.arange(n) + rng.uniform(-0.3, 0.3, n)) * 2 * np.pi / n + rng.uniform(
        0, 2 * np.pi
    )
    radii, heights = rng.uniform(*RADIUS, n), rng.uniform(*HEIGHT, n)
    p = np.column_stack([radii * np.cos(angles), radii * np.sin(angles), heights]).round(2)
    along = np.roll(p, -1, 0) - np.roll(p, 1, 0)  # from the gate before to the one after
    yaws = np.degrees(np.arctan2(along[:, 1], along[:, 0]) + rng.normal(0, TURN, n))
    yaws = (np.mod(yaws + 180, 360) - 180).round()
    back = np.radians(yaws[0])
    start = (p[0] - rng.uniform(4, 7) * np.array([np.cos(back), np.sin(back), 0])).round(2)
    start[2] = 0.5
    low, high = np.minimum(p.min(0), start) - 4, np.maximum(p.max(0), start) + 4
    box = [[float(np.floor(a)), float(np.ceil(b))] for a, b in zip(low[:2], high[:2], strict=True)]
    rows = (
        f"  - {{position: [{x:g}, {y:g}, {z:g}], yaw_deg: {yaw:g}}}"
        for (x, y, z), yaw in zip(p, yaws, strict=True)
    )
    return "\n".join(
        [
            "source: made at random by `race courses --generate`",
            "loop: true\nlaps: 3",
            f"opening: [{OPENING}, {OPENING}]",
            f"bounds: [{box[0]}, {box[1]}, [0, {high[2] - 1:.1f}]]",
            f"start: {{position: [{start[0]:g}, {start[1]:g}, {start[2]:g}], yaw_deg: {yaws[0]:g}}}",
            "gates:",
            *rows,
            "",
        ]
    )


def _legs_are_free(course: Course) -> Iterator[bool]:
    """For the start's leg and each one of a lap: long enough, and clear of the frames of other
    gates."""
    gates = course.gates
    legs = [(course.start.position, 0, len(gates))]  # from where, to which gate, from which gate
    legs += [(g.position, (k + 1) % len(gates), k) for k, g in enumerate(gates)]
    for begin, to, since in legs:
        line = np.linspace(begin, gates[to].position, 25)
        yield bool(np.linalg.norm(line[-1] - line[0]) >= APART)
        others = (g for k, g in enumerate(gates) if k not in (to, since))
        yield all(
            g.frame_distance(tuple(point)) >= CLEAR for g in others for point in line.tolist()
        )
