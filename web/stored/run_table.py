"""RunTable: every stored run and race of a folder as a row, read once and kept.

A folder gets its final name when all its files are written. So the table is updated only when the
names in the folder of runs have changed, and reads only new folders: without changes, an update
takes a single look at the folder's time.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_type_hints

import msgspec

from quadsim.files.arrays import read_bytes
from quadsim.files.strict_yaml import FileError
from quadsim.heat.archive import HEAT, is_heat, read_heat
from quadsim.limit.limits import limit_of, limits_folder
from quadsim.record.archive import PART, read_run
from quadsim.record.run import RunError, canonical
from quadsim.record.schema import ListedHeat, RunSpec, StoredRecord
from quadsim.report.preset_changes import changed_numbers
from quadsim.results.stored_runs import LARGEST_RECORD, flown_at, read_row
from quadsim.sensing import PERFECT
from quadsim.web.state.plain_text import plain

RECORD = "run.json"
LONGEST_PROBLEM = 160  # [characters]
# A folder modified less than this time ago [s] may change again without a new time
RECENT = 2.0
# Parts of a spec that decide the limit of its race
OF_LIMIT = ("course", "vehicle", "laps", "plant", "penalties", "own")


@dataclass(frozen=True)
class Column:
    """A column of the table on the page.

    Attributes:
        title: its head.
        digits: decimals of its numbers; None: it has texts.
        is_long: whether its texts are cut to a width.
    """

    title: str
    digits: int | None = None
    is_long: bool = False


class RunRow(msgspec.Struct, frozen=True):
    """A row of the table: a run, a race of several, or a folder with a problem.

    A field with a Column is one on the page, in this order.
    """

    # name of the folder, which identifies the row
    name: str
    # local time of the flight, as "2026-11-20 16:15:07"
    when: Annotated[str, Column("flown")]
    course: Annotated[str, Column("course", is_long=True)] = ""
    # the sampler, or `pilot NAME`; for a race, the entrants
    flown_by: Annotated[str, Column("flown by", is_long=True)] = ""
    # time of the whole race, for a finished run [s]
    time: Annotated[float | None, Column("time [s]", 3)] = None
    # excess of the time over the best known limit [%]
    above: Annotated[float | None, Column("above limit [%]", 1)] = None
    outcome: Annotated[str, Column("outcome", is_long=True)] = ""
    # completed and required laps
    laps: Annotated[str, Column("laps")] = ""
    seed: Annotated[int | None, Column("seed", 0)] = None
    # numbers of the planner that differ from the preset; of each entrant of a race
    numbers: Annotated[str, Column("changed numbers", is_long=True)] = ""
    vehicle: Annotated[str, Column("vehicle", is_long=True)] = ""
    preset: Annotated[str, Column("preset", is_long=True)] = ""
    sensing: Annotated[str, Column("sensing", is_long=True)] = ""
    # numbers changed in flight
    changes: Annotated[int, Column("changes", 0)] = 0
    # further settings, by which a row is found: clock, deadline, flight controller, rules
    more: str = ""
    # number of vehicles in one world
    vehicles: int = 1
    # what is wrong with a folder that cannot be read or was changed, in one line
    problem: str = ""


def columns() -> dict[str, Column]:
    """Return the columns of the table by the fields of a row."""
    hints = get_type_hints(RunRow, include_extras=True)
    return {
        name: column
        for name, hint in hints.items()
        for column in getattr(hint, "__metadata__", ())
        if isinstance(column, Column)
    }


class _Stamp(NamedTuple):
    """The time at which the names in a folder last changed."""

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
    """A row as read, and the identifier of the race for its limit; empty: none."""

    row: RunRow
    race: str
    spec: dict[str, Any]


class RunTable:
    """The stored runs and races of a folder, for use by one thread.

    Args:
        root: the folder of runs.

    Attributes:
        rows: the rows, the latest first.
    """

    def __init__(self, root: str):
        self.rows: tuple[RunRow, ...] = ()
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
                self._read[name] = _damaged(name, read.row.when, problem)
                self.rows = tuple(map(self._with_limit, self._read.values()))
            return True
        return False

    def _look(self) -> bool:
        """Look for new and removed folders; return whether the rows have changed."""
        found = dict(sorted(self._folders(), reverse=True))
        self._read = {
            name: self._read.get(name) or _read(path, record)
            for name, (path, record) in found.items()
        }
        self._checked &= self._read.keys()
        rows = tuple(map(self._with_limit, self._read.values()))
        has_changed = rows != self.rows
        self.rows = rows
        return has_changed

    def _folders(self) -> Iterator[tuple[str, tuple[Path, str]]]:
        """Yield each folder of a run or a race by its name, with the name of its record."""
        try:
            entries = list(os.scandir(self._root))
        except OSError:
            return
        for entry in entries:
            if entry.name.endswith(PART) or not entry.name.isprintable():
                continue
            path = self._root / entry.name
            known = self._read.get(entry.name)
            for record in (HEAT, RECORD):
                if known or (path / record).is_file():
                    yield entry.name, (path, record)
                    break

    def _with_limit(self, read: _Read) -> RunRow:
        """Return a row with its distance from the best known limit."""
        row = read.row
        if row.time is None or not read.race:
            return row
        if read.race not in self._limits:
            limit = limit_of(read.spec, limits_folder(self._root))
            self._limits[read.race] = limit.time if limit else None
        best = self._limits[read.race]
        if best is None:
            return row
        # Adding 0.0 makes a negative zero a plain one
        above = round(100.0 * (row.time / best - 1.0), 1) + 0.0
        return msgspec.structs.replace(row, above=above)


def _read(path: Path, record: str) -> _Read:
    """Read the row of a folder; for a damaged folder the row has the error."""
    when = flown_at(path)
    try:
        data = read_bytes(path / record, "the record of a flight", LARGEST_RECORD)
        return _race(path.name, when, data) if record == HEAT else _run(path, data)
    except FileError as error:
        problem = _without_folder(error, path)
    except (msgspec.MsgspecError, ValueError, RecursionError, IndexError) as error:
        problem = f"{record}: {error}"
    return _damaged(path.name, _text(when), problem)


def _damaged(name: str, when: str, problem: str) -> _Read:
    """Return a row that says what is wrong."""
    line = " ".join(problem.split())
    return _Read(RunRow(name, when, problem=plain(f"damaged: {line}", LONGEST_PROBLEM)), "", {})


def _misfit(path: Path, row: RunRow) -> str:
    """Return what of a run or a race does not fit its telemetry, "" if all does."""
    try:
        if is_heat(path):
            read_heat(path)
            return ""
        run = read_run(path)
    except (RunError, FileError) as error:
        return _without_folder(error, path)
    time = sum(run.laps) if run.outcome == "finished" else None
    if (run.outcome, time) != (row.outcome, row.time):
        return "run.json: outcome and laps are not those of its events; changed after the flight"
    return ""


def _without_folder(error: Exception, path: Path) -> str:
    """Return an error without the folder that its row names."""
    return str(error).removeprefix(str(path)).lstrip("/: ")


def _run(path: Path, data: bytes) -> _Read:
    """Return the row of a run. data: its run.json."""
    run = read_row(path, data)
    spec = msgspec.json.decode(data, type=StoredRecord).spec
    row = RunRow(
        name=path.name,
        when=_text(run.when),
        course=plain(run.course),
        flown_by=plain(run.flown_by),
        vehicle=plain(run.vehicle),
        preset=plain("" if run.pilot else run.preset),
        sensing=plain(run.sensing),
        numbers=plain(_numbers(spec)),
        more=plain(_more(spec)),
        seed=run.seed,
        laps=f"{len(run.laps)}/{run.laps_wanted}",
        changes=run.changes,
        outcome=run.outcome,
        time=run.time,
    )
    return _Read(row, *_of_limit(spec))


def _race(name: str, when: datetime, data: bytes) -> _Read:
    """Return the row of a race of several: the time is the winner's. data: its heat.json."""
    race = msgspec.json.decode(data, type=ListedHeat)
    specs = {entrant.name: entrant.spec for entrant in race.spec.entrants}
    shown = [msgspec.convert(spec, RunSpec) for spec in specs.values()]
    winner = race.order[0]
    finished = sum(placing.time is not None for placing in race.order)
    row = RunRow(
        name=name,
        when=_text(when),
        course=plain(race.course),
        flown_by=plain(", ".join(specs)),
        vehicle=_each(spec.vehicle.name for spec in shown),
        preset=_each("" if spec.pilot else spec.preset for spec in shown),
        sensing=_each(spec.sensing.name if spec.sensing else PERFECT for spec in shown),
        numbers=_each(_numbers_of(name, spec) for name, spec in specs.items()),
        more=_each(map(_more, specs.values())),
        seed=race.spec.seed,
        laps=str(shown[0].laps),
        outcome=plain(f"{finished} of {len(race.order)} finished, {winner.name} first"),
        time=winner.time,
        vehicles=len(specs),
    )
    return _Read(row, *_of_limit(specs.get(winner.name, {})))


def _numbers(spec: Mapping[str, Any]) -> str:
    """Return the numbers of a planner that differ from its preset; unreadable ones are left out."""
    try:
        found = changed_numbers(spec)
    except (AttributeError, TypeError, KeyError, ValueError):
        return ""
    return ", ".join(f"{name} {value}" for name, value in found.items()).replace("_", " ")


def _numbers_of(name: str, spec: Mapping[str, Any]) -> str:
    """Return the changed numbers of an entrant with its name."""
    numbers = _numbers(spec)
    return f"{name}: {numbers}" if numbers else ""


def _more(spec: Mapping[str, Any]) -> str:
    """Return further settings of a flight that are not the usual ones."""
    found = []
    if spec.get("clock") == "wall":
        found.append("wall clock")
    if spec.get("deadline_ms"):
        found.append(f"deadline {spec['deadline_ms']} ms")
    if spec.get("betaflight"):
        found.append("betaflight")
    if spec.get("randomize"):
        found.append(f"randomize {spec['randomize']}")
    if spec.get("penalties"):
        found.append("penalties")
    if spec.get("plant"):
        found.append(str(spec["plant"]))
    return ", ".join(found)


def _each(names: Iterator[str]) -> str:
    """Return different names, each once."""
    return plain(", ".join(dict.fromkeys(filter(None, names))))


def _of_limit(spec: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """Return an identifier of the race of a spec, and the parts of the spec that decide it."""
    parts = {name: spec[name] for name in OF_LIMIT if name in spec}
    return sha256(canonical(parts)).hexdigest(), parts


def _text(when: datetime) -> str:
    return f"{when:%Y-%m-%d %H:%M:%S}"
