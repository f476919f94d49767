"""Random tracks as in the Learning Systems Lab's level 3, with four gates and four poles.

The rules follow lsy_drone_racing/envs/randomize.py of learnsyslab/lsy_drone_racing (9c01c96, MIT):
a gate and a pole in turn are placed in an arena so that

* a gate keeps GATE_FREE from gates and the start, POLE_FREE from poles, and BORDER from the walls;
  it stands away from the existing legs, if there is room;
* its passage points along the leg that leads to it, turned by up to TURN;
* a pole keeps POLE_FREE from gates, START_FREE from the start and POLES_APART from poles; it stands
  beside the leg that leads to the gate, if there is room.

The original draws places on a grid of 0.1 m from other random numbers, and if no place is free it
takes the place that breaks the rules least. Here the whole track is drawn again.
"""

from __future__ import annotations

import re

import numpy as np

from quadsim.course.course import Course, parse_course
from quadsim.files.strict_yaml import FileError
from quadsim.streams import course_stream

# "lsy_level3-7"
NAME = re.compile(r"lsy_level3-(?P<number>\d{1,6})")
# [m] half the size of the arena along x and y
ARENA = np.array([2.5, 1.5])
# [m] distances between centres
BORDER = 0.5
START_FREE = 1.0
GATE_FREE = 1.0
POLE_FREE = 0.8
POLES_APART = 0.3
# [m] half the width of the corridor along a leg
CORRIDOR = 0.5
# [rad] of a gate from the leg that leads to it, at most
TURN = 0.75
# [m] heights of the gates' centres, in the order of flight
HEIGHTS = (0.7, 1.2, 0.7, 1.2)
# Places that are tried for each gate and pole
TRIES = 200
Place = np.ndarray  # x, y [m]


def lsy_track(number: int) -> Course:
    """Return the random track with this number, named lsy_level3-NUMBER.

    Args:
        number: seed of the track, at least 0.

    Examples:
        >>> from quadsim.course.lsy_tracks import lsy_track
        >>> course = lsy_track(7)
        >>> course.name, len(course.gates), len(course.obstacles)
        ('lsy_level3-7', 4, 4)
    """
    name = f"lsy_level3-{number}"
    rng = np.random.default_rng(course_stream(number, 1))
    while True:
        text = _draw(rng)
        if text is None:
            continue
        try:
            return parse_course(text, f"{name}.yaml")
        except FileError:  # such as a gate whose line is blocked by a pole
            continue


def _draw(rng: np.random.Generator) -> str | None:
    """Draw a track and return it as YAML, None if there is no room for a gate or pole."""
    start = np.zeros(2)
    gates: list[Place] = []
    poles: list[Place] = []
    legs: list[tuple[Place, Place]] = []
    yaws = []
    before = start
    for _ in HEIGHTS:
        aside = [rng.uniform(BORDER - ARENA, ARENA - BORDER) for _ in range(TRIES)]
        free = [
            p
            for p in aside
            if _apart(p, [start], START_FREE)
            and _apart(p, gates, GATE_FREE)
            and _apart(p, poles, POLE_FREE)
        ]
        off_the_legs = [p for p in free if not any(_in_corridor(p, leg) for leg in legs)]
        gate = _first(off_the_legs, free)
        if gate is None:
            return None
        along = gate - before
        yaws.append(np.arctan2(along[1], along[0]) + rng.uniform(-TURN, TURN))
        gates.append(gate)
        legs.append((before, gate))

        aside = [rng.uniform(BORDER - ARENA, ARENA - BORDER) for _ in range(TRIES)]
        free = [
            p
            for p in aside
            if _apart(p, [start], START_FREE)
            and _apart(p, gates, POLE_FREE)
            and _apart(p, poles, POLES_APART)
        ]
        pole = _first([p for p in free if _in_corridor(p, legs[-1])], free)
        if pole is None:
            return None
        poles.append(pole)
        before = gate
    return _text(gates, yaws, poles)


def _first(*choices: list[Place]) -> Place | None:
    """Return the first place of the first list that is not empty, None if all are empty."""
    return next((places[0] for places in choices if places), None)


def _apart(place: Place, others: list[Place], least: float) -> bool:
    return all(np.hypot(*(place - other)) >= least for other in others)


def _in_corridor(place: Place, leg: tuple[Place, Place]) -> bool:
    """Return whether a place lies beside a leg, between its ends."""
    begin, end = leg
    length = np.hypot(*(end - begin))
    x, y = (end - begin) / length
    along = (place - begin) @ (x, y)
    across = (place - begin) @ (-y, x)
    return bool(0.0 <= along <= length and abs(across) < CORRIDOR)


def _text(gates: list[Place], yaws: list[float], poles: list[Place]) -> str:
    """Return the YAML of a track."""
    degrees = np.round(np.degrees(np.arctan2(np.sin(yaws), np.cos(yaws))), 1)
    rows = zip(gates, HEIGHTS, degrees, strict=True)
    lines = [
        "source: drawn by the rules of learnsyslab/lsy_drone_racing, level 3",
        "opening: [0.4, 0.4]",
        "frame_width: 0.16",
        "frame_depth: 0.02",
        "bounds: [[-3, 3], [-3, 3], [0, 2.5]]   # where their simulator ends a flight",
        "start: {position: [0, 0, 0], yaw_deg: 0}",
        "gates:",
        *(f"  - {{position: [{x:.3f}, {y:.3f}, {z}], yaw_deg: {yaw}}}" for (x, y), z, yaw in rows),
        "obstacles:",
        *(
            f"  - cylinder: {{base: [{x:.3f}, {y:.3f}, 0], radius: 0.015, height: 1.55}}"
            for x, y in poles
        ),
        "",
    ]
    return "\n".join(lines)
