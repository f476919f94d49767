"""Write and read the three files of a run; reading checks names, types and lengths."""

from __future__ import annotations

import json
from collections.abc import Iterable
from hashlib import sha256
from operator import itemgetter
from typing import Any, NamedTuple

import msgspec
import numpy as np

from quadsim.files.arrays import Declared, arrays_of, npz_bytes
from quadsim.files.csv_rows import csv_text
from quadsim.files.strict_yaml import FileError
from quadsim.physics.faults import parse_fault
from quadsim.racing.events import Event
from quadsim.record.number_changes import changes_of
from quadsim.record.planner_snapshot import BEST, FRAMES, TERM, PlannerSnapshots
from quadsim.record.run import (
    COUNTS,
    RecordedRun,
    RunError,
    columns_of,
    why_not_repeatable,
)
from quadsim.record.schema import (
    CHANGE_COLUMNS,
    RUN_FORMAT,
    Header,
    RunSpec,
    StoredRecord,
)
from quadsim.sensing.kept import ACCELEROMETER_BIAS, GATES, GYRO_BIAS, TABLES

# Arrays of the sensing that a run may have kept
MEASUREMENTS = {
    column.name: Declared(column.dtype, (table.sensor, *column.shape), required=False)
    for table in TABLES
    for column in table.columns
} | {
    GYRO_BIAS: Declared("float64", ("frames", 3), required=False),
    ACCELEROMETER_BIAS: Declared("float64", ("frames", 3), required=False),
    GATES: Declared("float64", ("frames", "gates", 3), required=False),
}
CSV_COLUMNS = (
    "t",
    "kind",
    "gate",
    "lap",
    "left",
    "up",
    "speed",
    "x",
    "y",
    "z",
    "obstacle",
    "vehicle",
)


def write_json(run: RecordedRun, provenance: dict) -> bytes:
    """Return the content of run.json."""
    record = {
        "format": RUN_FORMAT,
        "outcome": run.outcome,
        "laps": run.laps,
        "penalties": run.penalties,
        "gates": run.gates,
        "events": [event.record() for event in run.events],
        **run.wall,
        "spec": run.spec,
        "course_sha256": sha256(run.spec["course"]["text"].encode()).hexdigest(),
        "units": columns_of(run.spec),
        "repeatable_from_spec": not why_not_repeatable(run),
        **provenance,
        "digest": run.digest(),
    }
    if run.fault:
        record["fault"] = run.fault
    if run.learned:
        record["learned"] = [rotor._asdict() for rotor in run.learned]
    if run.learned_delay:
        record["learned_delay"] = run.learned_delay._asdict()
    return json.dumps(record, indent=1, allow_nan=False).encode()


def read_json(data: bytes, path: object) -> StoredRecord:
    """Read run.json.

    Args:
        data: the file's bytes.
        path: path of the file, for errors.

    Raises:
        RunError: the file is damaged, or of another version.
    """
    try:
        header = msgspec.json.decode(data, type=Header)
        if header.format != RUN_FORMAT:
            raise RunError(f"{path}: {_other_format(header)}")
        record = msgspec.json.decode(data, type=StoredRecord)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise RunError(f"{path}: damaged: {error}") from error
    check_spec(record.spec, path)
    return record


def check_spec(spec: dict[str, Any], path: object) -> None:
    """Check that a spec has all keys that pictures, reports and replays read.

    Raises:
        RunError: a key is missing or has a wrong type, for example in a spec edited by hand.
    """
    try:
        for text in msgspec.convert(spec, RunSpec).drawn_faults:
            parse_fault(text)
    except (msgspec.ValidationError, ValueError) as error:
        raise RunError(f"{path}: spec: expected the spec of a flight: {error}") from error


def _other_format(header: Header) -> str:
    """Return the error message for a run in another format than this version's."""
    got = repr(header.format) if header.format else "none"
    writer = f"commit {header.git} of quadsim" if header.git else "the quadsim that wrote it"
    return f"expected format {RUN_FORMAT!r}, got {got}: read it with {writer}, or fly it again"


def write_npz(run: RecordedRun) -> bytes:
    """Return the content of telemetry.npz."""
    snapshots = run.snapshots.arrays() if run.snapshots else {}
    return npz_bytes(run.telemetry | snapshots | (run.measurements or {}), compressed=True)


class StoredArrays(NamedTuple):
    """The content of telemetry.npz."""

    telemetry: dict[str, np.ndarray]  # by column
    snapshots: PlannerSnapshots | None
    measurements: dict[str, np.ndarray] | None  # of quadsim.sensing.kept


def read_npz(data: bytes, spec: dict, path: object) -> StoredArrays:
    """Return the telemetry by column, and the other arrays of a run.

    Raises:
        RunError: the content is damaged, or does not fit the spec.
    """
    try:
        wanted = columns_of(spec)
    except (KeyError, TypeError, AttributeError) as error:
        raise RunError(f"{path}: run.json names no known system: {error}") from error
    try:
        columns = arrays_of(data, _declared(wanted), path, "the telemetry of a run")
    except FileError as error:
        raise RunError(str(error)) from None
    snapshots = PlannerSnapshots.taken_out_of(columns)
    measurements = {name: columns.pop(name) for name in MEASUREMENTS if name in columns}
    unknown = sorted(columns.keys() - wanted.keys())
    if unknown:
        raise RunError(f"{path}: arrays missing or unknown: {', '.join(unknown)}")
    if snapshots:
        try:
            snapshots.check(len(columns["t"]))
        except ValueError as error:
            raise RunError(f"{path}: {error}") from error
    telemetry = {name: columns[name] for name in wanted}
    return StoredArrays(telemetry, snapshots, measurements or None)


def _declared(wanted: Iterable[str]) -> dict[str, Declared]:
    """Return the arrays that telemetry.npz may have: these columns and the planner's snapshots."""
    declared = {
        name: Declared("int64" if name in COUNTS else "float64", ("frames",)) for name in wanted
    }
    return declared | {
        FRAMES: Declared("int64", ("snapshots",), required=False),
        BEST: Declared("float32", ("snapshots", "paths", "points", "states"), required=False),
        f"{TERM}*": Declared("float32", ("snapshots",), required=False),
        **MEASUREMENTS,
    }


def write_csv(run: RecordedRun) -> bytes:
    """Return the content of events.csv, with a row for each event.

    A change of a number in flight is a row of the kind "change", with its own columns.
    """
    rows = [event_row(event) for event in run.events]
    changes = [change.row() for change in changes_of(run.spec)]
    if not changes:
        return csv_text(rows, CSV_COLUMNS).encode()
    return csv_text(
        sorted([*changes, *rows], key=itemgetter("t")), (*CSV_COLUMNS, *CHANGE_COLUMNS)
    ).encode()


def event_row(event: Event) -> dict[str, object]:
    """Return the values of an event by the columns of events.csv."""
    place = (event.t, event.kind, event.gate, event.lap)
    values = (*place, *event.offset, event.speed, *event.position, event.obstacle, event.vehicle)
    return dict(zip(CSV_COLUMNS, values, strict=True))
