"""What a command has left in its folder: attempts, files, and whether anything looks finished that
is not."""

from __future__ import annotations

import json
import re
import sqlite3
import zipfile
from collections import Counter
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

OLD = b"an older file, whole"
PAGE = 4096  # the smallest part of a tmpfs [bytes]


@dataclass(frozen=True)
class State:
    """What a command has left in its folder."""

    files: Counter  # names without what differs from flight to flight
    rows: dict[tuple, str]  # (variant, seed) -> digest of each attempt kept
    twice: list[tuple]  # attempts that are there more than once
    loose: list[str]  # folders of telemetry without a row, rows without a folder
    trials: int  # of searches, finished

    @classmethod
    def of(cls, folder: Path) -> State:
        rows = [row for path in folder.rglob("*.sqlite") for row in _rows(path)]
        counts = Counter(row[:2] for row in rows)
        named = {
            str(path.parent / row[2])
            for path in folder.rglob("*.sqlite")
            for row in _rows(path)
            if row[2]
        }
        there = {str(p) for flights in folder.rglob("*.flights") for p in flights.iterdir()}
        return cls(
            files=Counter(
                _general(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()
            ),
            rows={row[:2]: row[3] for row in rows},
            twice=[row for row, n in counts.items() if n > 1],
            loose=sorted(named ^ there),
            trials=sum(_trials(path) for path in folder.rglob("*.sqlite")),
        )


def _rows(path: Path) -> list[tuple]:
    try:
        with closing(sqlite3.connect(path)) as db:
            found = db.execute("SELECT variant, seed, folder, result FROM attempts").fetchall()
    except sqlite3.OperationalError:  # no table yet
        return []
    return [
        (variant, seed, folder, json.loads(result)["digest"])
        for variant, seed, folder, result in found
    ]


def _trials(path: Path) -> int:
    """Return the number of finished trials of the searches in a campaign."""
    query = "SELECT COUNT(*) FROM trials WHERE state = 'COMPLETE'"
    try:
        with closing(sqlite3.connect(path)) as db:
            return db.execute(query).fetchone()[0]
    except sqlite3.OperationalError:  # no search yet
        return 0


def _general(path: Path) -> str:
    """Its time and hashes differ from flight to flight; SQLite's own two files come and go with its
    readers."""
    name = re.sub(r"\d{8}T\d{6}Z_", "", str(path))
    return (
        re.sub(r"\.sqlite-(wal|shm)$", ".sqlite", name)
        if name.endswith((".sqlite-wal", ".sqlite-shm"))
        else name
    )


def left_behind(files: Counter, wanted: Counter) -> str:
    """A flight of `race fly` that was kept just before the kill is there twice."""
    run = re.compile(r"^runs/[^/]+/(run|telemetry|events)\.[a-z]+$")
    more, missing = {name for name in files - wanted if not run.search(name)}, set(wanted - files)
    return f"left behind {sorted(more)}, missing {sorted(missing)}" if more or missing else ""


def half(folder: Path) -> str:
    """What looks finished and is not."""
    for path in folder.rglob("run.json"):
        if not path.parent.name.endswith(".part"):
            try:
                json.loads(path.read_text())
                zipfile.ZipFile(path.with_name("telemetry.npz")).testzip()
            except (ValueError, OSError, zipfile.BadZipFile) as error:
                return f"half a run: {path}: {error}"
    for path in folder.rglob("*.csv"):
        if not path.parent.parent.name.endswith(
            (".flights", "runs")
        ) and not path.read_bytes().endswith(b"\r\n"):
            return f"half a file: {path}"
    old = folder / "old"
    if old.exists() and old.read_bytes() != OLD and not old.read_bytes().endswith(b"\r\n"):
        return "the older file is damaged"
    return ""


def room(folder: Path) -> int:
    """Whole pages of all files, and one for every folder [bytes]."""
    return sum(-(-max(p.stat().st_size, 1) // PAGE) * PAGE for p in folder.rglob("*"))
