"""Mapping: which columns of a log are which signals, in which units and frames.

A mapping is a YAML file. Its keys are `time` and the signals of FlightLog, and `euler` in place of
`quaternion`; see docs/fit.md. Those in `mappings/` ship with the project.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from math import pi
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta, Struct

from quadsim.files.data_files import locate, names, read_text
from quadsim.files.strict_yaml import parse, setting
from quadsim.files.values import FieldProblem
from quadsim.files.yaml_errors import did_you_mean
from quadsim.logs.flight_log import SIGNALS
from quadsim.logs.frames import (
    from_euler_angles,
    from_frd,
    from_ned,
    from_ned_and_frd,
)
from quadsim.logs.raw_log import RawLog

MAPPINGS = Path(__file__).parent / "mappings"
# The acceleration that accelerometers call 1 g [m/s^2]
STANDARD_GRAVITY = 9.80665
# Name of a unit -> what one of it is in SI units
UNITS = {
    "s": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "ns": 1e-9,
    "m": 1.0,
    "cm": 1e-2,
    "mm": 1e-3,
    "m/s": 1.0,
    "cm/s": 1e-2,
    "mm/s": 1e-3,
    "km/h": 1.0 / 3.6,
    "rad/s": 1.0,
    "deg/s": pi / 180.0,
    "rpm": pi / 30.0,
    "rad": 1.0,
    "deg": pi / 180.0,
    "m/s^2": 1.0,
    "g": STANDARD_GRAVITY,
    "mg": 1e-3 * STANDARD_GRAVITY,
    "V": 1.0,
    "mV": 1e-3,
    "1": 1.0,
    "%": 1e-2,
}
# Signal -> the units in which it may be written
UNITS_OF = {
    "time": ("s", "ms", "us", "ns"),
    "position": ("m", "cm", "mm"),
    "velocity": ("m/s", "cm/s", "mm/s", "km/h"),
    "quaternion": ("1",),
    "euler": ("rad", "deg"),
    "body_rates": ("rad/s", "deg/s"),
    "specific_force": ("m/s^2", "g", "mg"),
    "motor_commands": ("1", "%"),
    "rotor_speeds": ("rad/s", "rpm"),
    "rate_setpoints": ("rad/s", "deg/s"),
    "thrust_setpoint": ("m/s^2", "g", "mg"),
    "throttle": ("1", "%"),
    "battery": ("V", "mV"),
}
# Signals from 0 to 1, which may be written in numbers of their own
SHARES = ("motor_commands", "throttle")
LargestReading = Annotated[float, Meta(gt=0)]
IN_THE_WORLD = ("position", "velocity")
IN_THE_BODY = ("body_rates", "specific_force", "rate_setpoints")


class Entry(Struct, frozen=True, kw_only=True):
    """The columns of one signal in a CSV file, with their unit and scale."""

    column: Annotated[str | None, setting("the column of a signal of one number")] = None
    columns: Annotated[
        tuple[str, ...] | None,
        setting("the columns, in the order of FlightLog; -NAME changes the sign of a column"),
    ] = None
    unit: Annotated[str | None, setting("unit of the columns; without one, the SI unit")] = None
    zero: Annotated[float | None, setting("what is written for 0; without one, 0")] = None
    full: Annotated[float | None, setting("what is written for 1")] = None
    saturates_at: Annotated[
        LargestReading | None, setting("the largest reading of the sensor, in the unit")
    ] = None

    @property
    def names(self) -> tuple[str, ...]:
        """The columns without their signs."""
        return tuple(name.removeprefix("-") for name in self.written)

    @property
    def written(self) -> tuple[str, ...]:
        """The columns as they are written."""
        return self.columns or ((self.column,) if self.column else ())

    @property
    def scale(self) -> float:
        """The factor that converts values of the column to SI units."""
        return UNITS[self.unit] if self.unit else 1.0


class LogMapping(Struct, frozen=True, kw_only=True):
    """The keys of a mapping."""

    source: Annotated[str, setting("of which logs, and who says so")] = ""
    world: Annotated[Literal["ENU", "NED"], setting("frame of position and velocity")] = "ENU"
    body: Annotated[Literal["FLU", "FRD"], setting("frame of body rates and accelerometer")] = "FLU"
    time: Entry
    position: Entry | None = None
    velocity: Entry | None = None
    quaternion: Entry | None = None
    euler: Entry | None = None
    body_rates: Entry | None = None
    specific_force: Entry | None = None
    motor_commands: Entry | None = None
    rotor_speeds: Entry | None = None
    rate_setpoints: Entry | None = None
    thrust_setpoint: Entry | None = None
    throttle: Entry | None = None
    battery: Entry | None = None

    def entries(self) -> dict[str, Entry]:
        """Return the entries of the signals by name, without the entry of the time."""
        found = {name: getattr(self, name) for name in UNITS_OF if name != "time"}
        return {name: entry for name, entry in found.items() if entry is not None}

    def missing(self, columns: Collection[str]) -> list[str]:
        """Return a text for each signal that these columns do not have."""
        found = []
        for signal, entry in self.entries().items():
            absent = [name for name in entry.names if name not in columns]
            if absent:
                found.append(f"{signal} (no column {', '.join(absent)})")
        return found

    def column_names(self) -> set[str]:
        """Return the names of all columns that the mapping reads."""
        entries = [self.time, *self.entries().values()]
        return {name for entry in entries for name in entry.names}


def shipped_mappings() -> tuple[str, ...]:
    """Return the names of the mappings that come with the project."""
    return names(MAPPINGS)


def shipped_mapping(name: str) -> LogMapping:
    """Return a mapping that comes with the project."""
    return load_mapping(name)


def load_mapping(name_or_path: str | Path) -> LogMapping:
    """Return a mapping by name ("nanobench") or path ("mine.yaml").

    Raises:
        FileError: there is no such mapping, or the file does not hold a mapping.
    """
    path = locate(name_or_path, MAPPINGS, "mapping", listed=False)
    document = parse(read_text(path), str(path))
    mapping = document.fill(LogMapping)
    document.check(_problems(mapping))
    return mapping


def fitting_mapping(header: Collection[str]) -> LogMapping | None:
    """Return the shipped mapping whose columns are all in a header, None if there is none."""
    for name in shipped_mappings():
        mapping = shipped_mapping(name)
        if mapping.column_names() <= set(header):
            return mapping
    return None


def mapped(
    columns: Mapping[str, np.ndarray],
    mapping: LogMapping,
    name: str,
    remarks: Sequence[str] = (),
) -> RawLog:
    """Return the signals of a table. A signal of which a column is missing is left out.

    Args:
        columns: column -> readings  (n,). The column of the time is among them.
        mapping: which columns are which signals.
        name: name of the log.
        remarks: what the reader has to say.
    """
    found = {}
    largest = {}
    for signal, entry in mapping.entries().items():
        if not set(entry.names) <= columns.keys():
            continue
        found[signal] = _readings(columns, entry)
        if entry.saturates_at:
            largest[signal] = entry.saturates_at * entry.scale
    t = np.asarray(columns[mapping.time.names[0]], float) * mapping.time.scale
    return RawLog(name, t, _in_our_frames(found, mapping), tuple(remarks), largest)


def _in_our_frames(signals: dict[str, np.ndarray], mapping: LogMapping) -> dict[str, np.ndarray]:
    """Return signals in the frames of FlightLog."""
    found = dict(signals)
    if "euler" in found:
        found["quaternion"] = from_euler_angles(found.pop("euler"))
    if mapping.world == "NED":
        found |= {name: from_ned(found[name]) for name in IN_THE_WORLD if name in found}
    if mapping.body == "FRD":
        found |= {name: from_frd(found[name]) for name in IN_THE_BODY if name in found}
    # `_problems` has rejected an attitude between frames of different kinds.
    if mapping.world == "NED" and "quaternion" in found:
        found["quaternion"] = from_ned_and_frd(found["quaternion"])
    return found


def _readings(columns: Mapping[str, np.ndarray], entry: Entry) -> np.ndarray:
    """Return the readings of a signal in SI units, (n, width), or (n,) of one column."""
    signs = [-1.0 if name.startswith("-") else 1.0 for name in entry.written]
    readings = np.empty((len(columns[entry.names[0]]), len(signs)))
    for k, (name, sign) in enumerate(zip(entry.names, signs, strict=True)):
        readings[:, k] = columns[name]
        readings[:, k] *= sign
    if entry.full is None:
        readings *= entry.scale
    else:
        zero = entry.zero or 0.0
        readings -= zero
        readings /= entry.full - zero
    return readings if len(signs) > 1 else readings[:, 0]


def _problems(mapping: LogMapping) -> Iterator[FieldProblem]:
    """Yield the problems of a mapping besides types and ranges."""
    if mapping.quaternion and mapping.euler:
        yield FieldProblem("euler", "expected one of quaternion and euler, got both")
    if (mapping.world == "NED") != (mapping.body == "FRD") and (
        mapping.quaternion or mapping.euler
    ):
        wanted = "expected an attitude from ENU to FLU or from NED to FRD"
        yield FieldProblem("world", f"{wanted}, got {mapping.world} and {mapping.body}")
    for name, entry in {"time": mapping.time, **mapping.entries()}.items():
        width = 3 if name == "euler" else 1 if name == "time" else SIGNALS[name].width
        if len(entry.written) != width or (entry.column and entry.columns):
            key = "column" if width == 1 else "columns"
            wanted = f"expected {key} with {width} name{'s' * (width > 1)}"
            yield FieldProblem(name, f"{wanted}, got {len(entry.written)}")
        known = UNITS_OF[name]
        if entry.unit is not None and entry.unit not in known:
            near = did_you_mean(entry.unit, known)
            wanted = f"expected one of {', '.join(known)}, got {entry.unit!r}"
            yield FieldProblem(f"{name}.unit", wanted if len(known) < 5 else f"{wanted}: {near}")
        yield from _scale_problems(name, entry)
        twice = [column for column in entry.names if entry.names.count(column) > 1]
        if twice:
            yield FieldProblem(name, f"expected each column once, got {twice[0]!r} twice")


def _scale_problems(name: str, entry: Entry) -> Iterator[FieldProblem]:
    """Yield the keys of an entry that contradict others or have no effect."""
    if entry.full is None:
        if entry.zero is not None:
            yield FieldProblem(f"{name}.zero", "expected full beside it, got zero alone")
    elif name not in SHARES:
        wanted = f"expected it at {' and '.join(SHARES)}, which are shares"
        yield FieldProblem(f"{name}.full", f"{wanted}, got it at {name}: write unit")
    elif entry.unit is not None:
        wanted = "expected either unit, or zero and full"
        yield FieldProblem(f"{name}.unit", f"{wanted}, got both: remove one")
    elif entry.full == (entry.zero or 0.0):
        yield FieldProblem(f"{name}.full", "expected another number than zero has")
    if name != "time":
        return
    if entry.written and entry.written[0].startswith("-"):
        yield FieldProblem("time", f"expected a column that rises, got {entry.written[0]!r}")
    if entry.saturates_at is not None:
        yield FieldProblem("time.saturates_at", "expected none, as a clock does not saturate")
