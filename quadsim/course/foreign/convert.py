"""Convert a foreign track to a course with this project's axes, units and passages, and a start."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from math import asin, atan2, degrees
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from quadsim.course.course import Course, parse_course
from quadsim.course.foreign.airsim import read_airsim
from quadsim.course.foreign.csv_file import read_csv
from quadsim.course.foreign.flightgoggles import read_flightgoggles
from quadsim.course.foreign.lsy import read_lsy
from quadsim.course.foreign.reading import file_error
from quadsim.course.foreign.track import (
    ForeignGate,
    ForeignTrack,
    Frame,
    Passage,
    Reading,
    opening_of,
)
from quadsim.course.foreign.uzh import read_uzh
from quadsim.files.data_files import read_text
from quadsim.files.strict_yaml import FileError
from quadsim.files.values import SettingError
from quadsim.files.yaml_errors import did_you_mean, shown_value
from quadsim.files.yaml_text import remade
from quadsim.rotation import VERTICAL, Vec3

Reader = Callable[[str, str, Reading], ForeignTrack]
FORMATS: dict[str, Reader] = {
    "lsy": read_lsy,
    "airsim": read_airsim,
    "flightgoggles": read_flightgoggles,
    "uzh": read_uzh,
    "csv": read_csv,
}
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048}
# Axes of the file -> axes of a course (east, north, up)
TO_ENU: dict[Frame, np.ndarray] = {
    "enu": np.eye(3),
    "ned": np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]),
}
# Mean cosine between passage and way by which another axis is better, so that it is said
CLEARLY = 0.5
# Places of a start before gate 1 that are tried, in openings
BEFORE = (3.0, 2.0, 4.0, 1.5, 6.0, 1.0)
# Digits that are written; quaternions and corners are rounded in the files
DIGITS = 6  # of positions [m]
COARSE = 4  # of angles [deg] and sizes [m]
LEVEL = 1e-3  # pitch and roll that are left out [deg]


class Side(NamedTuple):
    """The axis of a gate's own frame along which the gate is passed."""

    # 0: x, 1: y
    axis: int
    # 1 or -1
    sign: float


SIDES: dict[str, Side] = {
    "x": Side(0, 1.0),
    "-x": Side(0, -1.0),
    "y": Side(1, 1.0),
    "-y": Side(1, -1.0),
}


class Conversion(NamedTuple):
    """A converted course, and the assumptions that its user should check."""

    course: Course
    notes: list[str]


class PlacedStart(NamedTuple):
    """A start in the axes of the course."""

    # [m]  (3,)
    position: np.ndarray
    # direction of the vehicle's x axis  (3,); None: it looks at the first gate
    forward: np.ndarray | None


class Placed(NamedTuple):
    """A gate in the axes of the course."""

    # [m]  (3,)
    position: np.ndarray
    # directions, each (3,)
    passage: np.ndarray
    up: np.ndarray
    # width, height [m]
    opening: tuple[float, float]


def convert_course(path: str | Path, kind: str, **reading: Any) -> Course:
    """Return the course of another simulator's file.

    Args:
        path: the file.
        kind: format of the file: lsy, airsim, flightgoggles, uzh or csv.
        reading: how the file is read: frame, unit, angles, passage, opening (one or two numbers
            [m]), gates, start, offset [m] and loop; see quadsim.course.foreign.Reading.

    Returns:
        A course, which passes the checks of a course file; `to_yaml` writes one.

    Raises:
        FileError: the file does not have this format, or its course does not pass the checks.
        SettingError: there is no such format, or a value of `reading` is invalid.

    Examples:
        >>> from pathlib import Path
        >>> import quadsim
        >>> gates = "x,y,z,yaw_deg\\n0,500,-150,0\\n500,1000,-150,90\\n"
        >>> _ = Path("gates.csv").write_text(gates)
        >>> course = quadsim.convert_course(
        ...     "gates.csv", "csv", frame="ned", unit="cm", opening=(1.5, 1.5)
        ... )
        >>> course.gates[1].position
        (10.0, 5.0, 1.5)
    """
    for name in reading:
        if name not in Reading.__dataclass_fields__:
            near = did_you_mean(name, Reading.__dataclass_fields__)
            raise SettingError(name, f"no such setting of a conversion, {near}")
    opening = opening_of(reading.get("opening"))
    return convert(path, kind, Reading(**(reading | {"opening": opening}))).course


def convert(path: str | Path, kind: str, reading: Reading) -> Conversion:
    """Return the course of another simulator's file, with notes on it; see `convert_course`."""
    reader = FORMATS.get(kind) if isinstance(kind, str) else None
    if reader is None:
        near = ", ".join(FORMATS)
        raise SettingError("from", f"expected one of {near}, got {shown_value(kind)}")
    file = str(path)
    track = reader(read_text(Path(path)), file, reading)
    if not track.gates:
        raise FileError(f"{file}: expected one gate or more, got none")
    return _course(track, file, reading)


def _course(track: ForeignTrack, file: str, reading: Reading) -> Conversion:
    """Return the course of a track. Raises FileError."""
    notes = list(track.notes)
    metres = METRES[reading.unit]
    to_enu = TO_ENU[reading.frame or track.frame]
    loop = track.loop if reading.loop is None else reading.loop

    def placed(position: Vec3) -> np.ndarray:
        return metres * to_enu @ position + reading.offset

    centres = np.array([placed(gate.position) for gate in track.gates])
    start = None
    if track.start:
        forward = None if track.start.forward is None else to_enu @ track.start.forward
        start = PlacedStart(placed(track.start.position), forward)
    axes = np.array([to_enu @ gate.axes for gate in track.gates])  # (gates, 3, 3)
    ways = _ways(centres, start.position if start else None, loop)
    sides = _passages(track, reading.passage or track.passage, axes, ways, notes)
    gates = [
        Placed(centre, *_directions(own, side), _opening(gate, side, reading, file))
        for gate, centre, own, side in zip(track.gates, centres, axes, sides, strict=True)
    ]
    entries: dict[str, Any] = {
        "source": f"{Path(file).name}, converted from {track.simulator}",
        "loop": loop,
        "opening": gates[0].opening,
        "start": _start(reading, start, gates[0]),
        "gates": [_gate_entry(gate, gates[0].opening) for gate in gates],
    }
    if track.frame_width:
        entries["frame_width"] = _rounded(track.frame_width * metres)
    if track.poles:
        poles = [(placed(pole.top), pole.radius * metres) for pole in track.poles]
        entries["obstacles"] = [_pole_entry(top, radius) for top, radius in poles]
    if track.bounds:
        corners = np.array([placed(corner) for corner in track.bounds])
        low_and_high = zip(corners.min(axis=0), corners.max(axis=0), strict=True)
        entries["bounds"] = [[_rounded(low), _rounded(high)] for low, high in low_and_high]
    if reading.start is None and start is None:
        entries = _with_free_start(entries, gates[0], file, notes)
    return Conversion(_checked(entries, file, notes), notes)


def _ways(centres: np.ndarray, start: np.ndarray | None, loop: bool) -> np.ndarray:
    """Return the direction of flight through each gate, from the previous to the next gate.

    Args:
        centres: centres of the gates  (gates, 3).
        start: position of the start  (3,); None if it is not known.
        loop: whether the first gate comes after the last.

    Returns:
        Unit vectors, or zeros if the direction is not known  (gates, 3).
    """
    before = np.vstack([centres[-1:] if loop else centres[:1], centres[:-1]])
    if start is not None and not loop:
        before[0] = start
    after = np.vstack([centres[1:], centres[:1] if loop else centres[-1:]])
    ways = after - before
    lengths = np.linalg.norm(ways, axis=1, keepdims=True)
    return np.divide(ways, lengths, out=np.zeros_like(ways), where=lengths > 0.0)


def _passages(
    track: ForeignTrack, wanted: Passage, axes: np.ndarray, ways: np.ndarray, notes: list[str]
) -> list[Side]:
    """Return the axis along which each gate is passed, and add it to the notes.

    Args:
        track: the track.
        wanted: the axis, or the rule by which it is found.
        axes: axes of the gates in the world, as columns  (gates, 3, 3).
        ways: directions of the way through the gates  (gates, 3).
        notes: list of remarks on the conversion, which is extended.
    """
    turns = np.array([-1.0 if gate.reverse else 1.0 for gate in track.gates])
    if wanted == "either":
        along = (axes[:, :, 0] * ways).sum(axis=1)
        notes.append("passage: each gate along the way from the one before to the one after")
        return [
            Side(0, turn * (-1.0 if a < 0.0 else 1.0)) for a, turn in zip(along, turns, strict=True)
        ]
    cosines = {
        name: float(np.mean(turns * side.sign * (axes[:, :, side.axis] * ways).sum(axis=1)))
        for name, side in SIDES.items()
    }
    best = max(cosines, key=lambda name: cosines[name])
    chosen = best if wanted == "auto" else wanted
    notes.append(f"passage: the gates' {chosen} axis, mean cosine to the way {cosines[chosen]:.2f}")
    if cosines[best] > cosines[chosen] + CLEARLY:
        notes.append(
            f"the {best} axis fits the way better ({cosines[best]:.2f}): try passage {best}"
        )
    side = SIDES[chosen]
    return [Side(side.axis, turn * side.sign) for turn in turns.tolist()]


def _directions(axes: np.ndarray, side: Side) -> tuple[np.ndarray, np.ndarray]:
    """Return a gate's directions passage and up  (3,), (3,); up never points downwards.

    Args:
        axes: axes of the gate in the world, as columns  (3, 3).
        side: the axis along which it is passed.
    """
    up = axes[:, 2]
    return side.sign * axes[:, side.axis], -up if up[2] < 0.0 else up


def _opening(gate: ForeignGate, side: Side, reading: Reading, file: str) -> tuple[float, float]:
    """Return width and height of a gate's opening [m]. Raises FileError if it has none."""
    if reading.opening:
        return reading.opening
    if gate.sizes is None:
        wanted = "expected an opening: the file has none, give width and height [m] as opening"
        raise file_error(file, gate.place, f"{wanted} (--opening 1.5 1.5)")
    metres = METRES[reading.unit]
    width, height = gate.sizes[1 - side.axis], gate.sizes[2]
    return _rounded(width * metres, COARSE), _rounded(height * metres, COARSE)


def _gate_entry(gate: Placed, opening: tuple[float, float]) -> dict[str, Any]:
    """Return the entry of a gate in a course file.

    Args:
        gate: the gate.
        opening: width and height that the file gives to gates without their own [m].
    """
    x, y, z = gate.passage
    left = np.cross(gate.up, gate.passage)
    pitch = -asin(min(max(z, -1.0), 1.0))
    yaw, roll = atan2(y, x), atan2(left[2], gate.up[2])
    if abs(z) > 1.0 - VERTICAL:
        yaw, roll = atan2(-left[0], left[1]), 0.0
    entry: dict[str, Any] = {
        "position": [_rounded(each) for each in gate.position],
        "yaw_deg": _rounded(degrees(yaw), COARSE),
    }
    tilts = {
        "pitch_deg": _rounded(degrees(pitch), COARSE),
        "roll_deg": _rounded(degrees(roll), COARSE),
    }
    entry |= {name: tilt for name, tilt in tilts.items() if abs(tilt) > LEVEL}
    if gate.opening != opening:
        entry["opening"] = gate.opening
    return entry


def _pole_entry(top: np.ndarray, radius: float) -> dict[str, Any]:
    """Return the entry of an upright pole that stands on the ground; lengths are in metres."""
    x, y, z = (_rounded(each) for each in top)
    return {"cylinder": {"base": [x, y, 0.0], "radius": _rounded(radius), "height": z}}


def _start(reading: Reading, start: PlacedStart | None, first: Placed) -> dict[str, Any]:
    """Return the entry of the start: the user's, the file's, or one before the first gate."""
    if reading.start:
        x, y, z, yaw_deg = reading.start
        return {"position": [x, y, z], "yaw_deg": yaw_deg}
    if start is None:
        return _start_before(first, BEFORE[0])
    forward = start.forward
    if forward is None:
        forward = first.position - start.position
    return _start_entry(start.position, forward)


def _start_before(first: Placed, openings: float) -> dict[str, Any]:
    """Return the entry of a start that faces the first gate, `openings` of its sizes before it."""
    position = first.position - openings * max(first.opening) * first.passage
    return _start_entry(position, first.passage)


def _start_entry(position: np.ndarray, forward: np.ndarray) -> dict[str, Any]:
    yaw_deg = _rounded(degrees(atan2(forward[1], forward[0])), COARSE)
    return {"position": [_rounded(each) for each in position], "yaw_deg": yaw_deg}


def _with_free_start(
    entries: dict[str, Any], first: Placed, file: str, notes: list[str]
) -> dict[str, Any]:
    """Return the entries with the nearest start before gate 1 that is free, if there is one."""
    for openings in BEFORE:
        tried = entries | {"start": _start_before(first, openings)}
        with suppress(SettingError):
            remade(tried, parse_course, Path(file).stem)
            notes.append(f"start: {openings * max(first.opening):.2f} m before gate 1")
            return tried
    return entries


def _checked(entries: dict[str, Any], file: str, notes: list[str]) -> Course:
    """Return the course with these entries; bounds that do not fit are left out.

    Raises:
        FileError: the course does not pass the checks of a course file.
    """
    try:
        return remade(entries, parse_course, Path(file).stem)
    except SettingError as error:
        if "bounds" in entries and "outside the bounds" in error.problem:
            notes.append(f"bounds: left out, as {error.name} is {error.problem}")
            inside = {key: value for key, value in entries.items() if key != "bounds"}
            return _checked(inside, file, notes)
        what = "as a course, " + (f"{error.name}: " if error.name else "")
        raise file_error(file, "", f"{what}{error.problem}{_advice(error)}") from None


def _advice(error: SettingError) -> str:
    """Return advice on a problem of a converted course, "" if there is none."""
    if "ground" in error.problem:
        return "; other axes (frame) or an offset may be right"
    if error.name.startswith("start"):
        return "; give a start"
    if error.name == "laps":
        return "; say that it is a loop"
    return ""


def _rounded(number: float, digits: int = DIGITS) -> float:
    """Return a number rounded as it is written to a file; -0 becomes 0."""
    return round(float(number), digits) + 0.0
