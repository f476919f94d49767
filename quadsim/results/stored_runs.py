"""Stored runs and races as a list of light rows: what their records say, without the telemetry."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from datetime import UTC, datetime
from fnmatch import fnmatch
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import msgspec
from rich.markup import escape

from quadsim.console import as_text, plain_table
from quadsim.files.arrays import read_bytes
from quadsim.files.extras import imported
from quadsim.files.strict_yaml import FileError
from quadsim.record.archive import HEAT, list_heats, list_runs, read_run
from quadsim.record.run import own_parts
from quadsim.record.schema import ListedHeat, ListedRun, RunSpec
from quadsim.results.heat import Heat
from quadsim.results.run import Run
from quadsim.sensing import PERFECT

if TYPE_CHECKING:
    from pandas import DataFrame

# Columns of the printed table; those named here are text
HEADS = ("when", "course", "flown by", "vehicle", "preset", "seed", "outcome", "laps", "time [s]")
TEXTS = (0, 1, 2, 3, 4, 6)
# What a row of a race has once for all entrants that share it
SHOWN_ONCE = ("vehicle", "sampler", "preset", "sensing")
# Columns beside the names of folders, which have the time, the course and the seed
BY_NAME = (2, 3, 4, 6, 7, 8)
# Of the printed table [columns]
WIDTH = 200
# Largest run.json or heat.json that is read for a list [bytes]; a run of 100 laps takes a tenth
LARGEST_RECORD = 20_000_000
# What a reader of a row raises for a folder that cannot be read
UNREADABLE = (FileError, msgspec.MsgspecError, ValueError, LookupError, RecursionError)


@dataclass(frozen=True)
class StoredRun:
    """What run.json says about one stored run.

    Attributes:
        name: name of its folder.
        path: its folder.
        when: when it was flown, in local time.
        course: name of the course.
        vehicle: name of the vehicle.
        sampler: name of the sampler, or the class of the user's own sampler or controller.
        preset: name of the preset.
        pilot: name of the learned pilot that flew; None if a planner did.
        seed: the seed.
        outcome: finished, crashed, stuck, timeout or interrupted.
        laps: times of the completed laps, penalties included [s].
        laps_wanted: laps of the race.
        sensing: name of the set of sensors; "perfect" gave the true state.
        changes: numbers of the planner that were changed in flight.
        controller: name of the user's own controller; None if none flew.

    Examples:
        >>> import quadsim
        >>> folder = quadsim.fly("figure8", laps=1, samples=256).save()
        >>> (row,) = quadsim.runs()
        >>> row.course, row.seed, row.outcome
        ('figure8', 0, 'finished')
    """

    name: str
    path: Path
    when: datetime
    course: str
    vehicle: str
    sampler: str
    preset: str
    pilot: str | None
    seed: int
    outcome: str
    laps: tuple[float, ...]
    laps_wanted: int
    sensing: str = PERFECT
    changes: int = 0
    controller: str | None = None

    @property
    def flown_by(self) -> str:
        """The controller, pilot or sampler of the flight, as a table shows it."""
        if self.controller:
            return f"controller {self.controller}"
        return f"pilot {self.pilot}" if self.pilot else self.sampler

    @property
    def time(self) -> float | None:
        """All laps from the standing start [s]; None if the race was not finished."""
        return sum(self.laps) if self.outcome == "finished" else None

    def load(self) -> Run:
        """Read the whole run, telemetry included.

        Raises:
            RunError: it is damaged.
        """
        return Run.of(read_run(self.path))

    def as_json(self) -> dict[str, Any]:
        """Return the row as JSON."""
        return _json_of(self)

    def cells(self) -> tuple[str, ...]:
        """Return its row of the printed table, by HEADS."""
        time = "" if self.time is None else f"{self.time:.3f}"
        return (
            f"{self.when:%Y-%m-%d %H:%M:%S}",
            self.course,
            self.flown_by,
            self.vehicle,
            self.preset,
            str(self.seed),
            self.outcome,
            f"{len(self.laps)}/{self.laps_wanted}",
            time,
        )


@dataclass(frozen=True)
class StoredHeat:
    """A row of the list of runs for one stored race of several vehicles, read from heat.json.

    Attributes:
        name: name of its folder.
        path: its folder.
        when: when it was flown, in local time.
        course: name of the course.
        entrants: the names of the entrants.
        vehicle: names of the vehicles, each once.
        sampler: what the entrants were flown by, each once; pilots by their names, controllers of
            the user's own by their classes.
        preset: names of the presets, each once.
        seed: the seed of the race.
        winner: name of the winner.
        finished: number of entrants that finished.
        laps_wanted: laps of the race.
        sensing: names of the sets of sensors, each once.
        time: the winner's time [s]; None if nobody finished.

    Examples:
        >>> import quadsim
        >>> heat = quadsim.race(["colored", "gaussian"], "figure8", laps=1, samples=256)
        >>> folder = heat.save()
        >>> (row,) = quadsim.runs().races
        >>> row.entrants, row.course
        (('colored', 'gaussian'), 'figure8')
        >>> row.load().digest() == heat.digest()
        True
    """

    name: str
    path: Path
    when: datetime
    course: str
    entrants: tuple[str, ...]
    vehicle: str
    sampler: str
    preset: str
    seed: int
    winner: str
    finished: int
    laps_wanted: int
    sensing: str
    time: float | None
    # values by which the row is found, of each entrant
    values: Mapping[str, tuple[str, ...]] = field(repr=False, default_factory=dict)

    @property
    def outcome(self) -> str:
        """The number of entrants that finished, and the name of the first, as text."""
        return f"{self.finished} of {len(self.entrants)} finished, {self.winner} first"

    def load(self) -> Heat:
        """Read the whole race, telemetry included.

        Raises:
            RunError: it is damaged.
        """
        return Heat.load(self.path)

    def as_json(self) -> dict[str, Any]:
        """Return the row as JSON."""
        return _json_of(self)

    def cells(self) -> tuple[str, ...]:
        """Return its row of the printed table, by HEADS."""
        return (
            f"{self.when:%Y-%m-%d %H:%M:%S}",
            self.course,
            f"race: {', '.join(self.entrants)}",
            self.vehicle,
            self.preset,
            str(self.seed),
            self.outcome,
            str(self.laps_wanted),
            "" if self.time is None else f"{self.time:.3f}",
        )


Row = StoredRun | StoredHeat


class StoredRuns(Sequence[Row]):
    """Stored runs and races, oldest first; `print` shows them as a table.

    Attributes:
        damaged: path of each folder that cannot be read -> what is wrong with it.

    Examples:
        >>> import quadsim
        >>> folder = quadsim.fly("figure8", laps=1, samples=256).save()
        >>> stored = quadsim.runs()
        >>> len(stored), stored.damaged
        (1, {})
    """

    def __init__(self, rows: Sequence[Row], damaged: dict[Path, str]):
        """Take the rows.

        Args:
            rows: the runs and races that can be read.
            damaged: the folders that cannot, see the class.
        """
        self._rows = tuple(rows)
        self.damaged = damaged

    @overload
    def __getitem__(self, index: int) -> Row: ...

    @overload
    def __getitem__(self, index: slice) -> StoredRuns: ...

    def __getitem__(self, index: int | slice) -> Row | StoredRuns:
        if isinstance(index, slice):
            return StoredRuns(self._rows[index], self.damaged)
        return self._rows[index]

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[Row]:
        return iter(self._rows)

    def __repr__(self) -> str:
        damaged = f", {len(self.damaged)} damaged" if self.damaged else ""
        return f"<StoredRuns: {len(self)}{damaged}>"

    @property
    def flights(self) -> list[StoredRun]:
        """The runs of single vehicles, without races of several."""
        return [row for row in self if isinstance(row, StoredRun)]

    @property
    def races(self) -> list[StoredHeat]:
        """The races of several vehicles."""
        return [row for row in self if isinstance(row, StoredHeat)]

    def __str__(self) -> str:
        """Return the table, and a line for each damaged folder."""
        return self._text(HEADS, TEXTS, [row.cells() for row in self])

    def by_name(self) -> str:
        """Return what `race runs` prints: the names of the folders, which other commands take."""
        heads = ("run", *(HEADS[column] for column in BY_NAME))
        rows = [(row.name, *(row.cells()[column] for column in BY_NAME)) for row in self]
        return self._text(heads, range(len(BY_NAME) - 1), rows)

    def _text(
        self, heads: Sequence[str], texts: Collection[int], rows: Sequence[tuple[str, ...]]
    ) -> str:
        """Return a table of these rows, and a line for each damaged folder."""
        table = plain_table(*heads, left=texts, no_wrap=True)
        for cells in rows:
            table.add_row(*map(escape, cells))
        shown = table if rows else "no stored run matches"
        return as_text(shown, *map(escape, self._damaged_lines()), columns=WIDTH)

    def _repr_html_(self) -> str:
        """Return the table as HTML."""
        from quadsim.figures.html import block, paragraph, table  # here: other runs need no HTML

        rows = [row.cells() for row in self]
        return block(table(HEADS, rows, TEXTS), *map(paragraph, self._damaged_lines()))

    def to_pandas(self) -> DataFrame:
        """Return the runs as a DataFrame, one row each, with the time of all laps as `time` [s].

        A race has the names of its entrants in `entrants`, and the winner's time.

        Raises:
            ModuleNotFoundError: pandas is not installed; the message says what to do.
        """
        pandas = imported("pandas", "pandas", "pandas")
        columns = [*StoredRun.__dataclass_fields__, "time", "entrants"]
        rows = [{name: getattr(row, name, None) for name in columns} for row in self]
        return pandas.DataFrame(rows, columns=columns)

    def _damaged_lines(self) -> list[str]:
        return [f"{path}: {problem}" for path, problem in self.damaged.items()]


def stored_runs(runs_dir: str | Path, **patterns: str | int | None) -> StoredRuns:
    """Return the stored runs and races of a folder; `quadsim.runs` describes the arguments."""
    readers: dict[Path, Callable[[Path], Row]] = dict.fromkeys(list_runs(runs_dir), read_row)
    readers |= dict.fromkeys(list_heats(runs_dir), read_heat_row)
    rows: list[Row] = []
    damaged = {}
    for path, read in sorted(readers.items(), key=lambda item: item[0].name):
        try:
            row = read(path)
        except UNREADABLE as error:
            damaged[path] = f"cannot be read: {' '.join(str(error).split())}"
            continue
        if all(_fits_row(row, name, wanted) for name, wanted in patterns.items()):
            rows.append(row)
    return StoredRuns(rows, damaged)


def read_row(path: Path, data: bytes | None = None) -> StoredRun:
    """Return what the run.json of a folder says.

    Args:
        path: the folder.
        data: content of its run.json; None: it is read.

    Raises:
        FileError: the file is missing, larger than any run's, or no regular file.
        msgspec.MsgspecError: the file is not the file of a run.
    """
    if data is None:
        data = read_bytes(path / "run.json", "the record of a flight", LARGEST_RECORD)
    found = msgspec.json.decode(data, type=ListedRun)
    spec = found.spec
    controller = _controller(spec)
    return StoredRun(
        name=path.name,
        path=path,
        when=flown_at(path),
        course=spec.course.name,
        vehicle=spec.vehicle.name,
        sampler=controller or spec.sampler,
        preset=spec.preset,
        pilot=spec.pilot.name if spec.pilot else None,
        seed=spec.seed,
        outcome=found.outcome,
        laps=tuple(found.laps),
        laps_wanted=spec.laps,
        sensing=spec.sensing.name if spec.sensing else PERFECT,
        changes=len(spec.interactive),
        controller=controller,
    )


def read_heat_row(path: Path) -> StoredHeat:
    """Return what the heat.json of a folder says.

    Raises:
        FileError: the file is missing, larger than any race's, or no regular file.
        msgspec.MsgspecError, LookupError: the file is not the file of a race.
    """
    data = read_bytes(path / HEAT, "the record of a race", LARGEST_RECORD)
    found = msgspec.json.decode(data, type=ListedHeat)
    specs = [msgspec.convert(entrant.spec, RunSpec) for entrant in found.spec.entrants]
    controllers = [_controller(spec) for spec in specs]
    winner = found.order[0]
    values = {
        "vehicle": tuple(spec.vehicle.name for spec in specs),
        "sampler": tuple(
            controller or (spec.pilot.name if spec.pilot else spec.sampler)
            for spec, controller in zip(specs, controllers, strict=True)
        ),
        "preset": tuple(spec.preset for spec in specs),
        "pilot": tuple(spec.pilot.name for spec in specs if spec.pilot),
        "controller": tuple(filter(None, controllers)),
        "outcome": tuple(placing.outcome for placing in found.order),
        "sensing": tuple(spec.sensing.name if spec.sensing else PERFECT for spec in specs),
    }
    shown = {name: ", ".join(dict.fromkeys(values[name])) for name in SHOWN_ONCE}
    return StoredHeat(
        name=path.name,
        path=path,
        when=flown_at(path),
        course=found.course,
        entrants=tuple(entrant.name for entrant in found.spec.entrants),
        seed=found.spec.seed,
        winner=winner.name,
        finished=sum(placing.time is not None for placing in found.order),
        laps_wanted=specs[0].laps,
        time=winner.time,
        values=values,
        **shown,
    )


def _controller(spec: RunSpec) -> str | None:
    """Return the class of the user's own controller, None if none flew."""
    return own_parts({"own": msgspec.to_builtins(spec.own)}).get("controller")


def flown_at(path: Path) -> datetime:
    """Return the local time in a folder's name, or else when it was written."""
    stamp = path.name.partition("_")[0]
    try:
        return datetime.strptime(stamp + "+0000", "%Y%m%dT%H%M%SZ%z").astimezone()
    except ValueError:
        written = path.stat().st_mtime if path.exists() else 0.0
        return datetime.fromtimestamp(written, UTC).astimezone()


def _fits_row(row: Row, name: str, wanted: str | int | None) -> bool:
    """Return whether a row is what was asked for; of a race, whether any of its entrants is."""
    if isinstance(row, StoredHeat) and name in row.values:
        return wanted is None or any(_fits(value, wanted) for value in row.values[name])
    return _fits(getattr(row, name), wanted)


def _fits(value: Any, wanted: str | int | None) -> bool:
    """Return whether a field is what was asked for; None asks for nothing."""
    if wanted is None:
        return True
    if isinstance(wanted, str):
        return value is not None and fnmatch(str(value), wanted)
    return value == wanted


def _json_of(row: Row) -> dict[str, Any]:
    """Return the fields of a row as JSON, with its time and its outcome."""
    shown = {f.name: getattr(row, f.name) for f in fields(row) if f.repr}
    shown |= {"path": str(row.path), "when": row.when.isoformat()}
    return shown | {"outcome": row.outcome, "time": row.time}
