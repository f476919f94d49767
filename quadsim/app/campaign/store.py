"""Store: one SQLite file with one row for each attempt; the telemetry lies beside it, one folder for each flight.

A row is written in one transaction, after its telemetry is on the disk, so that every row is a complete flight.
Write-ahead logging and a busy timeout let several campaigns write at once.
"""

from __future__ import annotations

import json
import shutil
import sqlite3
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, fields
from pathlib import Path

from quadsim.app.campaign.attempt import Flown, attempt_key, result, variant_key
from quadsim.race.spec import Spec
from quadsim.record.archive import RunFolder
from quadsim.record.run import RunError, canonical

BUSY_TIMEOUT = 60.0  # for another writer's transaction [s]
SCHEMA_VERSION = 2


@dataclass(frozen=True)
class Row:
    """One finished attempt: a column of the table for each field, and the specification, which `Store.spec` reads."""

    key: str  # sha256 of specification and seed
    code: str  # commit that flew it
    variant: str  # sha256 of the specification without the seed
    name: str  # of the variant, when it flew
    course: str
    sampler: str
    preset: str
    vehicle: str
    randomize: float
    seed: int
    outcome: str  # finished, crashed, timeout
    result: dict  # JSON, see attempt.result
    folder: str  # telemetry, relative to the file
    flown_at: str  # UTC


SQL_TYPES = {"str": "TEXT", "dict": "TEXT", "float": "REAL", "int": "INTEGER"}
COLUMNS = tuple(f.name for f in fields(Row))
TYPED = ", ".join(f"{f.name} {SQL_TYPES[str(f.type)]} NOT NULL" for f in fields(Row))
TABLE = f"CREATE TABLE attempts ({TYPED}, spec TEXT NOT NULL, PRIMARY KEY (key, code))"
INDEX = "CREATE INDEX attempts_by_variant ON attempts (variant, seed)"
UPGRADES = {  # version of a file -> the statements that bring it to the present one; 0: an empty file
    0: (TABLE, INDEX),
    1: ("ALTER TABLE attempts RENAME COLUMN arm TO variant", "DROP INDEX attempts_by_arm", INDEX),
}


class Store:
    """`with Store(path) as store`. Raises RunError: one line, the path, what is wrong."""

    def __init__(self, path: Path, create: bool = True):
        self.path, self.flights = path, path.with_suffix(".flights")
        if not create and not path.exists():
            raise RunError(f"{path}: no such campaign; `race compare` makes one")
        with _one_line(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._db = sqlite3.connect(path, timeout=BUSY_TIMEOUT, isolation_level=None)
            if self._version() != SCHEMA_VERSION:
                self._upgrade()

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self._db.close()

    def add(self, spec: Spec, name: str, flown: Flown) -> bool:
        """Keep an attempt; False if another campaign has stored it meanwhile, whose row stays."""
        record = spec.record()
        folder = RunFolder.open(self.flights, record, flown.provenance).save(flown.run)
        row = Row(
            key=attempt_key(spec),
            code=code_of(flown.provenance),
            variant=variant_key(spec),
            name=name,
            course=record["course"],
            sampler=record["sampler"],
            preset=record.get("preset", ""),
            vehicle=(record.get("vehicle") or {}).get("name", ""),
            randomize=record.get("randomize", 0.0),
            seed=record["seed"],
            outcome=flown.run.outcome,
            result=result(flown),
            folder=str(folder.relative_to(self.path.parent)),
            flown_at=time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        )
        values = [canonical(v).decode() if isinstance(v, dict) else v for v in (*vars(row).values(), record)]
        with _one_line(self.path):
            columns, marks = ", ".join((*COLUMNS, "spec")), ", ".join("?" * len(values))
            added = self._db.execute(f"INSERT OR IGNORE INTO attempts ({columns}) VALUES ({marks})", values).rowcount
        if not added:
            shutil.rmtree(folder)
        return bool(added)

    def rows(self, keys: Iterable[str] | None = None) -> list[Row]:
        """Attempts with these keys, or all, oldest first."""
        query, given = f"SELECT {', '.join(COLUMNS)} FROM attempts", ()
        if keys is not None:
            query, given = query + " WHERE key IN (SELECT value FROM json_each(?))", (json.dumps(list(keys)),)
        with _one_line(self.path):
            found = self._db.execute(query + " ORDER BY flown_at, seed", given).fetchall()
        columns = (dict(zip(COLUMNS, values, strict=True)) for values in found)
        return [Row(**c | {"result": json.loads(c["result"])}) for c in columns]

    def spec(self, key: str) -> dict:
        """The full specification of an attempt."""
        with _one_line(self.path):
            return json.loads(self._db.execute("SELECT spec FROM attempts WHERE key = ?", (key,)).fetchone()[0])

    def _version(self) -> int:
        return self._db.execute("PRAGMA user_version").fetchone()[0]

    def _upgrade(self) -> None:
        """Make the table of a new file, or bring an older file to the present version, in one transaction."""
        with self._db:  # commits, or rolls back on an error
            self._db.execute("BEGIN IMMEDIATE")
            version = self._version()  # once more: another process may have upgraded the file meanwhile
            if version != SCHEMA_VERSION and version not in UPGRADES:
                raise RunError(f"{self.path}: expected a campaign of version {SCHEMA_VERSION} or older, got {version}")
            for statement in UPGRADES.get(version, ()):
                self._db.execute(statement)
            self._db.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
        with suppress(sqlite3.OperationalError):  # does not wait: another process that holds the file does the same
            self._db.execute("PRAGMA journal_mode = WAL")


def code_of(provenance: dict) -> str:
    """Commit, or where there is no repository the version."""
    return provenance["git"] or f"version {provenance['versions']['quadsim']}"


@contextmanager
def _one_line(path: Path) -> Iterator[None]:
    try:
        yield
    except (sqlite3.Error, OSError) as error:
        raise RunError(f"{path}: cannot keep the campaign here: {error}") from error
