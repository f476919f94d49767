"""`race results`: what campaigns have stored, listed, filtered, compared."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from fnmatch import fnmatch
from functools import cached_property
from itertools import combinations
from math import isfinite, nan
from pathlib import Path
from typing import Annotated

from rich.console import RenderableType
from rich.markup import escape

from quadsim.campaign.store import Row, Store
from quadsim.campaign.summary_stats import (
    VariantStats,
    best_known_time,
    lap_limit,
    pair_stats,
    variant_stats,
)
from quadsim.campaign.tables import PAIRS, TextTable, as_table, number, short
from quadsim.campaign.variants import CAMPAIGN
from quadsim.cli.flags import Help, Json
from quadsim.console import UsageError, complain, emit, emit_json
from quadsim.record.run import RunError

ID = 6  # hex digits of a variant that are shown


@dataclass(frozen=True)
class Group:
    """All attempts of one specification that one commit flew, from all campaigns."""

    rows: tuple[Row, ...]
    limit: float  # [s] a lap
    best_known: float = nan  # limit of the race [s]

    @property
    def first(self) -> Row:
        return self.rows[0]

    @property
    def id(self) -> str:
        return self.first.variant[:ID]

    @property
    def seeds(self) -> str:
        return f"{self.first.seed}-{self.rows[-1].seed}"

    @property
    def label(self) -> str:
        return f"{self.first.name} {self.id}@{short(self.first.code)}"

    @cached_property
    def stats(self) -> VariantStats:
        return variant_stats(self.first.name, self.rows, self.limit, self.best_known)


ABOVE = "above [%]"  # the best known limit
COLUMNS = {
    "id": lambda g: g.id,
    "variant": lambda g: g.first.name,
    "course": lambda g: g.first.course,
    "vehicle": lambda g: g.first.vehicle,
    "rnd": lambda g: f"{g.first.randomize:g}",
    "seeds": lambda g: g.seeds,
    "done": lambda g: f"{g.stats.finished}/{g.stats.attempts}",
    "lap [s]": lambda g: number(g.stats.lap_mean),
    ABOVE: lambda g: number(100.0 * g.stats.above_limit, ".1f"),
    "thrust": lambda g: number(g.stats.thrust_tv, ".1f"),
    "commit": lambda g: short(g.first.code),
}

# column -> in a sentence
SHARED = {"course": "course", "vehicle": "vehicle", "rnd": "randomized", "commit": "commit"}


def results(
    *ids: Annotated[str, Help("first digits of variants; ID@COMMIT is one commit's")],
    campaigns: Annotated[tuple[str, ...], Help("files to look in", consume_multiple=True)] = (
        CAMPAIGN,
    ),
    course: Annotated[str, Help("only of courses like this")] = "*",
    sampler: Annotated[str, Help("only of samplers like this")] = "*",
    vehicle: Annotated[str, Help("only of vehicles like this")] = "*",
    commit: Annotated[str, Help("only flown by commits that begin like this")] = "*",
    json: Json = False,
) -> int:
    """What is stored: one line for each variant and the commit that flew it. Two or more ids
    compare them.

    race results --course split_s* --sampler colored

    race results 3fa91c 8b02d7 --campaigns campaigns/monday.sqlite campaigns/race.sqlite
    """
    patterns = {"course": course, "sampler": sampler, "vehicle": vehicle, "code": f"{commit}*"}
    groups = [
        g
        for g in stored(campaigns)
        if all(fnmatch(getattr(g.first, k), p) for k, p in patterns.items())
    ]
    if ids:
        groups = [_find(groups, id_) for id_ in ids]
    pairs = [
        pair_stats(a.label, b.label, a.rows, b.rows)
        for a, b in combinations(groups if ids else [], 2)
        if a.first.course == b.first.course
    ]
    if json:
        variants = [asdict(g.stats) | {"id": g.id, "seeds": g.seeds} for g in groups]
        emit_json(
            {
                "variants": variants,
                "pairs": [asdict(p) for p in pairs],
                "campaigns": list(campaigns),
            }
        )
        return 0
    emit(*results_table(groups))
    if pairs:
        emit("", as_table(TextTable.of(pairs, PAIRS)))
    if len({g.first.code for g in groups}) > 1 and pairs:
        emit("", escape("MIXED COMMITS: " + ", ".join(g.label for g in groups)))
    return 0


def results_table(groups: Sequence[Group], width: int | None = None) -> Iterator[RenderableType]:
    """One table; what all groups share is said above it once, so that the rest is not so wide."""
    if not groups:
        yield "no stored attempt matches"
        return
    said = {head: {COLUMNS[head](g) for g in groups} for head in SHARED}
    shared = {head: cells.pop() for head, cells in said.items() if len(cells) == 1}
    if shared:
        yield escape(", ".join(f"{SHARED[head]} {cell}" for head, cell in shared.items()))
        yield ""
    unknown = set() if any(isfinite(g.stats.above_limit) for g in groups) else {ABOVE}
    columns = {head: cell for head, cell in COLUMNS.items() if head not in {*shared, *unknown}}
    texts = tuple(i for i, head in enumerate(columns) if head in ("variant", "course", "vehicle"))
    yield as_table(TextTable.of(groups, columns, folds=texts), width)


def stored(campaigns: Sequence[str]) -> Iterator[Group]:
    """Every group, in the order of its first flight. Raises RunError."""
    groups: dict[tuple[str, str], dict[str, Row]] = {}
    limits: dict[str, tuple[float, float]] = {}
    for path in campaigns:
        with Store(Path(path), create=False) as store:
            for row in store.rows():
                rows = groups.setdefault((row.variant, row.code), {})
                rows[row.key] = row  # one attempt in two campaigns counts once
                if row.variant not in limits:
                    limits[row.variant] = _limits(store, row)
    for (variant, _), rows in groups.items():
        yield Group(tuple(sorted(rows.values(), key=lambda r: r.seed)), *limits[variant])


def _limits(store: Store, row: Row) -> tuple[float, float]:
    """Time limit [s] a lap, best known limit of the race [s]; nan where the row's specification is
    damaged."""
    try:
        spec = store.spec(row.key)
        return lap_limit(spec), best_known_time(spec)
    except (KeyError, TypeError):
        complain(
            f"{store.path}: the specification of attempt {row.key[:8]} is damaged: no time limit"
        )
    except RunError as error:
        complain(str(error))
    return nan, nan


def _find(groups: Sequence[Group], wanted: str) -> Group:
    """By first digits of the variant, and of the commit if given. Raises UsageError unless just one
    matches."""
    variant, _, commit = wanted.partition("@")
    found = [
        g for g in groups if g.first.variant.startswith(variant) and g.first.code.startswith(commit)
    ]
    if len(found) != 1:
        known = ", ".join(g.label for g in (found or groups)[:4])
        raise UsageError(
            f"{wanted!r}: expected the id of one variant, or ID@COMMIT; {len(found)} match; there are {known}"
        )
    return found[0]
