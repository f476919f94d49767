"""The store of a campaign: an SQLite file with one row for each attempt.

The telemetry lies beside it, in one folder for each flight. A row is written in one transaction,
after its telemetry is on the disk, so that every row is a complete flight; only then does the
telemetry's folder get its name. Write-ahead logging and a busy timeout let several campaigns write
at once.
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

from quadsim.campaign.attempt import Flown, Result, attempt_key, result, variant_key
from quadsim.config.spec import Spec
from quadsim.console import complain
from quadsim.record.archive import RunFolder, remove_unfinished
from quadsim.record.run import Outcome, RunError, canonical
from quadsim.record.whole_files import expect_file

BUSY_TIMEOUT = 60.0  # how long another writer's transaction is waited for [s]
SCHEMA_VERSION = 5


@dataclass(frozen=True)
class Row:
    """One finished attempt: each field is a column of the table.

    The table has one more column, the specification, which `Store.spec` reads.
    """

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


class Store:
    """The attempts of one campaign: `with Store(path) as store`."""

    def __init__(self, path: Path, create: bool = True):
        """Open a campaign.

        Args:
            path: the SQLite file.
            create: make the file where there is none, and remove what a killed command has left
                unfinished.

        Raises:
            RunError: the file cannot be used.
        """
        expect_file(path)
        self.path = path
        self.flights = path.with_suffix(".flights")
        self._damaged: set[tuple[str, str]] = set()  # key and code of rows that cannot be read
        if not create and not path.exists():
            raise RunError(f"{path}: no such campaign; `race compare` makes one")
        with _one_line(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._db = sqlite3.connect(path, timeout=BUSY_TIMEOUT, isolation_level=None)
            # Bytes that are no UTF-8 become \x.., which JSON does not know: such a row is damaged.
            self._db.text_factory = lambda data: data.decode(errors="backslashreplace")
            if self._version() != SCHEMA_VERSION:
                self._make_table()
            if create:
                remove_unfinished(self.flights, self._has)

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self._db.close()

    def _version(self) -> int:
        return self._db.execute("PRAGMA user_version").fetchone()[0]

    def _make_table(self) -> None:
        """Make the table of a new file, in one transaction. Raises RunError for other files."""
        with self._db:  # commits, or rolls back on an error
            self._db.execute("BEGIN IMMEDIATE")
            # Another process may have made the table meanwhile.
            version = self._version()
            if version == SCHEMA_VERSION:
                return
            if version != 0:
                raise RunError(
                    f"{self.path}: expected a campaign of version {SCHEMA_VERSION}, got {version}; "
                    "move it away to begin a new one"
                )
            self._db.execute(TABLE)
            self._db.execute(INDEX)
            self._db.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
        # This does not wait for another process that holds the file: that one does the same.
        with suppress(sqlite3.OperationalError):
            self._db.execute("PRAGMA journal_mode = WAL")

    def add(
        self, spec: Spec, name: str, flown: Flown, telemetry: bool = True, twin: int = 0
    ) -> bool:
        """Keep an attempt.

        Args:
            spec: specification of the flight.
            name: name of its variant.
            flown: the flight.
            telemetry: whether to keep its telemetry too.
            twin: see quadsim.campaign.variants.Variant.

        Returns:
            False if another campaign has stored this attempt meanwhile; its row stays.

        Raises:
            RunError: the file cannot be written.
        """
        if not telemetry:
            return self._insert(spec, name, flown, folder="", twin=twin)
        with RunFolder.open(self.flights, spec.record(), flown.provenance) as folder:
            folder.write(flown.run)
            relative = str(folder.path.relative_to(self.path.parent))
            added = self._insert(spec, name, flown, relative, twin)
            if added:
                folder.finish()
            else:
                folder.drop()
        return added

    def _insert(self, spec: Spec, name: str, flown: Flown, folder: str, twin: int) -> bool:
        """Insert a row, in the place of one that cannot be read. Return whether it was inserted."""
        record = spec.record()
        versions = flown.provenance["versions"]
        row = Row(
            key=attempt_key(record, versions, twin),
            code=code_of(flown.provenance),
            variant=variant_key(record, versions, twin),
            name=name,
            course=record["course"],
            sampler=record["sampler"],
            preset=record["preset"],
            vehicle=record["vehicle"]["name"],
            randomize=record["randomize"],
            seed=record["seed"],
            outcome=cast(Outcome, flown.run.outcome),
            result=result(flown),
            folder=folder,
            flown_at=time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        )
        columns = vars(row) | {"spec": record}
        values = [canonical(v).decode() if isinstance(v, dict) else v for v in columns.values()]
        names = ", ".join(columns)
        marks = ", ".join("?" * len(columns))
        clash = "REPLACE" if (row.key, row.code) in self._damaged else "IGNORE"
        with _one_line(self.path):
            statement = f"INSERT OR {clash} INTO attempts ({names}) VALUES ({marks})"
            return bool(self._db.execute(statement, values).rowcount)

    def rows(self, keys: Iterable[str] | None = None) -> list[Row]:
        """Return attempts, oldest first; a row that cannot be read is named and left out.

        Args:
            keys: keys of the attempts that are wanted; None: all.

        Raises:
            RunError: the file cannot be read.
        """
        query = f"SELECT {', '.join(COLUMNS)}, rowid FROM attempts"
        given: tuple[str, ...] = ()
        if keys is not None:
            query += " WHERE key IN (SELECT value FROM json_each(?))"
            given = (json.dumps(list(keys)),)
        with _one_line(self.path):
            found = self._db.execute(f"{query} ORDER BY flown_at, seed", given).fetchall()
        rows = [self._row(values, number) for *values, number in found]
        return [row for row in rows if row is not None]

    def _row(self, values: list[object], number: int) -> Row | None:
        columns = dict(zip(COLUMNS, values, strict=True))
        try:
            decoded = msgspec.json.decode(cast(str, columns["result"]))
            return msgspec.convert(columns | {"result": decoded}, Row)
        except (msgspec.MsgspecError, TypeError, UnicodeDecodeError) as error:
            self._complain_once(columns, number, error)
            return None

    def _complain_once(self, columns: dict[str, object], number: int, error: Exception) -> None:
        damaged = str(columns["key"]), str(columns["code"])
        if damaged not in self._damaged:
            attempt = f"the attempt {columns['name']} seed {columns['seed']}"
            complain(
                f"{self.path}: row {number}, {attempt}, is damaged and does not count: {error}"
            )
        self._damaged.add(damaged)

    def spec(self, key: str) -> dict:
        """Return the full specification of an attempt. Raises RunError."""
        with _one_line(self.path):
            query = "SELECT spec FROM attempts WHERE key = ?"
            (text,) = self._db.execute(query, (key,)).fetchone()
        try:
            return msgspec.json.decode(text, type=dict)
        except (msgspec.MsgspecError, TypeError) as error:
            raise RunError(
                f"{self.path}: the specification of attempt {key[:8]} is damaged: {error}"
            ) from error

    def _has(self, folder: str) -> bool:
        """Return whether a row names this folder of telemetry."""
        name = str((self.flights / folder).relative_to(self.path.parent))
        query = "SELECT 1 FROM attempts WHERE folder = ?"
        return self._db.execute(query, (name,)).fetchone() is not None


def is_campaign(path: Path) -> bool:
    """Return whether a file is a campaign of this version. It is not changed."""
    try:
        db = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)
    except sqlite3.Error:
        return False
    try:
        (version,) = db.execute("PRAGMA user_version").fetchone()
        query = "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name = 'attempts'"
        (tables,) = db.execute(query).fetchone()
    except sqlite3.Error:
        return False
    finally:
        db.close()
    return version == SCHEMA_VERSION and tables == 1


def code_of(provenance: dict) -> str:
    """Return the commit of a flight, or the version where there is no repository."""
    return provenance["git"] or f"version {provenance['versions']['quadsim']}"


@contextmanager
def _one_line(path: Path) -> Iterator[None]:
    """Turn errors of SQLite and of files into a RunError."""
    try:
        yield
    except (sqlite3.Error, OSError) as error:
        raise RunError(f"{path}: cannot keep the campaign here: {error}") from error
