"""The report of many races, as tables and as JSON."""

from __future__ import annotations

from typing import Any

from rich.console import RenderableType

from quadsim.campaign.heat_tables import entrants_table, lines_of, overtakers_table, win_matrix
from quadsim.campaign.heats import EntrantStats, HeatsSummary, OvertakeStats
from quadsim.campaign.paired_heats import HeatsDifference
from quadsim.campaign.tables import as_table
from quadsim.files.json_values import without_nan
from quadsim.record.statistics import Mean


def tables_of(found: HeatsSummary) -> list[RenderableType]:
    """Return the report of many races under one setting."""
    return [
        "",
        as_table(entrants_table(found)),
        "",
        as_table(win_matrix(found)),
        "",
        *((as_table(overtakers_table(found)), "") if found.overtakers else ()),
        *(f"  {line}" for line in lines_of(found)),
    ]


def summary_as_json(found: HeatsSummary) -> dict[str, Any]:
    """Return the numbers of many races as JSON."""
    return plain(found) | {
        "entrants": [plain(entrant) for entrant in found.entrants],
        "pairs": [pair._asdict() for pair in found.pairs],
        "overtakers": [plain(overtaker) for overtaker in found.overtakers],
    }


def plain(record: HeatsSummary | EntrantStats | HeatsDifference | OvertakeStats) -> dict[str, Any]:
    """Return a record of numbers as a dictionary; a number that is not known is None."""

    def number(value: object) -> object:
        if isinstance(value, Mean):
            return {"mean": value.mean, "low": value.low, "high": value.high, "n": value.n}
        return value

    return without_nan({name: number(value) for name, value in record._asdict().items()})
