"""Stored runs as a list of light rows: what each run.json says, without the telemetry."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
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
from quadsim.record.archive import list_runs, load_run
from quadsim.record.schema import ListedRun
from quadsim.results.run import Run
from quadsim.sensing import PERFECT

if TYPE_CHECKING:
    from pandas import DataFrame
    from rich.table import Table

# Columns of the printed table; those named here are text
HEADS = ("when", "course", "flown by", "vehicle", "preset", "seed", "outcome", "laps", "time [s]")
TEXTS = (0, 1, 2, 3, 4, 6)
# Of the printed table [columns]
WIDTH = 140
# Largest run.json or heat.json that is read for a list [bytes]; a run of 100 laps takes a tenth
LARGEST_RECORD = 20_000_000
# What `read_row` raises for a folder that cannot be read
UNREADABLE = (FileError, msgspec.MsgspecError, UnicodeDecodeError, RecursionError)


@dataclass(frozen=True)
class StoredRun:
    """What run.json says about one stored run.

    Attributes:
        name: name of its folder.
        path: its folder.
        when: when it was flown, in local time.
        course: name of the course.
        vehicle: name of the vehicle.
        sampler: name of the sampler, or of the user's own class.
        preset: name of the preset.
        pilot: name of the learned pilot that flew; None if a planner did.
        seed: the seed.
        outcome: finished, crashed, stuck, timeout or interrupted.
        laps: times of the completed laps, penalties included [s].
        laps_wanted: laps of the race.
        sensing: name of the set of sensors; "perfect" gave the true state.
        changes: numbers of the planner that were changed in flight.

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

    @property
    def time(self) -> float | None:
        """All laps from the standing start [s]; None if the race was not finished."""
        return sum(self.laps) if self.outcome == "finished" else None

    def load(self) -> Run:
        """Read the whole run, telemetry included.

        Raises:
            RunError: it is damaged.
        """
        return Run.of(load_run(self.path))

    def cells(self) -> tuple[str, ...]:
        """Return its row of the printed table, by HEADS."""
        time = "" if self.time is None else f"{self.time:.3f}"
        return (
            f"{self.when:%Y-%m-%d %H:%M:%S}",
            self.course,
            f"pilot {self.pilot}" if self.pilot else self.sampler,
            self.vehicle,
            self.preset,
            str(self.seed),
            self.outcome,
            f"{len(self.laps)}/{self.laps_wanted}",
            time,
        )


class StoredRuns(Sequence[StoredRun]):
    """Stored runs, oldest first; `print` shows them as a table.

    Attributes:
        damaged: path of each folder that cannot be read -> what is wrong with it.

    Examples:
        >>> import quadsim
        >>> folder = quadsim.fly("figure8", laps=1, samples=256).save()
        >>> stored = quadsim.runs()
        >>> len(stored), stored.damaged
        (1, {})
    """

    def __init__(self, rows: Sequence[StoredRun], damaged: dict[Path, str]):
        """Take the rows.

        Args:
            rows: the runs that can be read.
            damaged: the folders that cannot, see the class.
        """
        self._rows = tuple(rows)
        self.damaged = damaged

    @overload
    def __getitem__(self, index: int) -> StoredRun: ...

    @overload
    def __getitem__(self, index: slice) -> StoredRuns: ...

    def __getitem__(self, index: int | slice) -> StoredRun | StoredRuns:
        if isinstance(index, slice):
            return StoredRuns(self._rows[index], self.damaged)
        return self._rows[index]

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[StoredRun]:
        return iter(self._rows)

    def __repr__(self) -> str:
        damaged = f", {len(self.damaged)} damaged" if self.damaged else ""
        return f"<StoredRuns: {len(self)}{damaged}>"

    def __str__(self) -> str:
        """Return the table, and a line for each damaged folder."""
        shown = self._table() if self else "no stored run matches"
        return as_text(shown, *map(escape, self._damaged_lines()), columns=WIDTH)

    def _repr_html_(self) -> str:
        """Return the table as HTML."""
        from quadsim.figures.html import block, paragraph, table  # here: other runs need no HTML

        rows = [row.cells() for row in self]
        return block(table(HEADS, rows, TEXTS), *map(paragraph, self._damaged_lines()))

    def to_pandas(self) -> DataFrame:
        """Return the runs as a DataFrame, one row each, with the time of all laps as `time` [s].

        Raises:
            ModuleNotFoundError: pandas is not installed; the message says what to do.
        """
        pandas = imported("pandas", "pandas", "pandas")
        columns = [*StoredRun.__dataclass_fields__, "time"]
        return pandas.DataFrame([asdict(row) | {"time": row.time} for row in self], columns=columns)

    def _table(self) -> Table:
        table = plain_table(*HEADS, left=TEXTS, no_wrap=True)
        for row in self:
            table.add_row(*map(escape, row.cells()))
        return table

    def _damaged_lines(self) -> list[str]:
        return [f"{path}: {problem}" for path, problem in self.damaged.items()]


def stored_runs(runs_dir: str | Path, **patterns: str | int | None) -> StoredRuns:
    """Return the stored runs of a folder; `quadsim.runs` describes the arguments."""
    rows = []
    damaged = {}
    for path in list_runs(runs_dir):
        try:
            row = read_row(path)
        except UNREADABLE as error:
            damaged[path] = f"cannot be read: {error}"
            continue
        if all(_fits(getattr(row, name), wanted) for name, wanted in patterns.items()):
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
    return StoredRun(
        name=path.name,
        path=path,
        when=flown_at(path),
        course=spec.course,
        vehicle=spec.vehicle.name,
        sampler=spec.sampler,
        preset=spec.preset,
        pilot=spec.pilot.name if spec.pilot else None,
        seed=spec.seed,
        outcome=found.outcome,
        laps=tuple(found.laps),
        laps_wanted=spec.laps,
        sensing=spec.sensing.name if spec.sensing else PERFECT,
        changes=len(spec.interactive),
    )


def flown_at(path: Path) -> datetime:
    """Return the local time in a folder's name, or else when it was written."""
    stamp = path.name.partition("_")[0]
    try:
        return datetime.strptime(stamp + "+0000", "%Y%m%dT%H%M%SZ%z").astimezone()
    except ValueError:
        written = path.stat().st_mtime if path.exists() else 0.0
        return datetime.fromtimestamp(written, UTC).astimezone()


def _fits(value: Any, wanted: str | int | None) -> bool:
    """Return whether a field is what was asked for; None asks for nothing."""
    if wanted is None:
        return True
    if isinstance(wanted, str):
        return value is not None and fnmatch(str(value), wanted)
    return value == wanted
