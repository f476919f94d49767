"""`race results`: list, filter and compare the stored results of campaigns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from fnmatch import fnmatch
from itertools import combinations
from math import isfinite
from typing import Annotated

from rich.console import RenderableType
from rich.markup import escape

from quadsim.campaign.document import Table, as_table
from quadsim.campaign.flights.results import ABOVE_LIMIT, COLUMNS, TEXTS, Group, find, stored
from quadsim.campaign.flights.stats import PairStats, pair_stats
from quadsim.campaign.flights.tables import ALL_PAIRS, PAIRS, notes_of_faults
from quadsim.cli.campaigns import CAMPAIGN
from quadsim.cli.flags import Help, Json, RunsDir
from quadsim.console import UsageError, emit, emit_json

# Columns that move above the table if all groups share the cell, with their names there.
SHARED = {"course": "course", "vehicle": "vehicle", "rnd": "randomized", "commit": "commit"}


def results(
    *ids: Annotated[str, Help("first digits of variants; ID@COMMIT is one commit's")],
    campaigns: Annotated[tuple[str, ...], Help("files to look in", consume_multiple=True)] = (
        CAMPAIGN,
    ),
    course: Annotated[str, Help("pattern of the courses to list")] = "*",
    sampler: Annotated[str, Help("pattern of the samplers to list")] = "*",
    vehicle: Annotated[str, Help("pattern of the vehicles to list")] = "*",
    commit: Annotated[str, Help("first digits of the commit that flew")] = "",
    runs_dir: RunsDir = "runs",
    json: Json = False,
) -> int:
    """List stored results, one line for each variant and commit.

    Two or more ids compare them.

    race results --course 'split_s*' --sampler colored

    race results 3fa91c 8b02d7 --campaigns monday.sqlite campaigns/race.sqlite
    """
    groups = [
        group
        for group in stored(campaigns, runs_dir)
        if fnmatch(group.first.course, course)
        and fnmatch(group.first.sampler, sampler)
        and fnmatch(group.first.vehicle, vehicle)
        and fnmatch(group.first.code, f"{commit}*")
    ]
    pairs: list[PairStats] = []
    if ids:
        groups = [_find(groups, wanted) for wanted in ids]
        pairs = [
            pair_stats(a.label, b.label, a.rows, b.rows)
            for a, b in combinations(groups, 2)
            if a.first.course == b.first.course
        ]
    if json:
        variants = [asdict(g.stats) | {"id": g.id, "seeds": g.seeds} for g in groups]
        found = {"variants": variants, "pairs": [asdict(pair) for pair in pairs]}
        emit_json(found | {"campaigns": list(campaigns)})
        return 0
    emit(*results_table(groups))
    faults = list(notes_of_faults([group.stats for group in groups]))
    if faults:
        emit("", *map(escape, faults))
    if pairs:
        shown = pairs if len(groups) <= ALL_PAIRS else [p for p in pairs if p.a == groups[0].label]
        emit("", as_table(Table.of(shown, PAIRS)))
        if len(shown) < len(pairs):
            emit("", f"{len(shown)} of {len(pairs)} pairs, those with the first id; --json has all")
        if len({group.first.code for group in groups}) > 1:
            emit("", escape("MIXED COMMITS: " + ", ".join(group.label for group in groups)))
    return 0


def _find(groups: Sequence[Group], wanted: str) -> Group:
    try:
        return find(groups, wanted)
    except ValueError as error:
        raise UsageError(str(error)) from None


def results_table(groups: Sequence[Group], width: int | None = None) -> Iterator[RenderableType]:
    """Yield one table, and above it the values common to all groups, to save width.

    Args:
        groups: groups of flights, one per row.
        width: columns of the terminal; None: width of the present terminal.
    """
    if not groups:
        yield "no stored attempt matches"
        return
    left_out = set()
    above = []
    for head, name in SHARED.items():
        cells = {COLUMNS[head](group) for group in groups}
        if len(cells) == 1:
            left_out.add(head)
            above.append(f"{name} {cells.pop()}")
    if above:
        yield escape(", ".join(above))
        yield ""
    if not any(isfinite(group.stats.above_limit) for group in groups):
        left_out.add(ABOVE_LIMIT)
    columns = {head: cell for head, cell in COLUMNS.items() if head not in left_out}
    texts = tuple(i for i, head in enumerate(columns) if head in TEXTS)
    yield as_table(Table.of(groups, columns, texts), width)
