"""The list of stored runs and races in a folder, read without telemetry."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from rich.markup import escape

from quadsim.console import as_text, plain_table
from quadsim.files.extras import imported
from quadsim.record.archive import list_heats, list_runs
from quadsim.results.stored_row import (
    UNREADABLE,
    StoredHeat,
    StoredRun,
    TableColumn,
    VehicleFlight,
    columns,
    read_row,
    value_names,
)

if TYPE_CHECKING:
    from pandas import DataFrame

# Of the printed table [columns]
WIDTH = 200

Row = StoredRun | StoredHeat


class StoredRuns(Sequence[Row]):
    """Stored runs and races, oldest first; `print` shows them as a table.

    Attributes:
        damaged: the problem of each folder that cannot be read, by its path.

    Examples:
        >>> import quadsim
        >>> folder = quadsim.fly("figure8", laps=1, samples=256).save()
        >>> stored = quadsim.runs()
        >>> len(stored), stored.damaged
        (1, {})
    """

    def __init__(self, rows: Sequence[Row], damaged: dict[Path, str]):
        """Make a list of rows.

        Args:
            rows: the readable runs and races.
            damaged: the problems of unreadable folders, see the class.
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
        shown = _printed_columns()
        return self._text(shown, [row.cells() for row in self])

    def by_name(self) -> str:
        """Return the table that `race runs` prints, with the names that other commands accept."""
        printed = _printed_columns().items()
        shown = {name: column for name, column in printed if not column.is_in_name}
        return self._text(
            {"name": TableColumn("run")} | shown, [{"name": row.name} | row.cells() for row in self]
        )

    def _text(self, shown: Mapping[str, TableColumn], rows: Sequence[Mapping[str, str]]) -> str:
        """Return a table of these columns, and a line for each damaged folder."""
        table = plain_table(*_titles(shown), left=_texts(shown), no_wrap=True)
        for cells in rows:
            table.add_row(*(escape(cells[name]) for name in shown))
        printed = table if rows else "no stored run matches"
        return as_text(printed, *map(escape, self._damaged_lines()), columns=WIDTH)

    def _repr_html_(self) -> str:
        """Return the table as HTML."""
        from quadsim.figures.html import block, paragraph, table  # here: other runs need no HTML

        shown = _printed_columns()
        rows = [list(row.cells().values()) for row in self]
        listed = table(_titles(shown), rows, _texts(shown))
        return block(listed, *map(paragraph, self._damaged_lines()))

    def to_pandas(self) -> DataFrame:
        """Return a DataFrame with a row for each run and the values of StoredRow as columns.

        Raises:
            ModuleNotFoundError: pandas is not installed; the message says how to install it.
        """
        pandas = imported("pandas", "pandas", "pandas")
        return pandas.DataFrame([row.values() for row in self], columns=list(value_names()))

    def _damaged_lines(self) -> list[str]:
        return [f"{path}: {problem}" for path, problem in self.damaged.items()]


def stored_runs(runs_dir: str | Path, **patterns: str | int | None) -> StoredRuns:
    """Return the stored runs and races of a folder; `quadsim.runs` describes the arguments."""
    folders = {*list_runs(runs_dir), *list_heats(runs_dir)}
    rows: list[Row] = []
    damaged = {}
    for path in sorted(folders, key=lambda folder: folder.name):
        try:
            row = read_row(path)
        except UNREADABLE as error:
            damaged[path] = f"cannot be read: {' '.join(str(error).split())}"
            continue
        if all(_fits_row(row, name, wanted) for name, wanted in patterns.items()):
            rows.append(row)
    return StoredRuns(rows, damaged)


def _fits_row(row: Row, name: str, wanted: str | int | None) -> bool:
    """Return whether a row, or any entrant of a race, has the wanted value."""
    if hasattr(VehicleFlight, name):
        return any(_fits(getattr(flight, name), wanted) for flight in row.flights)
    return _fits(getattr(row, name), wanted)


def _fits(value: Any, wanted: str | int | None) -> bool:
    """Return whether a value fits a filter; None fits every value."""
    if wanted is None:
        return True
    if isinstance(wanted, str):
        return value is not None and fnmatch(str(value), wanted)
    return value == wanted


def _printed_columns() -> dict[str, TableColumn]:
    """Return the columns of printed tables."""
    return {name: column for name, column in columns().items() if column.is_printed}


def _titles(shown: Mapping[str, TableColumn]) -> list[str]:
    """Return the headings of columns."""
    return [column.title for column in shown.values()]


def _texts(shown: Mapping[str, TableColumn]) -> list[int]:
    """Return the indices of the columns that have texts; the others have numbers."""
    return [number for number, column in enumerate(shown.values()) if column.digits is None]
