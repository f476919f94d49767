"""`race compare --line-up`: a comparison of settings of races."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.markup import escape

from quadsim.campaign.compare_heats import fly_comparison
from quadsim.campaign.heat_report import write_heats_report
from quadsim.campaign.heat_runner import HeatRunner
from quadsim.campaign.paired_heats import heat_variants
from quadsim.cli.flags import settings_as_flags
from quadsim.console import emit, emit_json
from quadsim.heat.line_up import parse_heat_variants
from quadsim.record.whole_files import expect_file, try_writing


def compare_heats(
    course: str | None,
    entrants: list[str],
    variants: str | None,
    given: dict[str, Any],
    starts: int,
    rotate: bool,
    campaign: Path,
    jobs: int | None,
    scheduler: str | None,
    this_commit: bool,
    out: Path | None,
    json: bool,
) -> int:
    """Fly races of a line-up under several settings and report the differences.

    Args:
        course: a name or a FILE.yaml; None: the default course.
        entrants: the line-up.
        variants: settings of the races, see `parse_heat_variants`; None: a single one.
        given: settings of all races and flights.
        starts: races of each setting.
        rotate: whether entrants change places from race to race.
        campaign: the SQLite file.
        jobs: the number of workers.
        scheduler: address of a Dask cluster; None: this machine.
        this_commit: whether only races of this commit count.
        out: folder of the report; None: beside the campaign.
        json: whether one JSON value is printed instead of tables.

    Raises:
        UsageError: a setting or an entrant is invalid.
        RunError: a file cannot be read or written, or no race was flown.
    """
    with settings_as_flags():
        own = parse_heat_variants(variants) if variants else {"race": {}}
        made = heat_variants(course, entrants, own, given, starts, rotate)
    expect_file(campaign)
    report = out or campaign.with_name(f"{campaign.stem}.report")
    try_writing(report)

    with HeatRunner(campaign, jobs, scheduler, this_commit) as runner:
        found = fly_comparison(made, runner)
    if json:
        emit_json(found.as_json() | {"campaign": str(campaign)})
    else:
        emit(*found.renderables())
    files = write_heats_report(made, found, report)
    if not json:
        emit("", *(f"[dim]{escape(str(file))}[/]" for file in files))
    complete = all(result is not None for one in found.settings for result in one.results)
    return 0 if complete else 1
