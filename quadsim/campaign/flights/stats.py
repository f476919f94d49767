"""Summary statistics of one variant's attempts, and of two variants against each other.

Lap times are those of attempts that finish, so they always stand beside the number of attempts and
the number that finished.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from math import nan
from pathlib import Path
from statistics import fmean, median

from quadsim.campaign.run.store import AttemptRow
from quadsim.course import Course
from quadsim.limit.limits import limit_of, limits_folder
from quadsim.statistics import (
    Mean,
    detectable,
    fisher,
    holm,
    mcnemar,
    mean_interval,
    p_of_mean,
    p_of_ratio,
    ratio_interval,
    wilson,
)

FINISHED = "finished"
CRASHED = "crashed"
# Two pairs have an interval of twelve standard deviations and more: it says nothing.
FEWEST_PAIRS = 3


@dataclass(frozen=True)
class CrashRate:
    """Crashes per 100 gates: of the gates that flights came to, how many ended a flight?

    A flight that crashes has come to one gate more than it has passed. The interval is Wilson's
    for independent gates; nan without gates.

    Examples:
        >>> import quadsim
        >>> two = {"attempts": 2, "laps": 1, "samples": 256}
        >>> (variant,) = quadsim.compare("figure8", ("colored",), **two).variants
        >>> rate = variant.crash_rate
        >>> rate.crashes, rate.passed, rate.per_100
        (0, 16, 0.0)
    """

    crashes: int
    passed: int  # gates
    per_100: float
    low: float
    high: float


@dataclass(frozen=True)
class VariantStats:
    """The numbers of one variant on one course; a number that is not known is nan.

    A lap is an attempt's mean lap.

    Examples:
        >>> import quadsim
        >>> two = {"attempts": 2, "laps": 1, "samples": 256}
        >>> comparison = quadsim.compare("figure8", ("gaussian", "colored"), **two)
        >>> gaussian, colored = comparison.variants
        >>> gaussian.finished, gaussian.attempts
        (2, 2)
    """

    course: str
    name: str
    attempts: int
    finished: int
    success_ci: tuple[float, float]
    crash_rate: CrashRate
    lap_mean: float  # [s], as all times but the planner's
    lap_sd: float
    lap_min: float  # the fastest single lap
    race_median: float  # all laps from the standing start
    flying_median: float  # all laps but the first
    above_limit: float  # of race_median, over the best known limit of the race, a share
    penalised_mean: float  # lap_mean with the time limit's lap for each attempt that did not finish
    thrust_tv: float  # [m/s^2/s] commanded, mean of all attempts
    thrust_tv_delivered: float  # [m/s^2/s]
    rates_tv: float  # [rad/s^2] commanded body rates, mean of all attempts
    motor_variation: Mean  # [1/s] of the firmware's motor commands; nan without a firmware
    thrust_lost: Mean  # [m/s^2] commanded and not given at full motors; nan without a firmware
    turned_back: int  # attempts that overshot a gate and returned
    plan_ms: float  # [ms] median of the attempts' medians
    crashes: dict[str, int]  # "gate 3", "ground", "bounds", "planner", "timeout", "error"
    commits: tuple[str, ...]  # that flew them
    # error that ended flights, on one line -> their seeds
    faults: dict[str, list[int]] = field(default_factory=dict)


@dataclass(frozen=True)
class CorrectedP:
    """p-values of a variant against the baseline, each corrected for the number of variants."""

    laps: float
    success: float
    thrust_tv: float


@dataclass(frozen=True)
class PairStats:
    """The numbers of variant b against variant a on one course; differences are b - a.

    p-values of fewer than three pairs are nan.

    Examples:
        >>> import quadsim
        >>> two = {"attempts": 2, "laps": 1, "samples": 256}
        >>> (pair,) = quadsim.compare("figure8", ("gaussian", "colored"), **two).pairs
        >>> pair.lap_difference.n
        2
    """

    course: str
    a: str
    b: str
    lap_difference: Mean  # [s] over the seeds that both finish
    detectable: float  # [s] true difference that these pairs detect with a power of 80 %
    only_a: int  # seeds that only a finished
    only_b: int
    success_p: float  # McNemar's exact p over the shared seeds, Fisher's where there are none
    # b / a, the geometric mean over the shared seeds and its interval; its `sd` is the standard
    # deviation of the logarithms of the ratios
    thrust_tv_ratio: Mean
    seeds: int  # that both flew
    lap_p: float  # of the paired t-test that the laps are equally long
    thrust_tv_p: float  # of the paired t-test that the ratio is 1
    corrected: CorrectedP | None = None  # where a is the baseline of several variants


@dataclass(frozen=True)
class Section:
    """A section holds the results of all variants on one course."""

    course: Course
    setting: str  # laps, vehicle, seeds and randomization, for people
    limit: float  # [s] a lap
    variants: list[VariantStats]
    pairs: list[PairStats]
    rows: list[Sequence[AttemptRow]]  # of each variant
    home: Path  # folder that their telemetry is relative to
    remark: str = ""  # what the seeds do not draw, for people
    conditions: tuple[str, ...] = ()  # the links, and the states that were given, for people
    baseline: str | None = None  # variant that the others are compared with; None: all pairs

    @property
    def reference(self) -> str:
        """The variant against which differences are drawn: the baseline, or the first."""
        return self.baseline or self.variants[0].name


def variant_stats(
    name: str, rows: Sequence[AttemptRow], limit: float, best_known: float = nan
) -> VariantStats:
    """Return the numbers of one variant.

    Args:
        name: name of the variant.
        rows: its attempts, at least one.
        limit: time limit of the flight for each lap [s]; the same for all variants of a comparison.
        best_known: limit of the race [s], see `best_known_time`.
    """
    done = [r for r in rows if _finished(r)]
    laps = [mean_lap(r) for r in done]
    lap = mean_interval(laps)
    race_median = _median([sum(r.result["laps"]) for r in done])
    flying = [r.result["laps"][1:] for r in done if len(r.result["laps"]) > 1]
    motors = [row.result["motors"] for row in rows if row.result["motors"]]
    ends = Counter(where_it_ended(r) for r in rows if not _finished(r))
    return VariantStats(
        course=rows[0].course,
        name=name,
        attempts=len(rows),
        finished=len(done),
        success_ci=wilson(len(done), len(rows)),
        crash_rate=_crash_rate(rows),
        lap_mean=lap.mean,
        lap_sd=lap.sd,
        lap_min=min((t for r in done for t in r.result["laps"]), default=nan),
        race_median=race_median,
        flying_median=_median([fmean(of_flight) for of_flight in flying]),
        above_limit=race_median / best_known - 1.0,
        penalised_mean=fmean([*laps, *[limit] * (len(rows) - len(done))]),
        thrust_tv=fmean(commanded_tv(r) for r in rows),
        thrust_tv_delivered=fmean(r.result["thrust_tv"]["delivered"] for r in rows),
        rates_tv=fmean(r.result["rates_tv"]["commanded"] for r in rows),
        motor_variation=mean_interval([m["variation"] for m in motors]),
        thrust_lost=mean_interval([m["thrust_lost"] for m in motors]),
        turned_back=sum(1 for r in rows if r.result["turned_back"]),
        plan_ms=median(r.result["plan_ms"]["p50"] for r in rows),
        crashes=dict(ends.most_common()),
        commits=tuple(sorted({r.code for r in rows})),
        faults=_faults(rows),
    )


def pair_stats(
    a: str, b: str, rows_a: Sequence[AttemptRow], rows_b: Sequence[AttemptRow]
) -> PairStats:
    """Return the numbers of variant b against variant a, paired by seed.

    Args:
        a: name of the first variant.
        b: name of the second variant.
        rows_a: attempts of the first variant, at least one.
        rows_b: attempts of the second variant, at least one.
    """
    of_a = {r.seed: r for r in rows_a}
    of_b = {r.seed: r for r in rows_b}
    pairs = [(of_a[seed], of_b[seed]) for seed in of_a if seed in of_b]

    both = [(x, y) for x, y in pairs if _finished(x) and _finished(y)]
    laps = mean_interval([mean_lap(y) - mean_lap(x) for x, y in both])
    only_a = sum(_finished(x) and not _finished(y) for x, y in pairs)
    only_b = sum(_finished(y) and not _finished(x) for x, y in pairs)
    if pairs:
        success_p = mcnemar(only_a, only_b)
    else:
        success_p = fisher(
            sum(map(_finished, rows_a)), len(rows_a), sum(map(_finished, rows_b)), len(rows_b)
        )
    ratio = ratio_interval([(commanded_tv(x), commanded_tv(y)) for x, y in pairs])
    return PairStats(
        course=rows_a[0].course,
        a=a,
        b=b,
        lap_difference=laps,
        detectable=detectable(laps.sd, laps.n),
        only_a=only_a,
        only_b=only_b,
        success_p=success_p,
        thrust_tv_ratio=ratio,
        seeds=len(pairs),
        lap_p=p_of_mean(laps) if laps.n >= FEWEST_PAIRS else nan,
        thrust_tv_p=p_of_ratio(ratio) if ratio.n >= FEWEST_PAIRS else nan,
    )


def all_pairs(names: Sequence[str], rows: Sequence[Sequence[AttemptRow]]) -> list[PairStats]:
    """Return the numbers of every two variants of one course.

    Args:
        names: names of the variants.
        rows: the attempts of each variant; variants without attempts are left out.
    """
    flown = [(name, of_variant) for name, of_variant in zip(names, rows, strict=True) if of_variant]
    return [pair_stats(a, b, rows_a, rows_b) for (a, rows_a), (b, rows_b) in combinations(flown, 2)]


def against(
    baseline: str, names: Sequence[str], rows: Sequence[Sequence[AttemptRow]]
) -> list[PairStats]:
    """Return the numbers of each other variant of one course against the baseline.

    The p-values of each measure are also corrected for the number of variants, by Holm's method.

    Args:
        baseline: name of the baseline.
        names: names of the variants.
        rows: the attempts of each variant; variants without attempts are left out. Without
            attempts of the baseline the result is empty.
    """
    flown = {name: of for name, of in zip(names, rows, strict=True) if of}
    if baseline not in flown:
        return []
    of_baseline = flown.pop(baseline)
    pairs = [pair_stats(baseline, name, of_baseline, of) for name, of in flown.items()]
    laps = holm([pair.lap_p for pair in pairs])
    success = holm([pair.success_p for pair in pairs])
    thrust_tv = holm([pair.thrust_tv_p for pair in pairs])
    corrected = map(CorrectedP, laps, success, thrust_tv)
    return [replace(pair, corrected=each) for pair, each in zip(pairs, corrected, strict=True)]


def _crash_rate(rows: Sequence[AttemptRow]) -> CrashRate:
    """Return the crashes of attempts per 100 gates."""
    crashes = sum(row.outcome == CRASHED for row in rows)
    passed = sum(row.result["gates_passed"] for row in rows)
    reached = passed + crashes
    if not reached:
        return CrashRate(crashes, passed, nan, nan, nan)
    low, high = wilson(crashes, reached)
    return CrashRate(crashes, passed, 100.0 * crashes / reached, 100.0 * low, 100.0 * high)


def _finished(row: AttemptRow) -> bool:
    return row.outcome == FINISHED


def mean_lap(row: AttemptRow) -> float:
    """Return the mean lap of an attempt [s]; nan for a flight without laps."""
    return fmean(row.result["laps"] or [nan])


def commanded_tv(row: AttemptRow) -> float:
    """Return the total variation of the commanded thrust of an attempt [m/s^2/s]."""
    return row.result["thrust_tv"]["commanded"]


def lap_limit(spec: dict) -> float:
    """Return the lap time [s] that stands for a flight without a finish, from a Spec's record."""
    return spec["timeout"] / spec["laps"]


def best_known_time(spec: dict, runs_dir: str | Path) -> float:
    """Return the best known limit of a race [s], nan if none is known.

    It is the limit of the nominal vehicle.

    Args:
        spec: record of a Spec.
        runs_dir: folder of runs; solutions are looked for there, beside those of the project.
    """
    limit = limit_of(spec, limits_folder(runs_dir))
    return limit.time if limit else nan


def where_it_ended(row: AttemptRow) -> str:
    """Return the place of a crash, or the outcome of a flight that did not crash."""
    crash = row.result["crash"]
    if crash is None:
        return row.outcome
    if crash["obstacle"]:
        return f"obstacle {crash['obstacle']}"
    return f"gate {crash['gate']}" if crash["gate"] else crash["kind"]


def _faults(rows: Sequence[AttemptRow]) -> dict[str, list[int]]:
    """Return the seeds of each error that ended flights."""
    found: dict[str, list[int]] = {}
    for row in sorted(rows, key=lambda row: row.seed):
        fault = row.result["fault"]
        if fault is not None:
            found.setdefault(fault, []).append(row.seed)
    return found


def _median(values: Sequence[float]) -> float:
    return median(values) if values else nan
