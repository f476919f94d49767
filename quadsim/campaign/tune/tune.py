"""Tuning: the fastest planner that is still safe, searched and confirmed on fresh seeds.

A planner can be tuned on several courses at once. The geometric mean of the courses' mean laps is
minimised then, so that one per cent counts the same on a short course and on a long one.

This module needs the extra `tune`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from math import inf
from pathlib import Path
from statistics import fmean, geometric_mean

from quadsim.campaign.flights.stats import VariantStats, lap_limit, variant_stats
from quadsim.campaign.run.runner import Runner
from quadsim.campaign.run.store import AttemptRow
from quadsim.campaign.run.variants import Variant
from quadsim.campaign.tune.parameters import Parameter, Values, with_parameters
from quadsim.campaign.tune.search import FlownTrial, Search, TrialStats
from quadsim.console import complain
from quadsim.record.run import ERROR, RunError

# The best of many trials is also one with lucky seeds: the best few are flown again on fresh ones.
MOST_LOST = 5  # trials in a row that are lost with their workers before a search ends
FINALISTS = 3
FRESH = 10**6  # offset of the fresh seeds
REPEAT = 4  # times the attempts of a trial


@dataclass(frozen=True)
class Goal:
    """The goal of a search: its size, and the share of flights that must finish."""

    trials: int  # planners to try, the one that the search begins with included
    attempts: int  # flights of each trial on each course
    floor: float  # share of them that must finish


@dataclass(frozen=True)
class Finalist:
    """One of the best trials, flown again on fresh seeds."""

    courses: dict[str, VariantStats]  # by the name of the course
    parameters: Values

    @property
    def finishes(self) -> bool:
        """Whether an attempt has finished on every course."""
        return all(stats.finished for stats in self.courses.values())

    def as_json(self) -> list[dict]:
        """Return the numbers on each course as plain dictionaries."""
        return [
            asdict(stats) | {"course": course, "params": dict(self.parameters)}
            for course, stats in self.courses.items()
        ]


@dataclass(frozen=True)
class Tuned:
    """The result of a search."""

    finals: list[Finalist]  # best first
    front: list[FlownTrial]  # that no other dominates, see `pareto_front`
    trials: int


def tune(
    bases: Sequence[Variant],
    parameters: Sequence[Parameter],
    goal: Goal,
    campaign: Path,
    jobs: int | None = None,
    scheduler: str | None = None,
) -> Tuned:
    """Search for the fastest planner, or continue the search that these arguments began.

    Args:
        bases: the variant that the search begins with, on each course.
        parameters: parameters to search.
        goal: goal of the search.
        campaign: the SQLite file that keeps attempts and trials.
        jobs: the number of workers, see `open_pool`.
        scheduler: address of a Dask cluster, or "slurm", see `open_pool`.

    Raises:
        RunError: the campaign cannot be read or written, or a worker has other libraries.
        KeyboardInterrupt: Ctrl-C; the attempts that have finished are kept.
    """
    names = "-".join(p.name for p in parameters)
    seed = bases[0].spec.seed
    identity = f"{_key(bases)[:16]}-{names}-{goal.attempts}-{goal.floor:g}-{seed}"
    with (
        Runner(campaign, jobs, scheduler) as runner,
        Search(campaign, identity, parameters) as search,
    ):
        _search(search, bases, goal, runner)
        return Tuned(
            finals=_finals(search, bases, goal, runner),
            front=pareto_front(search.flown()),
            trials=search.done,
        )


def _key(bases: Sequence[Variant]) -> str:
    """Return a key that distinguishes the variant and its courses from others."""
    if len(bases) == 1:
        return bases[0].key
    return sha256("".join(base.key for base in bases).encode()).hexdigest()


def _search(search: Search, bases: Sequence[Variant], goal: Goal, runner: Runner) -> None:
    """Fly trials, as many at once as keep the workers busy."""
    lost = 0  # trials in a row that were not flown
    courses = len(bases)
    while search.done < goal.trials:
        at_once = min(runner.pool.size // (goal.attempts * courses), goal.trials - search.done)
        trials = search.ask(max(1, at_once))
        variants = [
            _variant(trial.number, base, trial.params) for trial in trials for base in bases
        ]
        flown = runner(variants, goal.attempts, quiet=True)
        for k, trial in enumerate(trials):
            of_trial = slice(k * courses, (k + 1) * courses)
            if any(len(rows) < goal.attempts for rows in flown[of_trial]):
                search.give_up(trial)
                lost += 1
                if lost >= MOST_LOST:
                    raise RunError(f"{lost} trials in a row were lost with their workers")
                continue
            lost = 0
            found = _stats(variants[of_trial], flown[of_trial])
            search.tell(trial, objective(found, goal.floor), _trial_stats(found))
            complain(f"{search.done}/{goal.trials} {summary(found)}")


def _trial_stats(found: Sequence[VariantStats]) -> TrialStats:
    """Return the statistics of a trial over its courses."""
    finishes = all(stats.finished for stats in found)
    return TrialStats(
        lap=geometric_mean(stats.lap_mean for stats in found) if finishes else None,
        finished=sum(stats.finished for stats in found),
        thrust_tv=fmean(stats.thrust_tv for stats in found),
    )


def _expect_no_own_error(variant: Variant, rows: Sequence[AttemptRow]) -> None:
    """Raise RunError if an error of the user's own code has ended an attempt.

    The trial stays open, and the next command flies it again.
    """
    for row in rows:
        if row.outcome == ERROR:
            raise RunError(
                f"{variant.name} seed {row.seed}: an error of your own code ended the flight: "
                f"{row.result['fault']}"
            )


def _finals(search: Search, bases: Sequence[Variant], goal: Goal, runner: Runner) -> list[Finalist]:
    """Fly the search's best on fresh seeds. Return them best first."""
    fresh = [replace(base, spec=replace(base.spec, seed=base.spec.seed + FRESH)) for base in bases]
    best = search.best(FINALISTS)
    variants = [_variant(trial.number, base, trial.parameters) for trial in best for base in fresh]
    flown = runner(variants, REPEAT * goal.attempts)
    names = [base.spec.course.name for base in bases]
    finals = []
    for k, trial in enumerate(best):
        of_trial = slice(k * len(bases), (k + 1) * len(bases))
        if all(flown[of_trial]):
            found = _stats(variants[of_trial], flown[of_trial])
            finals.append(Finalist(dict(zip(names, found, strict=True)), trial.parameters))
    return sorted(finals, key=lambda final: objective(list(final.courses.values()), goal.floor))


def _variant(trial: int, base: Variant, values: Values) -> Variant:
    """Return the variant of a trial: another planner, with the same model of the vehicle."""
    planner = with_parameters(base.spec.planner, values)
    return Variant(f"trial {trial}", replace(base.spec, planner=planner))


def _stats(
    variants: Sequence[Variant], flown: Sequence[Sequence[AttemptRow]]
) -> list[VariantStats]:
    """Return the statistics of a trial on each course.

    Raises:
        RunError: an error of the user's own code has ended an attempt.
    """
    found = []
    for variant, rows in zip(variants, flown, strict=True):
        _expect_no_own_error(variant, rows)
        found.append(variant_stats(variant.name, rows, lap_limit(variant.spec.record())))
    return found


def objective(found: Sequence[VariantStats], floor: float) -> float:
    """Return the objective, which is minimised [s].

    It is the geometric mean over the courses of the mean lap of the attempts that finish, if enough
    of them do. On a course where too few do, each attempt that does not finish counts as the time
    limit.

    Args:
        found: statistics of a trial on each course.
        floor: share of the attempts that must finish.
    """
    return geometric_mean(_mean_lap(stats, floor) for stats in found)


def _mean_lap(stats: VariantStats, floor: float) -> float:
    """Return the mean lap on one course, or the mean with a penalty, see `objective` [s]."""
    enough = stats.finished and stats.finished >= floor * stats.attempts
    return stats.lap_mean if enough else stats.penalised_mean


def pareto_front(trials: Sequence[FlownTrial]) -> list[FlownTrial]:
    """Return the trials with a lap that no other dominates, fastest first.

    Trials are compared in lap time, success and thrust variation.
    """
    with_lap = [trial for trial in trials if trial.stats.lap is not None]
    points = [_point(trial.stats) for trial in with_lap]
    front = [with_lap[i] for i in pareto(points)]
    return sorted(front, key=lambda trial: _point(trial.stats))


def _point(stats: TrialStats) -> tuple[float, ...]:
    """Return the values in which trials are compared; less is better."""
    lap = inf if stats.lap is None else stats.lap
    return lap, -stats.finished, stats.thrust_tv


def pareto(points: Sequence[tuple[float, ...]]) -> list[int]:
    """Return the indices of the points that no other point dominates.

    A point dominates another one if it is nowhere larger and somewhere smaller.
    """

    def dominates(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
        return a != b and all(x <= y for x, y in zip(a, b, strict=True))

    return [
        i for i, point in enumerate(points) if not any(dominates(other, point) for other in points)
    ]


def summary(found: Sequence[VariantStats]) -> str:
    """Return the numbers of a trial on each course in one line."""
    return f"{found[0].name}: " + "; ".join(_summary(stats) for stats in found)


def _summary(stats: VariantStats) -> str:
    """Return the numbers of a trial on one course."""
    low, high = stats.success_ci
    lap = f"lap {stats.lap_mean:.3f} s" if stats.finished else "no lap"
    success = f"{stats.finished}/{stats.attempts} ({100 * low:.0f}-{100 * high:.0f} %)"
    return f"{success}, {lap}, thrust {stats.thrust_tv:.0f} m/s^2/s"
