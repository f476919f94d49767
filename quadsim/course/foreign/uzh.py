"""Tracks of UZH's RPG: Flightmare, agile_flight, Agilicious and marl-racing, in YAML.

    gates:
      Gate1: {position: [x, y, z], rotation: [w, x, y, z], scale: [x, y, z] or size: [x, y, z]}
      N: 1
    start_pos: [x, y, z]
    start_attitude: [w, x, y, z]
    world_box: [x, y, z, x, y, z]        lowest, then highest corner
    loop: yes

Gates may also be a list, and have `rpy` in place of a quaternion. The passage is a different axis
of the gate in different files: -y in SplitS.yaml and -x in AlphaPilot.yaml of uzh-rpg/agile_flight,
x in track.yaml of uzh-rpg/marl-racing. It is therefore found from the directions from gate to gate.
A scale of 0.604 is an opening of 1.5 m.
"""

from __future__ import annotations

from math import radians

import numpy as np

from quadsim.course.foreign.reading import Entry, in_order, yaml_entry
from quadsim.course.foreign.track import ForeignGate, ForeignStart, ForeignTrack, Reading
from quadsim.rotation import Vec3, euler_matrix

OPENING = 1.5 / 0.604  # of scale 1 [m]
COUNT = "N"  # key of the number of gates


def read_uzh(text: str, file: str, reading: Reading) -> ForeignTrack:
    """Return the track that a file describes. Raises FileError."""
    root = yaml_entry(text, file)
    listed = root.at("gates")
    named = [(name, entry) for name, entry in listed.named() if name != COUNT]
    names = [name for name, _ in named]
    gates = []
    for k, reverse in in_order(names, reading.gates, listed.fail):
        name, entry = named[k]
        gates.append(
            ForeignGate(
                name=name,
                place=entry.key,
                position=entry.at("position", "pos").vector(),
                axes=_axes(entry, reading),
                sizes=_sizes(entry),
                reverse=reverse,
            )
        )
    box = root.get("world_box")
    low_and_high = box.numbers(6, "lowest x, y, z, then highest x, y, z") if box else None
    loop = root.get("loop")
    if loop and not isinstance(loop.value, bool):
        raise loop.wrong("true or false")
    return ForeignTrack(
        gates=tuple(gates),
        frame="enu",
        passage="auto",
        simulator="UZH",
        start=_start(root),
        bounds=(_vector(low_and_high[:3]), _vector(low_and_high[3:])) if low_and_high else None,
        loop=bool(loop and loop.value),
    )


def _axes(entry: Entry, reading: Reading) -> np.ndarray:
    """Return the axes of a gate as columns.  (3, 3)"""
    rotation = entry.first("rotation", "orientation", "quaternion")
    if rotation:
        return rotation.axes()
    found = entry.first("rpy", "yaw")
    if found is None:
        entry.at("rotation")  # raises the error that it is missing
    assert found is not None
    angles = [0.0, 0.0, found.number()] if not isinstance(found.value, list) else None
    roll, pitch, yaw = angles or found.numbers(3, "roll, pitch, yaw")
    if reading.angles == "deg":
        roll, pitch, yaw = radians(roll), radians(pitch), radians(yaw)
    return euler_matrix(yaw, pitch, roll)


def _sizes(entry: Entry) -> Vec3 | None:
    """Return the sizes of the opening along the gate's axes, None if the entry has none."""
    size = entry.get("size")
    scale = entry.get("scale")
    given = size or scale
    if given is None:
        return None
    x, y, z = given.vector()
    if min(x, y, z) <= 0.0:
        raise given.wrong("3 numbers > 0")
    factor = 1.0 if size else OPENING
    return factor * x, factor * y, factor * z


def _start(root: Entry) -> ForeignStart | None:
    position = root.get("start_pos")
    if position is None:
        return None
    attitude = root.get("start_attitude")
    forward = _vector(attitude.axes()[:, 0].tolist()) if attitude else None
    return ForeignStart(position.vector(), forward)


def _vector(numbers: tuple[float, ...] | list[float]) -> Vec3:
    x, y, z = numbers
    return x, y, z
