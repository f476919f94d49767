"""Store: one SQLite file with one row for each attempt; the telemetry lies beside it, one folder
for each flight.

A row is written in one transaction, after its telemetry is on the disk, so that every row is a
complete flight; only then does the telemetry's folder get its name. Write-ahead logging and a busy
timeout let several campaigns write at once.
"""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import cast

import msgspec

from quadsim.campaign.attempt import Flown, Result, attempt_key, of_telemetry, result, variant_key
from quadsim.console import complain
from quadsim.files.strict_yaml import FileError
from quadsim.record.archive import RunFolder, load_run, remove_unfinished
from quadsim.record.run import Outcome, RunError, canonical
from quadsim.record.whole_files import expect_file
from quadsim.spec.spec import Spec

BUSY_TIMEOUT = 60.0  # for another writer's transaction [s]
SCHEMA_VERSION = 4


@dataclass(frozen=True)
class Row:
    """One finished attempt: a column of the table for each field, and the specification, which
    `Store.spec` reads."""

    key: str  # sha256 of specification, seed and libraries
    code: str  # commit that flew it
    variant: str  # sha256 of the same without the seed
    name: str  # of the variant, when it flew
    course: str
    sampler: str
    preset: str
    vehicle: str
    randomize: float
    seed: int
    outcome: Outcome
    result: Result  # JSON
    folder: str  # telemetry, relative to the file; empty where it is not kept
    flown_at: str  # UTC


SQL_TYPES = {"str": "TEXT", "Outcome": "TEXT", "Result": "TEXT", "float": "REAL", "int": "INTEGER"}
COLUMNS = tuple(f.name for f in fields(Row))
TYPED = ", ".join(f"{f.name} {SQL_TYPES[str(f.type)]} NOT NULL" for f in fields(Row))
TABLE = f"CREATE TABLE attempts ({TYPED}, spec TEXT NOT NULL, PRIMARY KEY (key, code))"
INDEX = "CREATE INDEX attempts_by_variant ON attempts (variant, seed)"
# version of a file -> the statements that bring it to the present one; 0: an empty file
UPGRADES = {
    0: (TABLE, INDEX),
    1: ("ALTER TABLE attempts RENAME COLUMN arm TO variant", "DROP INDEX attempts_by_arm", INDEX),
    2: (),
    3: (),
}


class Store:
    """`with Store(path) as store`. Raises RunError: one line, the path, what is wrong."""

    def __init__(self, path: Path, create: bool = True):
        expect_file(path)
        self.path, self.flights = path, path.with_suffix(".flights")
        self._bad: set[tuple[str, str]] = set()  # key and code of rows that cannot be read
        if not create and not path.exists():
            raise RunError(f"{path}: no such campaign; `race compare` makes one")
        with _one_line(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._db = sqlite3.connect(path, timeout=BUSY_TIMEOUT, isolation_level=None)
            # JSON has no \x
            self._db.text_factory = lambda data: data.decode(errors="backslashreplace")
            if self._version() != SCHEMA_VERSION:
                self._upgrade()
            if create:
                remove_unfinished(self.flights, self._has)

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self._db.close()

    def add(self, spec: Spec, name: str, flown: Flown, telemetry: bool = True) -> bool:
        """Keep an attempt; False if another campaign has stored it meanwhile, whose row stays."""
        if not telemetry:
            return self._insert(spec, name, flown, "")
        with RunFolder.open(self.flights, spec.record(), flown.provenance) as folder:
            folder.write(flown.run)
            if added := self._insert(
                spec, name, flown, str(folder.path.relative_to(self.path.parent))
            ):
                folder.finish()
            else:
                folder.drop()
        return added

    def _insert(self, spec: Spec, name: str, flown: Flown, folder: str) -> bool:
        """A row, in the place of one that cannot be read."""
        record, versions = spec.record(), flown.provenance["versions"]
        row = Row(
            key=attempt_key(record, versions),
            code=code_of(flown.provenance),
            variant=variant_key(record, versions),
            name=name,
            course=record["course"],
            sampler=record["sampler"],
            preset=record.get("preset", ""),
            vehicle=(record.get("vehicle") or {}).get("name", ""),
            randomize=record.get("randomize", 0.0),
            seed=record["seed"],
            outcome=cast(Outcome, flown.run.outcome),
            result=result(flown),
            folder=folder,
            flown_at=time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        )
        values = [
            canonical(v).decode() if isinstance(v, dict) else v
            for v in (*vars(row).values(), record)
        ]
        columns, marks = ", ".join((*COLUMNS, "spec")), ", ".join("?" * len(values))
        clash = "REPLACE" if (row.key, row.code) in self._bad else "IGNORE"
        with _one_line(self.path):
            statement = f"INSERT OR {clash} INTO attempts ({columns}) VALUES ({marks})"
            return bool(self._db.execute(statement, values).rowcount)

    def rows(self, keys: Iterable[str] | None = None) -> list[Row]:
        """Attempts with these keys, or all, oldest first; a row that cannot be read is named and
        left out."""
        query, given = f"SELECT {', '.join(COLUMNS)}, rowid FROM attempts", ()
        if keys is not None:
            query, given = (
                query + " WHERE key IN (SELECT value FROM json_each(?))",
                (json.dumps(list(keys)),),
            )
        with _one_line(self.path):
            found = self._db.execute(query + " ORDER BY flown_at, seed", given).fetchall()
        return [row for *values, number in found if (row := self._row(values, number))]

    def _row(self, values: list, number: int) -> Row | None:
        columns = dict(zip(COLUMNS, values, strict=True))
        try:
            return msgspec.convert(
                columns | {"result": msgspec.json.decode(columns["result"])}, Row
            )
        except (msgspec.MsgspecError, TypeError, UnicodeDecodeError) as error:
            bad = columns["key"], columns["code"]
            if bad not in self._bad:
                what = f"the attempt {columns['name']} seed {columns['seed']}"
                complain(
                    f"{self.path}: row {number}, {what}, is damaged and does not count: {error}"
                )
            self._bad.add(bad)
            return None

    def spec(self, key: str) -> dict:
        """The full specification of an attempt. Raises RunError."""
        with _one_line(self.path):
            (text,) = self._db.execute("SELECT spec FROM attempts WHERE key = ?", (key,)).fetchone()
        try:
            return msgspec.json.decode(text, type=dict)
        except (msgspec.MsgspecError, TypeError) as error:
            raise RunError(
                f"{self.path}: the specification of attempt {key[:8]} is damaged: {error}"
            ) from error

    def _has(self, folder: str) -> bool:
        """Whether a row names this folder of telemetry."""
        name = str((self.flights / folder).relative_to(self.path.parent))
        return bool(self._db.execute("SELECT 1 FROM attempts WHERE folder = ?", (name,)).fetchone())

    def _version(self) -> int:
        return self._db.execute("PRAGMA user_version").fetchone()[0]

    def _upgrade(self) -> None:
        """Make the table of a new file, or bring an older file to the present version, in one
        transaction."""
        with self._db:  # commits, or rolls back on an error
            self._db.execute("BEGIN IMMEDIATE")
            # once more: another process may have upgraded the file meanwhile
            version = self._version()
            if version != SCHEMA_VERSION and version not in UPGRADES:
                raise RunError(
                    f"{self.path}: expected a campaign of version {SCHEMA_VERSION} or older, got {version}"
                )
            for statement in UPGRADES.get(version, ()):
                self._db.execute(statement)
            if version in (1, 2):
                self._hash_with_libraries()
            if version in (1, 2, 3):
                self._read_telemetry()
            self._db.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
        # does not wait: another process that holds the file does the same
        with suppress(sqlite3.OperationalError):
            self._db.execute("PRAGMA journal_mode = WAL")

    def _hash_with_libraries(self) -> None:
        """Keys of version 3 hold the libraries' versions, which the telemetry names; without it a
        row keeps its key."""
        for row, spec, folder in self._db.execute(
            "SELECT rowid, spec, folder FROM attempts"
        ).fetchall():
            with suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
                versions = json.loads((self.path.parent / folder / "run.json").read_bytes())[
                    "versions"
                ]
                keys = (
                    attempt_key(json.loads(spec), versions),
                    variant_key(json.loads(spec), versions),
                )
                self._db.execute(
                    "UPDATE OR IGNORE attempts SET key = ?, variant = ? WHERE rowid = ?",
                    (*keys, row),
                )

    def _read_telemetry(self) -> None:
        """Results of version 4 have the body rates' variation and where a flight turned back; what
        has no telemetry stays without."""
        for row, text, folder in self._db.execute(
            "SELECT rowid, result, folder FROM attempts"
        ).fetchall():
            with suppress(RunError, FileError, ValueError, KeyError, TypeError):
                if folder:
                    whole = json.loads(text) | of_telemetry(load_run(self.path.parent / folder))
                    self._db.execute(
                        "UPDATE attempts SET result = ? WHERE rowid = ?",
                        (canonical(whole).decode(), row),
                    )


def code_of(provenance: dict) -> str:
    """Commit, or where there is no repository the version."""
    return provenance["git"] or f"version {provenance['versions']['quadsim']}"


@contextmanager
def _one_line(path: Path) -> Iterator[None]:
    try:
        yield
    except (sqlite3.Error, OSError) as error:
        raise RunError(f"{path}: cannot keep the campaign here: {error}") from error
