"""`race tune`: search a planner's parameters for the fastest lap that is still safe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated

from msgspec import Meta
from rich.markup import escape
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, Positional, arg

from quadsim.app.campaign.runner import Runner
from quadsim.app.campaign.search import Group, Search, objective, parameters, preset_text, with_parameters
from quadsim.app.campaign.store import Row
from quadsim.app.campaign.summary_stats import VariantStats, lap_limit, variant_stats
from quadsim.app.campaign.tables import TextTable, as_table
from quadsim.app.campaign.variants import (
    CAMPAIGN,
    INTERRUPTED,
    Campaign,
    FlightWords,
    Variant,
    Workers,
    read_with_flight,
    resolve,
)
from quadsim.app.console import complain, emit, emit_json
from quadsim.app.flags import UsageError
from quadsim.record.archive import write_whole

FINALISTS = 3  # of the search, flown again on fresh seeds: the best of many trials is also one with lucky seeds
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
    search: tuple[Group, ...] = ("sigma", "gamma", "temperature", "cost", "margin", "horizon")  # groups of parameters
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
        found = list(parameters(base.spec.planner, base.spec.sampler, self.search))
        if not found:
            raise UsageError(f"--search: {' '.join(self.search)}: nothing to search for {base.spec.sampler} sampling")
        identity = f"{base.key[:16]}-{'-'.join(self.search)}-{self.attempts}-{self.floor:g}-{base.spec.seed}"
        search = Search(Path(self.campaign).with_suffix(".journal"), identity, found)
        try:
            with Runner(Path(self.campaign), self.workers) as runner:
                self._search(search, base, runner)
                finals = self._finals(search, base, runner)
        except KeyboardInterrupt:
            return INTERRUPTED
        self._present(search, base, finals)
        return 0

    def _search(self, search: Search, base: Variant, runner: Runner) -> None:
        """As many trials at once as keep the workers busy."""
        while search.done < self.trials:
            trials = search.ask(max(1, min(runner.pool.size // self.attempts, self.trials - search.done)))
            variants = [_variant(t.number, base, t.params) for t in trials]
            flown = runner(variants, self.attempts, quiet=True)
            for trial, variant, rows in zip(trials, variants, flown, strict=True):
                if len(rows) < self.attempts:
                    search.fail(trial)
                    continue
                stats = _stats(variant, rows)
                search.tell(trial, stats, self.floor)
                complain(f"{search.done}/{self.trials} {_line(stats)}")

    def _finals(self, search: Search, base: Variant, runner: Runner) -> list[tuple[VariantStats, dict]]:
        """The search's best on fresh seeds, best first."""
        fresh = replace(base, spec=replace(base.spec, seed=base.spec.seed + FRESH))
        best = search.best(FINALISTS)
        variants = [_variant(number, fresh, params) for number, params in best]
        flown = zip(variants, runner(variants, REPEAT * self.attempts), best, strict=True)
        finals = [(_stats(variant, rows), params) for variant, rows, (_, params) in flown if rows]
        return sorted(finals, key=lambda pair: objective(pair[0], self.floor))

    def _present(self, search: Search, base: Variant, finals: list[tuple[VariantStats, dict]]) -> None:
        best, params = finals[0]
        sampler = base.spec.sampler
        comment = f"race tune {self.course}, {sampler} sampling: {best.name} of {search.done}.\n"
        comment += f"On fresh seeds {_line(best)}; randomized {base.spec.randomize:g}."
        planner = with_parameters(base.spec.planner, params)
        write_whole(Path(self.out), preset_text(planner, base.spec.preset, comment).encode())
        front = search.front()
        if self.json:
            finalists = [asdict(n) | {"params": p} for n, p in finals]
            emit_json({"preset": self.out, "finals": finalists, "pareto": front, "trials": search.done})
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
        emit("", "The best trials on fresh seeds:", *(f"  {escape(_line(n))}" for n, _ in finals), "")
        emit(f"{escape(self.out)}: race fly {self.course} --preset {escape(self.out)} --sampler {sampler}")


def _variant(trial: int, base: Variant, params: dict) -> Variant:
    """The model stays: a search changes the planner, not what it is told of the vehicle."""
    planner = with_parameters(base.spec.planner, params)
    return Variant(f"trial {trial}", replace(base.spec, planner=planner))


def _stats(variant: Variant, rows: Sequence[Row]) -> VariantStats:
    return variant_stats(variant.name, rows, lap_limit(variant.spec.record()))


def _line(n: VariantStats) -> str:
    low, high = n.success_ci
    laps = f"lap {n.lap_mean:.3f} s" if n.finished else "no lap"
    success = f"{n.finished}/{n.attempts} ({100 * low:.0f}-{100 * high:.0f} %)"
    return f"{n.name}: {success}, {laps}, thrust {n.thrust_tv:.0f} m/s^2/s"
