"""RunTable: every stored run and race of a folder as a row, read once and kept.

A folder gets its final name when all its files are written. So the table is updated only when the
names in the folder of runs have changed, and reads only new folders: without changes, an update
takes a single look at the folder's time.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from quadsim.files.strict_yaml import FileError
from quadsim.heat.archive import HEAT, is_heat, read_heat
from quadsim.limit.limits import limit_of, limits_folder
from quadsim.record.archive import PART, read_run
from quadsim.record.run import RunError, canonical
from quadsim.results.stored_row import (
    RECORD,
    UNREADABLE,
    StoredRow,
    TableColumn,
    columns,
    flown_at,
    read_row,
)
from quadsim.web.state.plain_text import plain

LONGEST_PROBLEM = 160  # [characters]
# A folder modified less than this time ago [s] may change again without a new time
RECENT = 2.0
# Parts of a spec that decide the limit of its race
OF_LIMIT = ("course", "vehicle", "laps", "plant", "penalties", "own")
# Excess of the time over the best known limit, a column of the page alone
ABOVE = TableColumn("above limit [%]", digits=1)


class PageRow(msgspec.Struct, frozen=True):
    """A row of the table on the page: a run, a race of several, or a folder with a problem.

    Attributes:
        name: name of the folder, which identifies the row.
        cells: a text, a number or None for each of `page_columns`.
        other_settings: further settings, by which a row is found.
        vehicles: number of vehicles in one world.
        problem: what is wrong with a folder that cannot be read or was changed, in one line.
    """

    name: str
    cells: Mapping[str, str | float | None]
    other_settings: str = ""
    vehicles: int = 1
    problem: str = ""


def page_columns() -> dict[str, TableColumn]:
    """Return the columns of the page: all of a stored run, and the excess beside the time."""
    found = {}
    for name, column in columns().items():
        found[name] = column
        if name == "time":
            found["above"] = ABOVE
    return found


class _Stamp(NamedTuple):
    """The time at which an entry of a folder was last added, renamed or removed."""

    changed: int  # [ns since 1970]; 0: there is no such folder
    is_recent: bool

    @classmethod
    def of(cls, folder: Path) -> _Stamp:
        try:
            changed = os.stat(folder).st_mtime_ns
        except OSError:
            return cls(0, False)
        return cls(changed, time.time() - changed * 1e-9 < RECENT)


class FolderWatch:
    """Detects changes of the names in a folder since the last call.

    A call reads only the folder's modification time.

    Args:
        folder: the folder, which may be missing.
    """

    def __init__(self, folder: Path):
        self._folder = folder
        self._last: _Stamp | None = None

    def has_changed(self) -> bool:
        """Return whether the names have, or may have, changed since the last call."""
        now = _Stamp.of(self._folder)
        last = self._last
        self._last = now
        return last is None or last.is_recent or now.changed != last.changed


class _Read(NamedTuple):
    """A row as read, and the race whose limit its time is compared with.

    Attributes:
        row: the row, without the excess over the limit.
        race: an identifier of the race; empty: nobody finished it.
        spec: the parts of a spec that decide the limit.
        time: all laps, or the winner's [s].
    """

    row: PageRow
    race: str = ""
    spec: Mapping[str, Any] = {}
    time: float = 0.0


class RunTable:
    """The stored runs and races of a folder, for use by one thread.

    Args:
        root: the folder of runs.

    Attributes:
        rows: the rows, the latest first.
    """

    def __init__(self, root: str):
        self.rows: tuple[PageRow, ...] = ()
        self._root = Path(root)
        self._watch = FolderWatch(self._root)
        self._limits_watch = FolderWatch(limits_folder(root))
        self._read: dict[str, _Read] = {}
        # names of the rows whose telemetry fits them
        self._checked: set[str] = set()
        # time of the best known limit [s] by race; None: none is known
        self._limits: dict[str, float | None] = {}

    def refresh(self) -> bool:
        """Read new folders since the last call; return whether the rows have changed."""
        has_changed = self._watch.has_changed()
        if self._limits_watch.has_changed():
            self._limits.clear()
            has_changed = True
        return has_changed and self._look()

    def path(self, name: str) -> Path | None:
        """Return the folder of a row; None if no row of the table has this name."""
        return self._root / name if name in self._read else None

    def check_next(self) -> bool:
        """Compare the latest row that is not yet checked with its telemetry, some milliseconds.

        A run that does not fit becomes a row that says so.

        Returns:
            Whether there was one.
        """
        for name, read in self._read.items():
            if read.row.problem or name in self._checked:
                continue
            self._checked.add(name)
            problem = _misfit(self._root / name, read.row)
            if problem:
                self._read[name] = _damaged(name, str(read.row.cells["when"]), problem)
                self.rows = tuple(map(self._with_limit, self._read.values()))
            return True
        return False

    def _look(self) -> bool:
        """Look for new and removed folders; return whether the rows have changed."""
        found = dict(sorted(self._folders(), reverse=True))
        self._read = {name: self._read.get(name) or _read(path) for name, path in found.items()}
        self._checked &= self._read.keys()
        rows = tuple(map(self._with_limit, self._read.values()))
        has_changed = rows != self.rows
        self.rows = rows
        return has_changed

    def _folders(self) -> Iterator[tuple[str, Path]]:
        """Yield each folder of a run or a race by its name."""
        try:
            entries = list(os.scandir(self._root))
        except OSError:
            return
        for entry in entries:
            if entry.name.endswith(PART) or not entry.name.isprintable():
                continue
            path = self._root / entry.name
            is_known = entry.name in self._read
            if is_known or any((path / record).is_file() for record in (HEAT, RECORD)):
                yield entry.name, path

    def _with_limit(self, read: _Read) -> PageRow:
        """Return a row with its distance from the best known limit."""
        row = read.row
        if not read.race:
            return row
        if read.race not in self._limits:
            limit = limit_of(dict(read.spec), limits_folder(self._root))
            self._limits[read.race] = limit.time if limit else None
        best = self._limits[read.race]
        if best is None:
            return row
        # Adding 0.0 makes a negative zero a plain one
        above = round(100.0 * (read.time / best - 1.0), 1) + 0.0
        return msgspec.structs.replace(row, cells={**row.cells, "above": above})


def _read(path: Path) -> _Read:
    """Read the row of a folder; for a damaged folder the row has the error."""
    try:
        return _of_row(read_row(path))
    except FileError as error:
        problem = _without_folder(error, path)
    except UNREADABLE as error:
        record = HEAT if is_heat(path) else RECORD
        problem = f"{record}: {error}"
    return _damaged(path.name, columns()["when"].text(flown_at(path)), problem)


def _of_row(stored: StoredRow) -> _Read:
    """Return the row of the page for a stored run or race."""
    cells = {name: _cell(column, getattr(stored, name)) for name, column in columns().items()}
    row = PageRow(
        name=stored.name,
        cells={**cells, "above": None},
        other_settings=plain(stored.other_settings),
        vehicles=len(stored.flights),
    )
    for flight in stored.flights:
        has_won = not stored.entrants or flight.name == stored.winner
        if has_won and flight.time is not None:
            return _Read(row, *_race(flight.whole_spec()), flight.time)
    return _Read(row)


def _damaged(name: str, when: str, problem: str) -> _Read:
    """Return the row of a run whose files cannot be read, with the reason in one line."""
    cells = {**dict.fromkeys(page_columns()), "when": when}
    line = " ".join(problem.split())
    return _Read(PageRow(name, cells, problem=plain(f"damaged: {line}", LONGEST_PROBLEM)))


def _misfit(path: Path, row: PageRow) -> str:
    """Return what of a run or a race does not fit its telemetry, "" if all does."""
    try:
        if is_heat(path):
            read_heat(path)
            return ""
        run = read_run(path)
    except (RunError, FileError) as error:
        return _without_folder(error, path)
    time = sum(run.laps) if run.outcome == "finished" else None
    if (run.outcome, time) != (row.cells["outcome"], row.cells["time"]):
        return "run.json: outcome and laps are not those of its events; changed after the flight"
    return ""


def _without_folder(error: Exception, path: Path) -> str:
    """Return an error without the folder that its row names."""
    return str(error).removeprefix(str(path)).lstrip("/: ")


def _race(spec: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """Return an identifier of the race of a spec, and the parts of the spec that decide it."""
    parts = {name: spec[name] for name in OF_LIMIT if name in spec}
    return sha256(canonical(parts)).hexdigest(), parts


def _cell(column: TableColumn, value: Any) -> str | float | None:
    """Return a value as the page gets it: a number, or a text from a file as one line."""
    return plain(column.text(value)) if column.digits is None else value
