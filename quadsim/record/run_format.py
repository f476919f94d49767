"""The bytes of a run folder's three files. Reading believes nothing: names, types, lengths and checksums are held."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from hashlib import sha256
from math import isfinite
from typing import Any, Literal

import msgspec
import numpy as np

from quadsim.race.events import Event
from quadsim.record.metrics import chatter
from quadsim.record.planner_snapshot import PlannerSnapshots
from quadsim.record.run import COUNTS, Run, RunError, columns_of, repeatable

SCHEMA_VERSION = 1
TERM = "cost."  # before the name of a cost term in telemetry.npz


@dataclass(frozen=True)
class Record:
    """What is read back of run.json; the rest follows from it or is there for people."""

    spec: dict[str, Any]
    outcome: Literal["finished", "crashed", "stuck", "timeout", "interrupted"]
    events: tuple[Event, ...]
    plan_ms: dict[str, float]
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
        "events": [asdict(e) for e in run.events],
        "chatter": _finite(chatter(run)),
        **run.wall,
        "spec": run.spec,
        "course_sha256": sha256(run.spec["course_text"].encode()).hexdigest(),
        "units": columns_of(run.spec),
        "repeatable_from_spec": repeatable(run.spec),
        **provenance,
        "digest": run.digest(),
    }
    return json.dumps(record, indent=1, allow_nan=False).encode()


def read_json(data: bytes, path: object) -> Record:
    try:
        version = msgspec.json.decode(data, type=Header).schema_version
        if version != SCHEMA_VERSION:
            advice = "it comes from a newer quadsim, update this one" if version > SCHEMA_VERSION else "it is damaged"
            raise RunError(f"{path}: expected schema_version {SCHEMA_VERSION}, got {version}; {advice}")
        return msgspec.json.decode(data, type=Record)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise RunError(f"{path}: damaged: {error}") from error


def write_npz(run: Run) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **run.telemetry, **_flat(run.pictures))  # pyright: ignore[reportArgumentType]
    return buffer.getvalue()


def read_npz(data: bytes, spec: dict, path: object) -> tuple[dict[str, np.ndarray], PlannerSnapshots | None]:
    """Telemetry by column, and the planner's pictures where the run has them."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            columns = {name: arrays[name] for name in arrays.files}
    except Exception as error:  # a damaged zip fails in a dozen ways
        raise RunError(f"{path}: damaged: {error}") from error
    pictures = _pictures(columns)
    wanted = _wanted(spec, path)
    _check(columns, wanted, path)
    if pictures:
        _check_pictures(pictures, len(columns["t"]), path)
    return {name: columns[name] for name in wanted}, pictures


def write_csv(events: Iterable[Event]) -> bytes:
    text = io.StringIO(newline="")
    out = csv.writer(text)
    out.writerow(["t", "kind", "gate", "lap", "left", "up", "speed", "x", "y", "z"])
    out.writerows((e.t, e.kind, e.gate, e.lap, *e.offset, e.speed, *e.position) for e in events)
    return text.getvalue().encode()


def _flat(pictures: PlannerSnapshots | None) -> dict[str, np.ndarray]:
    """As arrays of the file: frames, `best`, and one for each term, so that a replay can name it."""
    if pictures is None:
        return {}
    terms = {TERM + name: column for name, column in pictures.terms.items()}
    return {"pictured": pictures.frames, "best": pictures.best} | terms


def _pictures(columns: dict[str, np.ndarray]) -> PlannerSnapshots | None:
    """Taken out of the arrays of the file."""
    if "pictured" not in columns and "best" in columns:
        _compact(columns)
    if not {"pictured", "best"} <= columns.keys():
        return None
    names = [name for name in columns if name.startswith(TERM)]
    terms = {name.removeprefix(TERM): columns.pop(name) for name in names}
    return PlannerSnapshots(columns.pop("pictured"), columns.pop("best"), terms)


def _compact(columns: dict[str, np.ndarray]) -> None:
    """An early layout had a row for every frame, nan where no picture was taken."""
    best = columns["best"]
    if best.dtype != np.float32 or best.ndim != 4 or 0 in best.shape:
        return
    columns["pictured"] = taken = np.flatnonzero(np.isfinite(best[:, 0, 0, 0]))
    for name in ["best", *(name for name in columns if name.startswith(TERM))]:
        if columns[name].shape[:1] == best.shape[:1]:
            columns[name] = columns[name][taken]


def _wanted(spec: dict, path: object) -> dict[str, str]:
    try:
        return columns_of(spec)
    except (KeyError, TypeError, AttributeError) as error:
        raise RunError(f"{path}: run.json names no known system: {error}") from error


def _check(columns: dict[str, np.ndarray], wanted: dict[str, str], path: object) -> None:
    if wrong := sorted(columns.keys() ^ wanted.keys()):
        raise RunError(f"{path}: expected the columns of the run's system, missing or unknown: {', '.join(wrong)}")
    frames = columns["t"].shape
    for name, column in columns.items():
        kind = np.dtype(np.int64 if name in COUNTS else np.float64)
        if column.dtype != kind or column.ndim != 1 or column.shape != frames:
            raise RunError(f"{path}: {name}: expected {kind} {frames}, got {column.dtype} {column.shape}")


def _check_pictures(pictures: PlannerSnapshots, frames: int, path: object) -> None:
    k, best = pictures.frames, pictures.best
    if k.ndim != 1 or k.dtype != np.int64 or not len(k) or k[0] < 0 or k[-1] >= frames or (np.diff(k) <= 0).any():
        raise RunError(f"{path}: pictured: expected rising frames below {frames}, got {k.dtype} {k.shape}")
    if best.ndim != 4 or 0 in best.shape[1:] or best.shape[::3] != (len(k), 3) or best.dtype != np.float32:
        raise RunError(f"{path}: best: expected float32 {(len(k), 8, 'points', 3)}, got {best.dtype} {best.shape}")
    for name, column in pictures.terms.items():
        if column.dtype != np.float32 or column.shape != k.shape:
            raise RunError(f"{path}: {TERM}{name}: expected float32 {k.shape}, got {column.dtype} {column.shape}")


def _finite(value: object) -> object:
    """JSON has no nan: a chatter of a plant that blew up becomes null."""
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    return None if isinstance(value, float) and not isfinite(value) else value
