"""The SQLite file of a campaign: a table with a row for each flight or heat that was flown.

A row is written in one transaction, so that it is there whole or not at all. Write-ahead logging
and a busy timeout let several campaigns write at once. A row that cannot be read is named once and
does not count: it is flown again.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import fields
from pathlib import Path
from typing import Any, ClassVar, Generic, Protocol, Self, TypeVar, cast

import msgspec

from quadsim.console import complain
from quadsim.record.run import RunError, canonical
from quadsim.record.whole_files import expect_file

BUSY_TIMEOUT = 60.0  # how long another writer's transaction is waited for [s]
FORMAT = 6  # of the file; a file of another format is refused
SQL_TYPES = {"float": "REAL", "int": "INTEGER"}  # of fields; of all others TEXT


class Kept(Protocol):
    """A row of a campaign's table. Each field of its dataclass is a column."""

    @property
    def key(self) -> str:
        """The sha256 of the specification, the seed and the libraries."""
        ...

    @property
    def code(self) -> str:
        """The commit that flew it."""
        ...


AnyRow = TypeVar("AnyRow", bound=Kept)


class Database(Generic[AnyRow]):
    """The rows of one kind in a campaign's file: `with Store(path) as store`.

    A subclass names its dataclass of rows, the fields that are JSON, and the table. The table has
    one more column, the specification.
    """

    row_type: ClassVar[type[Any]]
    json_fields: ClassVar[tuple[str, ...]] = ("result",)
    table: ClassVar[str]
    made_by: ClassVar[str]  # the command that makes such a file

    def __init__(self, path: Path, create: bool = True):
        """Open a campaign.

        Args:
            path: the SQLite file.
            create: make the file if there is none.

        Raises:
            RunError: the file cannot be used.
        """
        expect_file(path)
        self.path = path
        self._columns = tuple(f.name for f in fields(self.row_type))
        self._damaged: set[tuple[str, str]] = set()  # key and code of rows that cannot be read
        if not create and not path.exists():
            raise RunError(f"{path}: no such campaign; `{self.made_by}` makes one")
        with database_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._db = sqlite3.connect(path, timeout=BUSY_TIMEOUT, isolation_level=None)
            # Bytes that are no UTF-8 become \x.., which JSON does not know: such a row is damaged.
            self._db.text_factory = lambda data: data.decode(errors="backslashreplace")
            if self._version() != FORMAT or not self._has_table():
                self._make_table()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._db.close()

    def _version(self) -> int:
        return self._db.execute("PRAGMA user_version").fetchone()[0]

    def _has_table(self) -> bool:
        query = "SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ?"
        return self._db.execute(query, (self.table,)).fetchone() is not None

    def _make_table(self) -> None:
        """Make the table, in one transaction. Raises RunError for files of other formats."""
        with self._db:  # commits, or rolls back on an error
            self._db.execute("BEGIN IMMEDIATE")
            version = self._version()
            if version != FORMAT and (version or self._has_table()):
                raise RunError(
                    f"{self.path}: expected a campaign of format {FORMAT}, got {version}; "
                    "move it away to begin a new one"
                )
            # Another process may have made the table meanwhile.
            if not self._has_table():
                self._create_table()
            self._db.execute(f"PRAGMA user_version = {FORMAT}")
        # This does not wait for another process that holds the file: that one does the same.
        with suppress(sqlite3.OperationalError):
            self._db.execute("PRAGMA journal_mode = WAL")

    def _create_table(self) -> None:
        """Create the table."""
        types = {f.name: SQL_TYPES.get(str(f.type), "TEXT") for f in fields(self.row_type)}
        typed = ", ".join(f"{name} {kind} NOT NULL" for name, kind in types.items())
        primary = "PRIMARY KEY (key, code)"
        self._db.execute(f"CREATE TABLE {self.table} ({typed}, spec TEXT NOT NULL, {primary})")

    def insert(self, row: AnyRow, spec: Mapping[str, Any]) -> bool:
        """Insert a row, in place of one that cannot be read.

        Args:
            row: the row.
            spec: the full specification of the flight or heat.

        Returns:
            Whether the row was inserted; False if another process has stored it meanwhile.

        Raises:
            RunError: the file cannot be written.
        """
        columns = vars(row) | {"spec": spec}
        as_json = (*self.json_fields, "spec")
        values = [canonical(v).decode() if name in as_json else v for name, v in columns.items()]
        names = ", ".join(columns)
        marks = ", ".join("?" * len(columns))
        clash = "REPLACE" if (row.key, row.code) in self._damaged else "IGNORE"
        with database_errors(self.path):
            statement = f"INSERT OR {clash} INTO {self.table} ({names}) VALUES ({marks})"
            return bool(self._db.execute(statement, values).rowcount)

    def rows(self, keys: Iterable[str] | None = None) -> list[AnyRow]:
        """Return rows, oldest first; a row that cannot be read is named and left out.

        Args:
            keys: the keys that are wanted; None: all.

        Raises:
            RunError: the file cannot be read.
        """
        query = f"SELECT {', '.join(self._columns)}, rowid FROM {self.table}"
        given: tuple[str, ...] = ()
        if keys is not None:
            query += " WHERE key IN (SELECT value FROM json_each(?))"
            given = (json.dumps(list(keys)),)
        with database_errors(self.path):
            found = self._db.execute(f"{query} ORDER BY flown_at, seed", given).fetchall()
        rows = [self._row(values, number) for *values, number in found]
        return [row for row in rows if row is not None]

    def newest(self, keys: Iterable[str], code: str, this_code: bool = False) -> dict[str, AnyRow]:
        """Return one row for each key that has been flown.

        If several commits flew it, the row of this commit counts, else the latest.

        Args:
            keys: the keys that are wanted.
            code: the present commit.
            this_code: count only what the present commit has flown.

        Raises:
            RunError: the file cannot be read.
        """
        found: dict[str, AnyRow] = {}
        for row in self.rows(keys):  # oldest first
            before = found.get(row.key)
            if row.code != code and (this_code or (before and before.code == code)):
                continue
            found[row.key] = row
        return found

    def _row(self, values: list[object], number: int) -> AnyRow | None:
        columns: dict[str, Any] = dict(zip(self._columns, values, strict=True))
        try:
            decoded = {name: msgspec.json.decode(columns[name]) for name in self.json_fields}
            return self.checked(msgspec.convert(columns | decoded, self.row_type))
        except (msgspec.MsgspecError, TypeError, ValueError, RecursionError) as error:
            self._complain_once(columns, number, error)
            return None

    def forget_errors(self, keys: Iterable[str]) -> int:
        """Remove the rows that an error of the user's own code has ended, and return their number.

        Such rows are not kept, because the error may be mended without a change of the key: in
        another module, or in a file that the code reads.

        Args:
            keys: the keys that are wanted.

        Raises:
            RunError: the file cannot be read or written.
        """
        found = [row for row in self.rows(keys) if self.ended_by_own_error(row)]
        for row in found:
            with database_errors(self.path):
                statement = f"DELETE FROM {self.table} WHERE key = ? AND code = ?"
                self._db.execute(statement, (row.key, row.code))
            self.forgotten(row)
        return len({row.key for row in found})

    def ended_by_own_error(self, row: AnyRow) -> bool:
        """Return whether an error of the user's own code has ended a flight of a row."""
        raise NotImplementedError

    def forgotten(self, row: AnyRow) -> None:
        """Remove the files that belong to a row that has been removed."""

    def checked(self, row: AnyRow) -> AnyRow:
        """Return the row. Raises ValueError if its parts do not fit together."""
        return row

    def label(self, columns: Mapping[str, object]) -> str:
        """Return the name of a row for a message."""
        return f"seed {columns['seed']}"

    def _complain_once(self, columns: dict[str, object], number: int, error: Exception) -> None:
        damaged = str(columns["key"]), str(columns["code"])
        if damaged not in self._damaged:
            what = self.label(columns)
            complain(f"{self.path}: row {number}, {what}, is damaged and does not count: {error}")
        self._damaged.add(damaged)

    def spec(self, key: str) -> dict:
        """Return the full specification of a row. Raises RunError."""
        with database_errors(self.path):
            query = f"SELECT spec FROM {self.table} WHERE key = ?"
            (text,) = self._db.execute(query, (key,)).fetchone()
        try:
            return msgspec.json.decode(cast(str, text), type=dict)
        except (msgspec.MsgspecError, TypeError) as error:
            raise RunError(
                f"{self.path}: the specification of {key[:8]} is damaged: {error}"
            ) from error


def code_of(provenance: Mapping[str, Any]) -> str:
    """Return the commit of a flight, or the version if there is no repository."""
    return provenance["git"] or f"version {provenance['versions']['quadsim']}"


@contextmanager
def database_errors(path: Path) -> Iterator[None]:
    """Turn errors of SQLite and of files into a RunError."""
    try:
        yield
    except (sqlite3.Error, OSError) as error:
        raise RunError(f"{path}: cannot keep the campaign here: {error}") from error
