"""The results that campaigns have stored: attempts grouped by variant and commit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isfinite, nan
from pathlib import Path
from typing import NamedTuple

from quadsim.campaign.document import Block, Line, Table
from quadsim.campaign.flights.stats import VariantStats, best_known_time, lap_limit, variant_stats
from quadsim.campaign.flights.tables import number
from quadsim.campaign.run.commits import short
from quadsim.campaign.run.store import AttemptRow, Store
from quadsim.console import complain
from quadsim.record.run import RunError

ID_DIGITS = 6  # hex digits of a variant that are shown


@dataclass(frozen=True)
class StoredVariant:
    """All attempts of one variant that one commit has flown, from all campaigns."""

    rows: tuple[AttemptRow, ...]  # by seed
    limit: float  # [s] a lap
    best_known: float = nan  # limit of the race [s]

    @property
    def first(self) -> AttemptRow:
        """Return the attempt with the least seed."""
        return self.rows[0]

    @property
    def id(self) -> str:
        """Return the first digits of the variant's hash."""
        return self.first.variant[:ID_DIGITS]

    @property
    def seeds(self) -> str:
        """Return the least and the largest seed."""
        return f"{self.first.seed}-{self.rows[-1].seed}"

    @property
    def label(self) -> str:
        """Return name, id and commit."""
        return f"{self.first.name} {self.id}@{short(self.first.code)}"

    @cached_property
    def stats(self) -> VariantStats:
        """Return the numbers of the attempts."""
        return variant_stats(self.first.name, self.rows, self.limit, self.best_known)


ABOVE_LIMIT = "above [%]"  # the median race, above the best known limit
# Columns of the table of groups
COLUMNS: dict[str, Callable[[StoredVariant], str]] = {
    "id": lambda g: g.id,
    "variant": lambda g: g.first.name,
    "course": lambda g: g.first.course,
    "vehicle": lambda g: g.first.vehicle,
    "rnd": lambda g: f"{g.first.randomize:g}",
    "seeds": lambda g: g.seeds,
    "done": lambda g: f"{g.stats.finished}/{g.stats.attempts}",
    "lap [s]": lambda g: number(g.stats.lap_mean),
    ABOVE_LIMIT: lambda g: number(100.0 * g.stats.above_limit, ".1f"),
    "thrust\n[m/s^2/s]": lambda g: number(g.stats.thrust_tv, ".1f"),
    "commit": lambda g: short(g.first.code),
}
TEXTS = ("variant", "course", "vehicle")  # columns of text
# Columns that move above the table if all groups share the cell, with their names there
SHARED = {"course": "course", "vehicle": "vehicle", "rnd": "randomized", "commit": "commit"}


class _Limits(NamedTuple):
    lap: float  # time limit [s]
    race: float  # best known limit [s]


def stored(campaigns: Sequence[str], runs_dir: str | Path = "runs") -> list[StoredVariant]:
    """Return every group of these campaigns, in the order of its first flight.

    Args:
        campaigns: their files.
        runs_dir: folder of runs, where solutions of `race limit` are looked for.

    Raises:
        RunError: a campaign cannot be read.
    """
    groups: dict[tuple[str, str], dict[str, AttemptRow]] = {}
    limits: dict[str, _Limits] = {}
    for path in campaigns:
        with Store(Path(path), create=False) as store:
            for row in store.rows():
                # The key is unique: an attempt that is in two campaigns counts once.
                groups.setdefault((row.variant, row.code), {})[row.key] = row
                if row.variant not in limits:
                    limits[row.variant] = _limits(store, row, runs_dir)
    found = []
    for (variant, _), by_key in groups.items():
        rows = tuple(sorted(by_key.values(), key=lambda row: row.seed))
        found.append(StoredVariant(rows, limits[variant].lap, limits[variant].race))
    return found


def _limits(store: Store, row: AttemptRow, runs_dir: str | Path) -> _Limits:
    """Return the limits of a row's flight; nan if its specification is damaged."""
    try:
        spec = store.spec(row.key)
        return _Limits(lap_limit(spec), best_known_time(spec, runs_dir))
    except (KeyError, TypeError, ZeroDivisionError):
        complain(
            f"{store.path}: the specification of attempt {row.key[:8]} is damaged: no time limit"
        )
    except RunError as error:
        complain(str(error))
    return _Limits(nan, nan)


def find(groups: Sequence[StoredVariant], wanted: str) -> StoredVariant:
    """Return the one group with this id.

    Args:
        groups: groups to look in.
        wanted: the first digits of a variant, or ID@COMMIT.

    Raises:
        ValueError: no group or several have this id.
    """
    variant, _, commit = wanted.partition("@")
    found = [
        group
        for group in groups
        if group.first.variant.startswith(variant) and group.first.code.startswith(commit)
    ]
    if len(found) == 1:
        return found[0]
    known = ", ".join(group.label for group in (found or groups)[:4])
    raise ValueError(
        f"{wanted!r}: expected the id of one variant, or ID@COMMIT; {len(found)} match; "
        f"there are {known}"
    )


def group_blocks(groups: Sequence[StoredVariant]) -> list[Block]:
    """Return a table with a row for each group, and above it the values common to all, if any.

    Args:
        groups: groups of flights.
    """
    if not groups:
        return [Line("no stored attempt matches")]
    left_out = set()
    above = []
    for head, name in SHARED.items():
        cells = {COLUMNS[head](group) for group in groups}
        if len(cells) == 1:
            left_out.add(head)
            above.append(f"{name} {cells.pop()}")
    if not any(isfinite(group.stats.above_limit) for group in groups):
        left_out.add(ABOVE_LIMIT)
    columns = {head: cell for head, cell in COLUMNS.items() if head not in left_out}
    texts = tuple(i for i, head in enumerate(columns) if head in TEXTS)
    common = [Line(", ".join(above))] if above else []
    return [*common, Table.of(groups, columns, texts)]
