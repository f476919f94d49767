"""`race tune`: search a planner's parameters for the fastest lap that is still safe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

from msgspec import Meta
from rich.markup import escape

from quadsim.campaign.runner import Runner
from quadsim.campaign.search import (
    GROUPS,
    Group,
    Search,
    objective,
    parameters,
    preset_text,
    with_parameters,
)
from quadsim.campaign.store import Row
from quadsim.campaign.summary_stats import VariantStats, lap_limit, variant_stats
from quadsim.campaign.tables import TextTable, as_table
from quadsim.campaign.variants import CAMPAIGN, Campaign, Jobs, Scheduler, Variant, resolve
from quadsim.cli.flags import Given, Help, Json
from quadsim.console import UsageError, complain, emit, emit_json
from quadsim.record.whole_files import expect_file, expect_writable, write_whole

# of the search, flown again on fresh seeds: the best of many trials is also one with lucky seeds
FINALISTS = 3
FRESH = 10**6  # offset of their seeds
REPEAT = 4  # times the attempts of a trial


def tune(
    course: Annotated[str, Help("see `race courses`, or a FILE.yaml")] = "split_s_swift",
    /,
    *,
    trials: Annotated[
        int, Meta(ge=1, le=100_000), Help("planners to try, the one to start from included")
    ] = 50,
    attempts: Annotated[int, Meta(ge=1, le=1000), Help("flights of each")] = 4,
    floor: Annotated[float, Meta(ge=0, le=1), Help("share of the attempts that must finish")] = 1.0,
    search: Annotated[
        tuple[Group, ...], Help("groups of parameters", consume_multiple=True)
    ] = GROUPS,
    out: Annotated[str, Help("FILE.yaml of the preset, for race fly --preset")] = "tuned.yaml",
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    campaign: Campaign = CAMPAIGN,
    json: Json = False,
    settings: Given = None,
) -> int:
    """Search for the fastest mean lap at a success of at least --floor; below it, attempts that do
    not finish count as their time limit. The best few fly again on fresh seeds, the best of those
    becomes the preset file. Every flag of `race fly` holds. The same command goes on where it was;
    more --trials go on from there.

    race tune split_s_swift --trials 200 --attempts 4 --randomize 1 --out fast.yaml

    race tune paper_flat --preset paper --sampler gaussian --search sigma temperature
    """
    expect_file(Path(out))
    expect_writable(Path(out).parent)
    base = Variant("base", resolve(course, settings))
    if base.spec.system != "quadrotor":
        raise UsageError(
            f"expected a course for a quadrotor, got {course!r} for the system {base.spec.system}"
        )
    found = list(parameters(base.spec.planner, base.spec.sampler, search))
    if not found:
        raise UsageError(
            f"--search: {' '.join(search)}: nothing to search for {base.spec.sampler} sampling"
        )
    identity = f"{base.key[:16]}-{'-'.join(search)}-{attempts}-{floor:g}-{base.spec.seed}"
    journal = Search(Path(campaign).with_suffix(".journal"), identity, found)
    tuner = Tuner(course, trials, attempts, floor, out, journal, base)
    with Runner(Path(campaign), jobs, scheduler) as runner:
        tuner.search(runner)
        finals = tuner.finals(runner)
    if not finals or not finals[0][0].finished:
        complain(f"race tune: no attempt finished on fresh seeds: {out} is not written")
        return 1
    tuner.present(finals, json)
    return 0


@dataclass(frozen=True)
class Tuner:
    """One search."""

    course: str
    trials: int
    attempts: int
    floor: float
    out: str
    journal: Search
    base: Variant

    def search(self, runner: Runner) -> None:
        """As many trials at once as keep the workers busy."""
        while self.journal.done < self.trials:
            trials = self.journal.ask(
                max(1, min(runner.pool.size // self.attempts, self.trials - self.journal.done))
            )
            variants = [_variant(t.number, self.base, t.params) for t in trials]
            flown = runner(variants, self.attempts, quiet=True)
            for trial, variant, rows in zip(trials, variants, flown, strict=True):
                if len(rows) < self.attempts:
                    self.journal.fail(trial)
                    continue
                stats = _stats(variant, rows)
                self.journal.tell(trial, stats, self.floor)
                complain(f"{self.journal.done}/{self.trials} {_line(stats)}")

    def finals(self, runner: Runner) -> list[tuple[VariantStats, dict]]:
        """The search's best on fresh seeds, best first."""
        fresh = replace(self.base, spec=replace(self.base.spec, seed=self.base.spec.seed + FRESH))
        best = self.journal.best(FINALISTS)
        variants = [_variant(number, fresh, params) for number, params in best]
        flown = zip(variants, runner(variants, REPEAT * self.attempts), best, strict=True)
        finals = [(_stats(variant, rows), params) for variant, rows, (_, params) in flown if rows]
        return sorted(finals, key=lambda pair: objective(pair[0], self.floor))

    def present(self, finals: list[tuple[VariantStats, dict]], json: bool) -> None:
        best, params = finals[0]
        sampler = self.base.spec.sampler
        comment = (
            f"race tune {self.course}, {sampler} sampling: {best.name} of {self.journal.done}.\n"
        )
        comment += f"On fresh seeds {_line(best)}; randomized {self.base.spec.randomize:g}."
        planner = with_parameters(self.base.spec.planner, params)
        write_whole(Path(self.out), preset_text(planner, self.base.spec.preset, comment).encode())
        front = self.journal.front()
        if json:
            finalists = [asdict(n) | {"params": p} for n, p in finals]
            emit_json(
                {
                    "preset": self.out,
                    "finals": finalists,
                    "pareto": front,
                    "trials": self.journal.done,
                }
            )
            return
        columns = {
            "trial": lambda n: str(n["trial"]),
            "finished": lambda n: f"{n['finished']}/{self.attempts}",
            "lap [s]": lambda n: f"{n['lap']:.3f}",
            "thrust": lambda n: f"{n['thrust_tv']:.1f}",
            "parameters": lambda n: ", ".join(f"{name} {x:.3g}" for name, x in n["params"].items()),
        }
        emit("Pareto front of the trials: lap time, success, thrust variation", "")
        emit(as_table(TextTable.of(front, columns, folds=(4,))))
        emit(
            "", "The best trials on fresh seeds:", *(f"  {escape(_line(n))}" for n, _ in finals), ""
        )
        emit(
            f"{escape(self.out)}: race fly {self.course} --preset {escape(self.out)} --sampler {sampler}"
        )


def _variant(trial: int, base: Variant, params: dict) -> Variant:
    """The model stays: a search changes the planner, not what it is told of the vehicle."""
    return Variant(
        f"trial {trial}", replace(base.spec, planner=with_parameters(base.spec.planner, params))
    )


def _stats(variant: Variant, rows: Sequence[Row]) -> VariantStats:
    return variant_stats(variant.name, rows, lap_limit(variant.spec.record()))


def _line(n: VariantStats) -> str:
    low, high = n.success_ci
    laps = f"lap {n.lap_mean:.3f} s" if n.finished else "no lap"
    success = f"{n.finished}/{n.attempts} ({100 * low:.0f}-{100 * high:.0f} %)"
    return f"{n.name}: {success}, {laps}, thrust {n.thrust_tv:.0f} m/s^2/s"
