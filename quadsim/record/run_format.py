"""The bytes of a run folder's three files. Reading checks names, types, lengths and the digest."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

import msgspec
import numpy as np

from quadsim.files.csv_rows import csv_text
from quadsim.files.json_values import without_nan
from quadsim.race.events import Event
from quadsim.record.metrics import chatter
from quadsim.record.planner_snapshot import PlannerSnapshots
from quadsim.record.run import COUNTS, Outcome, PlanTime, Run, RunError, columns_of, own_parts

SCHEMA_VERSION = 1
CSV_COLUMNS = ("t", "kind", "gate", "lap", "left", "up", "speed", "x", "y", "z", "obstacle")


@dataclass(frozen=True)
class Record:
    """What is read back of run.json; the rest follows from it or is there to be read by people."""

    spec: dict[str, Any]
    outcome: Outcome
    events: tuple[Event, ...]
    plan_ms: PlanTime
    real_time_factor: float
    digest: str


@dataclass(frozen=True)
class Header:
    schema_version: int


def write_json(run: Run, provenance: dict) -> bytes:
    record = {
        "schema_version": SCHEMA_VERSION,
        "outcome": run.outcome,
        "laps": run.laps,
        "penalties": run.penalties,
        "gates": run.gates,
        "events": [e.record() for e in run.events],
        "chatter": without_nan(chatter(run)),
        **run.wall,
        "spec": run.spec,
        "course_sha256": sha256(run.spec["course_text"].encode()).hexdigest(),
        "units": columns_of(run.spec),
        "repeatable_from_spec": not own_parts(run.spec),
        **provenance,
        "digest": run.digest(),
    }
    return json.dumps(record, indent=1, allow_nan=False).encode()


def read_json(data: bytes, path: object) -> Record:
    try:
        version = msgspec.json.decode(data, type=Header).schema_version
        if version != SCHEMA_VERSION:
            advice = (
                "it comes from a newer quadsim, update this one"
                if version > SCHEMA_VERSION
                else "it is damaged"
            )
            raise RunError(
                f"{path}: expected schema_version {SCHEMA_VERSION}, got {version}; {advice}"
            )
        return msgspec.json.decode(data, type=Record)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise RunError(f"{path}: damaged: {error}") from error


def write_npz(run: Run) -> bytes:
    buffer = io.BytesIO()
    arrays: dict = run.telemetry | (run.snapshots.arrays() if run.snapshots else {})
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def read_npz(
    data: bytes, spec: dict, path: object
) -> tuple[dict[str, np.ndarray], PlannerSnapshots | None]:
    """Telemetry by column, and the planner's snapshots where the run has them."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            columns = {name: arrays[name] for name in arrays.files}
    except Exception as error:  # a damaged zip fails in a dozen ways
        raise RunError(f"{path}: damaged: {error}") from error
    snapshots = PlannerSnapshots.taken_out_of(columns)
    wanted = _wanted(spec, path)
    _check(columns, wanted, path)
    try:
        if snapshots:
            snapshots.check(len(columns["t"]))
    except ValueError as error:
        raise RunError(f"{path}: {error}") from error
    return {name: columns[name] for name in wanted}, snapshots


def write_csv(events: Iterable[Event]) -> bytes:
    """Return events.csv, a row for each event."""
    return csv_text([_csv_row(event) for event in events], CSV_COLUMNS).encode()


def _csv_row(event: Event) -> dict[str, object]:
    place = (event.t, event.kind, event.gate, event.lap)
    values = (*place, *event.offset, event.speed, *event.position, event.obstacle)
    return dict(zip(CSV_COLUMNS, values, strict=True))


def _wanted(spec: dict, path: object) -> dict[str, str]:
    try:
        return columns_of(spec)
    except (KeyError, TypeError, AttributeError) as error:
        raise RunError(f"{path}: run.json names no known system: {error}") from error


def _check(columns: dict[str, np.ndarray], wanted: dict[str, str], path: object) -> None:
    if wrong := sorted(columns.keys() ^ wanted.keys()):
        raise RunError(
            f"{path}: expected the columns of the run's system, missing or unknown: {', '.join(wrong)}"
        )
    frames = columns["t"].shape
    for name, column in columns.items():
        kind = np.dtype(np.int64 if name in COUNTS else np.float64)
        if column.dtype != kind or column.ndim != 1 or column.shape != frames:
            raise RunError(
                f"{path}: {name}: expected {kind} {frames}, got {column.dtype} {column.shape}"
            )
