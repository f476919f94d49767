"""`race sweep`: what each value of a setting costs, in flights paired by seed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Token
from msgspec import Meta

from quadsim.campaign.flights.sweep import fly_sweep, plan_sweep, sweep_stem
from quadsim.campaign.run.runner import Runner
from quadsim.campaign.run.variants import parse_variants
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
from quadsim.record.run import ERROR


def _apart(kind: Any, tokens: Sequence[Token]) -> list[list[str]]:
    """Return the words of each --over, whose first is a name."""
    groups: list[list[str]] = []
    for token in tokens:
        if token.index == 0:
            groups.append([])
        groups[-1].append(token.value)
    return groups


def sweep(
    *courses: Annotated[str, course_help()],
    over: Annotated[
        list[list[str]] | None,
        Help(
            "a setting and its values, the first of which the others are compared with; may be"
            " repeated",
            consume_multiple=True,
            converter=_apart,
            negative_iterable="",
            metavar="SETTING VALUE VALUE...",
        ),
    ] = None,
    variants: Annotated[
        str, Help("samplers, or NAME=preset+flag=value+..., joined by commas")
    ] = VARIANTS,
    attempts: Annotated[
        int, Meta(ge=1, le=100_000), Help("flights of each variant at each value")
    ] = ATTEMPTS,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    campaign: Campaign = CAMPAIGN,
    this_commit: ThisCommit = False,
    out: ReportFolder = None,
    json: Json = False,
    settings: Given = None,
) -> int:
    """Fly each value of a setting on the same seeds: what does an imperfection cost?

    Flight i at every value has seed --seed + i: the same start, gusts and vehicle
    under --randomize. Each --over is swept alone, with the other settings as they
    are. What has been flown before is not flown again, and a command that was
    interrupted continues where it stopped.

    race sweep split_s_swift --over latency 0 .02 .04 .06 --over link-hz 100 40 25
    --randomize 1

    race sweep alphapilot --sensing vio --over sensing.camera.noise 1 2 4
    --over sensing.camera.dropouts 0 .01 .03

    Beside the settings, a number of the vehicle (vehicle.mass) or of a sensor
    (sensing.imu.gyro_noise) can be swept. Several that change together are joined
    by +: sensing.camera.fx+sensing.camera.fy 320 425 gives both the same value,
    link-hz+sensing.imu.latency 100/.01 40/.02 gives each its own.
    """
    courses = courses or prescribed_courses(settings)
    if not courses:
        raise UsageError("expected one COURSE or more, got none (race courses lists them)")
    with settings_as_flags():
        named = parse_variants(variants)
        planned = plan_sweep(courses, _as_mapping(over or []), named, settings or {})
    specs = [variant.spec for curve in planned for variant in curve.at_values]
    complain_beside_controllers("race sweep", specs, settings or {})
    path = Path(campaign)
    report = report_folder(path, out)
    with Runner(path, jobs, scheduler, this_commit) as runner:
        found = fly_sweep(planned, attempts, runner, path.parent)

    show_and_save(found, report, sweep_stem(found, planned, attempts), campaign, json)
    flown = sum(point.stats.attempts for point in found.points)
    ended_by_error = any(attempt.outcome == ERROR for attempt in found.attempts)
    return 0 if flown == attempts * len(specs) and not ended_by_error else 1


def _as_mapping(groups: Sequence[Sequence[str]]) -> dict[str, list[str]]:
    """Return the values of each setting by its name.

    Raises:
        UsageError: a setting is given twice.
    """
    found: dict[str, list[str]] = {}
    for name, *values in groups:
        if name in found:
            raise UsageError(f"--over: expected {name} once, got it twice")
        found[name] = values
    return found
