"""`race compare`: a comparison of variants of flights."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from msgspec import Meta

from quadsim.campaign.flights.compare import check_baseline, comparison, comparison_stem, identity
from quadsim.campaign.run.runner import Runner
from quadsim.campaign.run.variants import make_variants, parse_variants
from quadsim.cli.campaigns import (
    ATTEMPTS,
    CAMPAIGN,
    VARIANTS,
    Campaign,
    Jobs,
    ReportFolder,
    Scheduler,
    ThisCommit,
    report_folder,
    show_and_save,
)
from quadsim.cli.flags import Given, Help, Json, course_help, settings_as_flags
from quadsim.cli.fly import complain_beside_controllers
from quadsim.config.competition import prescribed_courses
from quadsim.console import UsageError
from quadsim.record.run import ERROR, RunError


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
    report = report_folder(path, out)
    with Runner(path, jobs, scheduler, this_commit) as runner:
        rows = runner(made, attempts)
    found = comparison(made, rows, path.parent, baseline=baseline)
    if not found.sections:
        raise RunError("no attempt was flown: nothing to compare")

    stem = comparison_stem(found, identity(made, attempts, baseline))
    show_and_save(found, report, stem, campaign, json)
    complete = all(len(of_variant) == attempts for of_variant in rows)
    # Such attempts are not kept, so that the comparison is not complete either.
    complete = complete and not any(row.outcome == ERROR for of in rows for row in of)
    return 0 if complete else 1
