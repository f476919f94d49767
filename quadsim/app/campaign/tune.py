"""`race tune`: search a planner's numbers for the fastest lap that is still safe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated

from msgspec import Meta
from rich.markup import escape
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, Positional, arg

from quadsim.app.campaign.common_flags import (
    CAMPAIGN,
    INTERRUPTED,
    Campaign,
    FlightWords,
    Workers,
    read_with_flight,
)
from quadsim.app.campaign.optuna_study import Study, objective, open_study
from quadsim.app.campaign.runner import Runner
from quadsim.app.campaign.search import Group, knobs, pareto, preset_text, turned
from quadsim.app.campaign.summary_stats import VariantStats, lap_limit, variant_stats
from quadsim.app.campaign.tables import TextTable, as_table
from quadsim.app.campaign.variants import Variant, resolve
from quadsim.app.console import complain, emit, emit_json
from quadsim.app.flags import UsageError
from quadsim.record.archive import write_whole
from quadsim.record.metrics import wilson

FINALISTS = 3  # of the search, flown again on fresh seeds: the best of many was lucky as well
FRESH = 10**6  # offset of their seeds
REPEAT = 4  # times the attempts of a trial


@dataclass(frozen=True)
class Tune:
    """Search for the fastest mean lap at a success of at least --floor; below it, attempts that do not finish count
    as their time limit. The best few fly again on fresh seeds, the best of those becomes the preset file.
    Every flag of `race fly` holds. The same command goes on where it was; more --trials go on from there.

    race tune split_s_swift --trials 200 --attempts 4 --randomize 1 --out fast.yaml

    race tune paper_flat --preset paper --sampler gaussian --search sigma temperature
    """

    course: Annotated[str, Positional, arg(metavar="COURSE")] = "split_s_swift"  # see `race courses`, or a FILE.yaml
    trials: Annotated[int, Meta(ge=1, le=100_000)] = 50  # planners to try, the one to start from included
    attempts: Annotated[int, Meta(ge=1, le=1000)] = 4  # flights of each
    floor: Annotated[float, Meta(ge=0, le=1)] = 1.0  # share of the attempts that must finish
    search: tuple[Group, ...] = ("sigma", "gamma", "temperature", "cost", "margin", "horizon")  # what to turn
    out: Annotated[str, arg(metavar="FILE.yaml")] = "tuned.yaml"  # the preset: race fly --preset FILE.yaml
    workers: OmitArgPrefixes[Workers] = field(default_factory=Workers)
    campaign: Campaign = CAMPAIGN  # where attempts are kept; the search itself is FILE.journal beside it
    json: FlagCreatePairsOff[bool] = False  # one JSON object instead of tables
    flight: FlightWords = ()

    @classmethod
    def from_argv(cls, argv: Sequence[str]) -> Tune:
        return read_with_flight(cls, "race tune", argv)

    def run(self) -> int:
        base = Variant("base", resolve([self.course, *self.flight], "race tune"))
        turns = list(knobs(base.spec.planner, base.spec.sampler, self.search))
        if not turns:
            raise UsageError(f"--search: {' '.join(self.search)}: nothing to turn for {base.spec.sampler} sampling")
        identity = f"{base.key[:16]}-{'-'.join(self.search)}-{self.attempts}-{self.floor:g}-{base.spec.seed}"
        study = open_study(Path(self.campaign).with_suffix(".journal"), identity, turns)
        try:
            with Runner(Path(self.campaign), self.workers, this_commit=False) as conduct:
                self._search(study, base, conduct)
                finals = self._finals(study, base, conduct)
        except KeyboardInterrupt:
            return INTERRUPTED
        self._present(study, base, finals)
        return 0

    def _search(self, study: Study, base: Variant, conduct: Runner) -> None:
        """As many trials at once as keep the workers busy."""
        while study.done < self.trials:
            wave = max(1, min(conduct.pool.size // self.attempts, self.trials - study.done))
            trials = study.ask(wave)
            variants = [_variant(f"trial {t.number}", base, t.params) for t in trials]
            for trial, variant, rows in zip(
                trials, variants, conduct(variants, self.attempts, quiet=True), strict=True
            ):
                if len(rows) < self.attempts:
                    study.fail(trial)
                    continue
                n = variant_stats(variant.name, rows, lap_limit(variant))
                study.tell(trial, n, self.floor)
                complain(f"{study.done}/{self.trials} {_said(n)}")

    def _finals(self, study: Study, base: Variant, conduct: Runner) -> list[tuple[VariantStats, dict]]:
        """The search's best on fresh seeds, best first."""
        fresh = replace(base, spec=replace(base.spec, seed=base.spec.seed + FRESH))
        best = study.best(FINALISTS)
        variants = [_variant(f"trial {number}", fresh, params) for number, params in best]
        flown = conduct(variants, REPEAT * self.attempts)
        numbers = [variant_stats(a.name, rows, lap_limit(a)) for a, rows in zip(variants, flown, strict=True) if rows]
        together = zip(numbers, (params for _, params in best), strict=True)
        return sorted(together, key=lambda pair: objective(pair[0], self.floor))

    def _present(self, study: Study, base: Variant, finals: list[tuple[VariantStats, dict]]) -> None:
        best, params = finals[0]
        planner = turned(base.spec.planner, params)
        comment = f"race tune {self.course}, {base.spec.sampler} sampling: {best.name} of {study.done}.\n"
        comment += f"On fresh seeds {_said(best)}; randomized {base.spec.randomize:g}."
        write_whole(Path(self.out), preset_text(planner, base.spec.preset, comment).encode())
        front = study.told()
        front = [front[i] for i in pareto([(n["lap"], -n["finished"], n["thrust_tv"]) for n in front])]
        front.sort(key=lambda n: n["lap"])
        if self.json:
            finalists = [asdict(n) | {"params": p} for n, p in finals]
            emit_json({"preset": self.out, "finals": finalists, "pareto": front, "trials": study.done})
            return
        emit("Nobody faster is safer and smoother, trial by trial:", "", as_table(_pareto_sheet(front, self.attempts)))
        emit("", "The search's best on fresh seeds:", *(f"  {escape(_said(n))}" for n, _ in finals))
        emit(
            "", f"{escape(self.out)}: race fly {self.course} --preset {escape(self.out)} --sampler {base.spec.sampler}"
        )


def _variant(name: str, base: Variant, params: dict) -> Variant:
    """The model stays: a search turns the planner, not what it knows of the vehicle."""
    return Variant(name, replace(base.spec, planner=turned(base.spec.planner, params)))


def _said(n: VariantStats) -> str:
    low, high = wilson(n.finished, n.attempts)
    laps = f"lap {n.lap_mean:.3f} s" if n.finished else "no lap"
    success = f"{n.finished}/{n.attempts} ({100 * low:.0f}-{100 * high:.0f} %)"
    return f"{n.name}: {success}, {laps}, thrust {n.thrust_tv:.0f} m/s^2/s"


def _pareto_sheet(front: Sequence[dict], attempts: int) -> TextTable:
    rows = [
        (
            str(n["trial"]),
            f"{n['finished']}/{attempts}",
            f"{n['lap']:.3f}",
            f"{n['thrust_tv']:.1f}",
            ", ".join(f"{name} {x:.3g}" for name, x in n["params"].items()),
        )
        for n in front
    ]
    return TextTable(("trial", "finished", "lap [s]", "thrust", "knobs"), tuple(rows), folds=(4,))
