"""Levels of LSY drone racing (learnsyslab/lsy_drone_racing, config/level2.toml and the like).

[[env.track.gates]]          pos [m], rpy [rad]: the passage is the gate's x axis
[[env.track.obstacles]]      pos [m]: upper end of a pole of 3 cm diameter
[[env.track.drones]]         pos [m], rpy [rad] of the start
env.track.randomize          whether the simulator draws all places, which a course file cannot say
env.track.gate_order         signed numbers from 1, in newer levels
env.track.gate_size          width, height [m], in some levels; else the opening is 0.4 m
env.track.safety_limits      pos_limit_low, pos_limit_high [m]
"""

from __future__ import annotations

from math import radians

import numpy as np

from quadsim.course.foreign.reading import Entry, in_order, toml_entry
from quadsim.course.foreign.track import (
    ForeignGate,
    ForeignPole,
    ForeignStart,
    ForeignTrack,
    Reading,
)
from quadsim.rotation import Vec3, euler_matrix

OPENING = 0.4  # [m] of an outside of 0.72 m
FRAME_WIDTH = 0.16  # [m]
POLE_RADIUS = 0.015  # [m]


def read_lsy(text: str, file: str, reading: Reading) -> ForeignTrack:
    """Return the track that a level describes. Raises FileError."""
    track = toml_entry(text, file).at("env").at("track")
    draws = track.get("randomize")
    if draws and draws.value:
        wanted = "expected a level with its places in the file, got one that draws them"
        raise draws.error(f"{wanted}: fly it by race fly --competition lsy_level3")
    size = track.get("gate_size")
    width, height = OPENING, OPENING
    if size:
        width, height = size.at("width").size(), size.at("height").size()
    listed = track.at("gates").items()
    order = track.get("gate_order")
    wanted = reading.gates
    if order and not wanted:
        wanted = tuple(f"{item.number():.0f}" for item in order.items())
    names = [str(k) for k in range(1, len(listed) + 1)]
    gates = [
        ForeignGate(
            name=names[k],
            place=listed[k].key,
            position=listed[k].at("pos").vector(),
            axes=_axes(listed[k].at("rpy"), reading),
            sizes=(width, width, height),
            reverse=reverse,
        )
        for k, reverse in in_order(names, wanted, track.at("gates").fail)
    ]
    obstacles = track.get("obstacles")
    poles = [one.at("pos").vector() for one in obstacles.items()] if obstacles else []
    return ForeignTrack(
        gates=tuple(gates),
        frame="enu",
        passage="x",
        simulator="LSY drone racing",
        start=_start(track, reading),
        poles=tuple(ForeignPole(top, POLE_RADIUS) for top in poles),
        bounds=_bounds(track),
        frame_width=FRAME_WIDTH if size is None else None,
    )


def _axes(entry: Entry, reading: Reading) -> np.ndarray:
    """Return the rotation matrix of roll, pitch and yaw.  (3, 3)"""
    angles = entry.numbers(3, "roll, pitch, yaw")
    roll, pitch, yaw = map(radians, angles) if reading.angles == "deg" else angles
    return euler_matrix(yaw, pitch, roll)


def _start(track: Entry, reading: Reading) -> ForeignStart | None:
    """Return the start of the first drone, None if there is none. Raises FileError."""
    drones = track.first("drones", "drone")
    if drones is None:
        return None
    first = drones
    if isinstance(drones.value, list):
        if not drones.value:
            return None
        first = drones.items()[0]
    angles = first.get("rpy")
    forward = tuple(_axes(angles, reading)[:, 0].tolist()) if angles else None
    return ForeignStart(first.at("pos").vector(), forward)


def _bounds(track: Entry) -> tuple[Vec3, Vec3] | None:
    limits = track.get("safety_limits")
    if limits is None:
        return None
    return limits.at("pos_limit_low").vector(), limits.at("pos_limit_high").vector()
