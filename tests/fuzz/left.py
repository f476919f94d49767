"""The contents of the folder that a command has worked in.

They are attempts, trials and files. The tests see in them whether anything looks finished that is
not.
"""

from __future__ import annotations

import json
import re
import sqlite3
import zipfile
from collections import Counter
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from quadsim.limit.limits import load

OLD = b"an older file, whole"
# The smallest part of a tmpfs [bytes].
PAGE = 4096
# The time at the beginning of a run's name.
TIME = re.compile(r"\d{8}T\d{6}Z_")
# SQLite's own two files come and go with its readers.
BESIDE = re.compile(r"\.sqlite-(wal|shm)$")
RUN = re.compile(r"^runs/[^/]+/(run|telemetry|events)\.[a-z]+$")


class Attempt(NamedTuple):
    """A row of a campaign."""

    variant: str
    seed: int
    folder: str
    digest: str

    @property
    def known_by(self) -> tuple[str, int]:
        """Return the key that no two attempts share."""
        return self.variant, self.seed


@dataclass(frozen=True)
class State:
    """The contents of the folder that a command has worked in."""

    files: Counter  # names without the times, which differ from flight to flight
    rows: dict[tuple[str, int], str]  # digest of each attempt that is kept
    twice: list[tuple[str, int]]  # attempts that are there more than once
    loose: list[str]  # folders of telemetry without a row, rows without a folder
    trials: int  # of a search, finished
    limits: dict[str, float]  # time of each solution of `race limit` [s]
    learnt: list[tuple]  # the evaluations of trainings, without the time they took

    @classmethod
    def of(cls, folder: Path) -> State:
        """Return the state of a folder."""
        attempts: list[Attempt] = []
        named: set[str] = set()
        trials = 0
        for path in folder.rglob("*.sqlite"):
            found = _attempts(path)
            attempts += found
            named |= {str(path.parent / attempt.folder) for attempt in found if attempt.folder}
            trials += _trials(path)
        counts = Counter(attempt.known_by for attempt in attempts)
        there = {str(path) for flights in folder.rglob("*.flights") for path in flights.iterdir()}
        files = [path.relative_to(folder) for path in folder.rglob("*") if path.is_file()]
        return cls(
            files=Counter(_general(path) for path in files),
            rows={attempt.known_by: attempt.digest for attempt in attempts},
            twice=[key for key, n in counts.items() if n > 1],
            loose=sorted(named ^ there),
            trials=trials,
            limits={path.name: load(path).time for path in folder.rglob("limits/*.npz")},
            learnt=[row for path in folder.rglob("*.checkpoint.npz") for row in _learnt(path)],
        )


def _learnt(path: Path) -> list[tuple]:
    """Return the evaluations in a checkpoint."""
    with np.load(path) as arrays:
        history = json.loads(str(arrays["state"]))["history"]
    return [tuple(value for name, value in row.items() if name != "seconds") for row in history]


def _attempts(path: Path) -> list[Attempt]:
    rows = _query(path, "SELECT variant, seed, folder, result FROM attempts")
    return [
        Attempt(variant, seed, folder, json.loads(result)["digest"])
        for variant, seed, folder, result in rows
    ]


def _trials(path: Path) -> int:
    return len(_query(path, "SELECT trial_id FROM trials WHERE state = 'COMPLETE'"))


def _query(path: Path, query: str) -> list[tuple]:
    """Return the rows of a query; none where there is no such table yet."""
    try:
        with closing(sqlite3.connect(path)) as db:
            return db.execute(query).fetchall()
    except sqlite3.OperationalError:
        return []


def _general(path: Path) -> str:
    """Return a name without what differs from flight to flight."""
    return BESIDE.sub(".sqlite", TIME.sub("", str(path)))


def left_behind(files: Counter, wanted: Counter) -> str:
    """Return which files are there too often and which are missing, or "".

    A flight of `race fly` that was kept just before the kill is rightly there twice.
    """
    more = {name for name in files - wanted if not RUN.search(name)}
    missing = set(wanted - files)
    if not more and not missing:
        return ""
    return f"left behind {sorted(more)}, missing {sorted(missing)}"


def half(folder: Path) -> str:
    """Return what looks finished and is not, or ""."""
    problem = _half_run(folder) or _half_archive(folder)
    if problem:
        return problem
    for path in folder.rglob("*.csv"):
        of_a_run = path.parent.parent.name.endswith((".flights", "runs"))
        if not of_a_run and not _whole_csv(path):
            return f"half a file: {path}"
    old = folder / "old"
    if old.exists() and old.read_bytes() != OLD and not _whole_csv(old):
        return "the older file is damaged"
    return ""


def _half_run(folder: Path) -> str:
    """Return which run looks finished and is not, or ""."""
    for path in folder.rglob("run.json"):
        if not path.parent.name.endswith(".part"):
            try:
                json.loads(path.read_text())
                zipfile.ZipFile(path.with_name("telemetry.npz")).testzip()
            except (ValueError, OSError, zipfile.BadZipFile) as error:
                return f"half a run: {path}: {error}"
    return ""


def _half_archive(folder: Path) -> str:
    """Return which pilot, checkpoint or solution cannot be read, or ""."""
    for path in (*folder.glob("*.npz"), *folder.rglob("limits/*.npz")):
        try:
            damaged = zipfile.ZipFile(path).testzip()
        except (OSError, zipfile.BadZipFile) as error:
            damaged = str(error)
        if damaged:
            return f"half a file: {path}: {damaged}"
    return ""


def _whole_csv(path: Path) -> bool:
    return path.read_bytes().endswith(b"\r\n")


def room(folder: Path) -> int:
    """Return the whole pages of all files, and one for every folder [bytes]."""
    sizes = [max(path.stat().st_size, 1) for path in folder.rglob("*")]
    return sum(-(-size // PAGE) * PAGE for size in sizes)
