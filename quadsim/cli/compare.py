"""`race compare`: a comparison of variants, and the flags that all campaigns share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from msgspec import Meta
from rich.markup import escape

from quadsim.campaign.compare import check_baseline, comparison, identity, write_report
from quadsim.campaign.runner import Runner
from quadsim.campaign.variants import make_variants, parse_variants
from quadsim.cli.compare_heats import compare_heats
from quadsim.cli.flags import Given, GivenHeat, Help, Json, Switch, course_help, settings_as_flags
from quadsim.cli.fly import complain_beside_controllers
from quadsim.config.competition import prescribed_courses
from quadsim.console import UsageError, emit, emit_json
from quadsim.record.run import ERROR, RunError
from quadsim.record.whole_files import expect_file, try_writing

CAMPAIGN = "campaigns/race.sqlite"
RACES = "campaigns/heats.sqlite"  # of --line-up
VARIANTS = "gaussian,colored"
ATTEMPTS = 10
STARTS = 64
Campaign = Annotated[str, Help("FILE.sqlite where attempts are kept")]
Jobs = Annotated[
    Annotated[int, Meta(ge=1)] | None, Help("attempts at once; default: one for each core")
]
Rotate = Annotated[
    bool,
    Help("whether entrants change places on the grid from race to race", negative="--no-rotate"),
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
        str | None,
        Help(
            "samplers, or NAME=preset+flag=value+..., joined by commas; default: gaussian,colored,"
            " or one race setting with --line-up",
            show_default=False,
        ),
    ] = None,
    attempts: Annotated[
        int, Meta(ge=1, le=100_000), Help("flights of each variant on each course")
    ] = ATTEMPTS,
    line_up: Annotated[
        list[str] | None,
        Help(
            "entrants of a race, as in race heat: variants are compared in races of them",
            consume_multiple=True,
        ),
    ] = None,
    starts: Annotated[
        Annotated[int, Meta(ge=1, le=100_000)] | None,
        Help("races of each variant, with --line-up; default: 64"),
    ] = None,
    rotate: Rotate = True,
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
    race: GivenHeat = None,
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

    With --line-up the variants are settings of races: how often do the entrants
    collide, overtake and finish? Race i of every variant has the same starts.

    race compare split_s_swift --line-up colored colored colored colored
    --variants expect=own,expect=velocity --starts 64 --randomize 1
    """
    if line_up is not None:
        if attempts != ATTEMPTS:
            raise UsageError("--line-up: expected --starts in place of --attempts")
        if baseline is not None:
            raise UsageError("--baseline: expected none beside --line-up: the first is compared")
        if len(courses) > 1:
            raise UsageError(f"--line-up: expected one course, got {len(courses)}")
        return compare_heats(
            course=next(iter(courses), None),
            entrants=line_up,
            variants=variants,
            given=(race or {}) | (settings or {}),
            starts=starts or STARTS,
            rotate=rotate,
            campaign=Path(RACES if campaign == CAMPAIGN else campaign),
            jobs=jobs,
            scheduler=scheduler,
            this_commit=this_commit,
            out=Path(out) if out else None,
            json=json,
        )
    of_races = {
        "starts": starts is not None,
        "no-rotate": not rotate,
        **dict.fromkeys(race or {}, True),
    }
    given_flag = next((name.replace("_", "-") for name, given in of_races.items() if given), None)
    if given_flag is not None:
        raise UsageError(f"--{given_flag}: expected --line-up beside it, the entrants of a race")
    courses = courses or prescribed_courses(settings)
    if not courses:
        raise UsageError("expected one COURSE or more, got none (race courses lists them)")
    with settings_as_flags():
        named = parse_variants(variants or VARIANTS)
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
