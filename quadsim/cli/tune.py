"""`race tune`: search planner parameters for the fastest lap at a minimum success rate."""

from __future__ import annotations

from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from msgspec import Meta
from rich.console import RenderableType
from rich.markup import escape

from quadsim.campaign.document import Table, as_table
from quadsim.campaign.run.variants import Variant
from quadsim.campaign.tune.parameters import (
    GROUPS,
    ParameterGroup,
    parameters,
    preset_text,
    with_parameters,
)
from quadsim.cli.campaigns import CAMPAIGN, Campaign, Jobs, Scheduler
from quadsim.cli.flags import Given, Help, Json, course_help, settings_as_flags
from quadsim.config.setting_texts import resolve
from quadsim.console import UsageError, complain, emit, emit_json
from quadsim.files.extras import needs_extra
from quadsim.record.whole_files import expect_file, try_writing, write_whole

if TYPE_CHECKING:  # these modules load optuna, which --help does not need
    from quadsim.campaign.tune.search import FlownTrial
    from quadsim.campaign.tune.tune import Finalist, Tuned

COURSE = "split_s_swift"  # if none is given


def tune(
    *courses: Annotated[str, course_help()],
    trials: Annotated[
        int, Meta(ge=1, le=100_000), Help("planners to try, the one to start from included")
    ] = 50,
    attempts: Annotated[int, Meta(ge=1, le=1000), Help("flights of each trial on each course")] = 4,
    floor: Annotated[float, Meta(ge=0, le=1), Help("share of the attempts that must finish")] = 1.0,
    search: Annotated[
        tuple[ParameterGroup, ...], Help("groups of parameters", consume_multiple=True)
    ] = GROUPS,
    out: Annotated[str, Help("FILE.yaml of the preset, for race fly --preset")] = "tuned.yaml",
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    campaign: Campaign = CAMPAIGN,
    json: Json = False,
    settings: Given = None,
) -> int:
    """Search for the fastest mean lap at a success of at least --floor.

    Below the floor, attempts that do not finish count as their time limit. On
    several courses the geometric mean of their laps counts. The best few trials
    fly again on fresh seeds, and the best of those becomes the preset file.
    Every flag of `race fly` applies. The same command continues an interrupted
    search; a larger --trials adds to it.

    race tune split_s_swift --trials 200 --randomize 1 --out fast.yaml

    race tune split_s_song alphapilot --search sigma temperature --trials 40

    race tune paper_flat --preset paper --search sigma temperature
    """
    expect_file(Path(out))
    try_writing(Path(out).parent)
    with settings_as_flags():
        bases = [
            Variant("base", resolve(course, settings or {}))
            for course in dict.fromkeys(courses or (COURSE,))
        ]
    base = bases[0]
    for name in ("pilot", "controller"):
        if getattr(base.spec, name) is not None:
            raise UsageError(f"--{name}: expected none, as the search is for the planner's numbers")
    sampler = base.spec.sampler
    space = list(parameters(base.spec.planner, search))
    if not space:
        raise UsageError(f"--search: {' '.join(search)}: nothing to search for {sampler} sampling")
    if find_spec("optuna") is None:
        raise UsageError(needs_extra("optuna", "tune"))
    from quadsim.campaign.tune.tune import Goal
    from quadsim.campaign.tune.tune import tune as run_search

    goal = Goal(trials, attempts, floor)
    tuned = run_search(bases, space, goal, Path(campaign), jobs, scheduler)
    if not tuned.finals or not tuned.finals[0].finishes:
        complain(f"race tune: no attempt finished on fresh seeds: {out} is not written")
        return 1

    best = tuned.finals[0]
    planner = with_parameters(base.spec.planner, best.parameters)
    names = " ".join(best.courses)
    comment = (
        f"race tune {names}, {sampler} sampling, {tuned.trials} trials.\n"
        f"On fresh seeds {_told(best)}; randomized {base.spec.randomize:g}."
    )
    write_whole(Path(out), preset_text(planner, base.spec.preset, comment).encode())
    if json:
        emit_json(_as_json(tuned, out))
        return 0
    emit("Pareto front of the trials: lap time, success, thrust variation", "")
    emit(_front_table(tuned.front, attempts * len(bases)))
    finals = [f"  {escape(_told(finalist))}" for finalist in tuned.finals]
    emit("", "The best trials on fresh seeds:", *finals, "")
    first = next(iter(best.courses))
    emit(f"{escape(out)}: race fly {first} --preset {escape(out)} --sampler {sampler}")
    return 0


def _told(finalist: Finalist) -> str:
    """Return a finalist's numbers on each course in one line."""
    from quadsim.campaign.tune.tune import summary

    return summary(list(finalist.courses.values()))


def _as_json(tuned: Tuned, out: str) -> dict:
    front = [
        {"trial": trial.number, **asdict(trial.stats), "params": trial.parameters}
        for trial in tuned.front
    ]
    return {
        "preset": out,
        "finals": [row for finalist in tuned.finals for row in finalist.as_json()],
        "pareto": front,
        "trials": tuned.trials,
    }


def _front_table(front: list[FlownTrial], attempts: int) -> RenderableType:
    def given(trial: FlownTrial) -> str:
        return ", ".join(f"{name} {value:.3g}" for name, value in trial.parameters.items())

    columns = {
        "trial": lambda t: str(t.number),
        "finished": lambda t: f"{t.stats.finished}/{attempts}",
        "lap [s]": lambda t: f"{t.stats.lap:.3f}",
        "thrust": lambda t: f"{t.stats.thrust_tv:.1f}",
        "parameters": given,
    }
    return as_table(Table.of(front, columns, texts=(4,)))
