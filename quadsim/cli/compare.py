"""`race compare`: a comparison of variants, and the flags that all campaigns share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from msgspec import Meta
from rich.markup import escape

from quadsim.campaign.flights.compare import check_baseline, comparison, identity, write_report
from quadsim.campaign.run.runner import Runner
from quadsim.campaign.run.variants import make_variants, parse_variants
from quadsim.cli.flags import Given, Help, Json, Switch, course_help, settings_as_flags
from quadsim.cli.fly import complain_beside_controllers
from quadsim.config.competition import prescribed_courses
from quadsim.console import UsageError, emit, emit_json
from quadsim.record.run import ERROR, RunError
from quadsim.record.whole_files import expect_file, try_writing

CAMPAIGN = "campaigns/race.sqlite"
VARIANTS = "gaussian,colored"
ATTEMPTS = 10
Campaign = Annotated[str, Help("FILE.sqlite where attempts are kept")]
Jobs = Annotated[
    Annotated[int, Meta(ge=1)] | None, Help("attempts at once; default: one for each core")
]
ThisCommit = Annotated[bool, Switch("count only attempts that this commit has flown")]
ReportFolder = Annotated[
    str | None, Help("folder of Markdown and figures; default: beside the campaign")
]
Scheduler = Annotated[
    str | None, Help("tcp://HOST:PORT of a Dask cluster; default: processes of this machine")
]


def compare(
    *courses: Annotated[str, course_help()],
    variants: Annotated[
        str, Help("samplers, or NAME=preset+flag=value+..., joined by commas")
    ] = VARIANTS,
    attempts: Annotated[
        int, Meta(ge=1, le=100_000), Help("flights of each variant on each course")
    ] = ATTEMPTS,
    baseline: Annotated[
        str | None,
        Help(
            "variant that each other one is compared with, with corrected p-values; default: every"
            " two variants are compared"
        ),
    ] = None,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    campaign: Campaign = CAMPAIGN,
    this_commit: ThisCommit = False,
    out: ReportFolder = None,
    json: Json = False,
    settings: Given = None,
) -> int:
    """Fly variants on the same seeds and report their differences with intervals.

    Which one is faster, safer, smoother, and by how much? Attempt i of every
    variant flies seed --seed + i: the same start, gusts and vehicle under
    --randomize. Every flag of `race fly` holds for all variants. What has been
    flown before is not flown again.

    race compare paper_flat --preset paper --attempts 100 --randomize 1

    race compare split_s_swift
    --variants colored,soft=race+target-ess=200,wild=gaussian+sigma=3:3:.6:6
    """
    courses = courses or prescribed_courses(settings)
    if not courses:
        raise UsageError("expected one COURSE or more, got none (race courses lists them)")
    with settings_as_flags():
        named = parse_variants(variants)
        check_baseline(list(named), baseline)
        made = make_variants(courses, named, settings or {})
    complain_beside_controllers("race compare", [one.spec for one in made], settings or {})
    path = Path(campaign)
    expect_file(path)
    report = Path(out) if out else path.with_name(f"{path.stem}.report")
    try_writing(report)

    with Runner(path, jobs, scheduler, this_commit) as runner:
        rows = runner(made, attempts)
    found = comparison(made, rows, path.parent, baseline=baseline)
    if not found.sections:
        raise RunError("no attempt was flown: nothing to compare")

    # Results are printed first, as drawing may take some seconds.
    if json:
        emit_json(found.as_json() | {"campaign": campaign})
    else:
        emit(*found.renderables())
    files = write_report(found, report, identity(made, attempts, baseline))
    if not json:
        emit("", *(f"[dim]{escape(str(file))}[/]" for file in files))
    complete = all(len(of_variant) == attempts for of_variant in rows)
    # Such attempts are not kept, so that the comparison is not complete either.
    complete = complete and not any(row.outcome == ERROR for of in rows for row in of)
    return 0 if complete else 1
