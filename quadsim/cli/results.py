"""`race results`: list, filter and compare the stored results of campaigns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from fnmatch import fnmatch
from itertools import combinations
from typing import Annotated

from quadsim.campaign.document import Block, Document, Note, Table
from quadsim.campaign.flights.results import StoredVariant, find, group_blocks, stored
from quadsim.campaign.flights.stats import PairStats, pair_stats
from quadsim.campaign.flights.tables import ALL_PAIRS, PAIRS, notes_of_faults
from quadsim.cli.campaigns import CAMPAIGN
from quadsim.cli.flags import Help, Json, RunsDir
from quadsim.console import UsageError, emit, emit_json


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
    faults = notes_of_faults([group.stats for group in groups])
    blocks = [*group_blocks(groups), *map(Note, faults), *_pair_blocks(groups, pairs)]
    emit(*Document(tuple(blocks)).renderables())
    return 0


def _pair_blocks(groups: Sequence[StoredVariant], pairs: Sequence[PairStats]) -> list[Block]:
    """Return the table of compared groups and its remarks; nothing without pairs."""
    if not pairs:
        return []
    shown = pairs if len(groups) <= ALL_PAIRS else [p for p in pairs if p.a == groups[0].label]
    blocks: list[Block] = [Table.of(shown, PAIRS)]
    if len(shown) < len(pairs):
        text = f"{len(shown)} of {len(pairs)} pairs, those with the first id; --json has all"
        blocks.append(Note(text))
    if len({group.first.code for group in groups}) > 1:
        blocks.append(Note("MIXED COMMITS: " + ", ".join(group.label for group in groups)))
    return blocks


def _find(groups: Sequence[StoredVariant], wanted: str) -> StoredVariant:
    try:
        return find(groups, wanted)
    except ValueError as error:
        raise UsageError(str(error)) from None
