"""`race compare-heats`: many races of the same entrants, under one setting or several."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from msgspec import Meta

from quadsim.campaign.heats.compare import fly_comparison, heats_stem
from quadsim.campaign.heats.paired import heat_variants
from quadsim.campaign.heats.runner import HeatRunner
from quadsim.cli.campaigns import (
    Campaign,
    Jobs,
    ReportFolder,
    Scheduler,
    ThisCommit,
    report_folder,
    show_and_save,
)
from quadsim.cli.flags import CourseName, Given, GivenHeat, Help, Json, settings_as_flags
from quadsim.cli.fly import complain_beside_controllers
from quadsim.cli.heat import ENTRANTS, EntrantTexts
from quadsim.config.settings import SettingError
from quadsim.heat.line_up import parse_heat_variants

CAMPAIGN = "campaigns/heats.sqlite"
STARTS = 64


def compare_heats(
    course: CourseName = None,
    /,
    *,
    entrants: EntrantTexts = None,
    variants: Annotated[
        str | None,
        Help(
            "settings of the races or of all their flights, flag=value or NAME=flag=value+...,"
            " joined by commas; default: one setting",
            show_default=False,
        ),
    ] = None,
    starts: Annotated[
        int, Meta(ge=1, le=100_000), Help("races of each variant, of consecutive seeds")
    ] = STARTS,
    rotate: Annotated[
        bool,
        Help("whether entrants change places from race to race", negative="--no-rotate"),
    ] = True,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    campaign: Campaign = CAMPAIGN,
    this_commit: ThisCommit = False,
    out: ReportFolder = None,
    json: Json = False,
    race: GivenHeat = None,
    settings: Given = None,
) -> int:
    """Fly many races of the same entrants: how often do they finish, win, overtake and collide?

    Finish rates, ranks, wins and a rating have 95 % intervals. With --variants the
    races are flown under several settings, and the first is compared with each
    other one: race i of every variant has the same starts. What has been flown
    before is not flown again.

    race compare-heats --entrants colored gaussian --randomize 1

    race compare-heats split_s_swift --entrants colored colored colored colored
    --variants expect=own,expect=velocity --starts 64 --randomize 1
    """
    given = (race or {}) | (settings or {})
    with settings_as_flags():
        if given.get("threads"):
            raise SettingError("threads", "races fly on one thread each; set --jobs")
        named = parse_heat_variants(variants) if variants else {"race": {}}
        raced = ENTRANTS if entrants is None else entrants
        made = heat_variants(course, raced, named, given, starts, rotate)
    specs = [entrant.spec for variant in made for entrant in variant.heats[0].entrants]
    complain_beside_controllers("race compare-heats", specs, settings or {})
    path = Path(campaign)
    report = report_folder(path, out)
    with HeatRunner(path, jobs, scheduler, this_commit) as runner:
        found = fly_comparison(made, runner)
    show_and_save(found, report, heats_stem(found, made), campaign, json)
    complete = all(result is not None for one in found.settings for result in one.results)
    return 0 if complete else 1
