"""Summary statistics of attempts: of one variant, and of two variants against each other.

Lap times are conditional on finishing, so they always stand beside the numbers of attempts and of
those that finished.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import nan
from pathlib import Path
from statistics import fmean, median
from typing import Literal

from quadsim.campaign.store import Row
from quadsim.course import Course
from quadsim.record.limits import LIMITS, limit_of
from quadsim.record.statistics import (
    Mean,
    detectable,
    fisher,
    mcnemar,
    mean_interval,
    ratio_interval,
    wilson,
)

FINISHED = "finished"


@dataclass(frozen=True)
class VariantStats:
    """One variant on one course. Seconds, m/s^2/s, ms; lap: an attempt's mean lap; nan: not
    known."""

    course: str
    name: str
    attempts: int
    finished: int
    success_ci: tuple[float, float]
    lap_mean: float
    lap_sd: float
    lap_min: float  # the fastest single lap
    race_median: float  # all laps from the standing start
    flying_median: float  # all laps but the first
    above_limit: float  # of race_median, over the best known limit of the race, a share
    penalised_mean: float  # lap_mean with the time limit's lap for each attempt that did not finish
    cost: Mean  # accumulated, of those that finished: a double integrator's; nan for other systems
    thrust_tv: float  # commanded, mean of all attempts
    thrust_tv_delivered: float
    # of the commanded body rates [rad/s^2], mean of all attempts; nan: an older campaign's
    rates_tv: float
    turned_back: int | None  # attempts that overshot a gate and returned; None: not known
    plan_ms: float  # median of the attempts' medians
    crashes: dict[str, int]  # "gate 3", "ground", "bounds", "planner", "timeout"
    commits: tuple[str, ...]  # that flew them


@dataclass(frozen=True)
class PairStats:
    """b against a on one course; differences are b - a."""

    course: str
    a: str
    b: str
    lap_difference: Mean  # over the seeds that both finish [s]
    detectable: float  # true difference that so many pairs detect with power 80 % [s]
    only_a: int  # seeds that only a finished
    only_b: int
    success_p: float  # McNemar's exact p over the shared seeds, Fisher's where there are none
    thrust_tv_ratio: Mean  # b / a, the geometric mean over the shared seeds and its interval
    seeds: int  # that both flew


@dataclass(frozen=True)
class Section:
    """All variants of one course."""

    course: Course
    setting: str
    limit: float  # [s] a lap
    variants: list[VariantStats]
    pairs: list[PairStats]
    rows: list[Sequence[Row]]  # of each variant
    home: Path  # folder that their telemetry is relative to


def variant_stats(
    name: str, rows: Sequence[Row], limit: float, best_known: float = nan
) -> VariantStats:
    """limit: time limit of the flight for each lap [s]; every variant of a comparison has the same.

    best_known: see `best_known_time`.
    """
    done = [r for r in rows if r.outcome == FINISHED]
    laps = [mean_lap(r) for r in done]
    lap, races = mean_interval(laps), _median([sum(r.result["laps"]) for r in done])
    return VariantStats(
        course=rows[0].course,
        name=name,
        attempts=len(rows),
        finished=len(done),
        success_ci=wilson(len(done), len(rows)),
        lap_mean=lap.mean,
        lap_sd=lap.sd,
        lap_min=min((t for r in done for t in r.result["laps"]), default=nan),
        race_median=races,
        above_limit=races / best_known - 1.0,
        flying_median=_median(
            [fmean(r.result["laps"][1:]) for r in done if len(r.result["laps"]) > 1]
        ),
        penalised_mean=fmean([*laps, *[limit] * (len(rows) - len(done))]),
        cost=mean_interval([cost for r in done if (cost := r.result.get("cost")) is not None]),
        thrust_tv=fmean(thrust_tv(r) for r in rows),
        thrust_tv_delivered=fmean(thrust_tv(r, "delivered") for r in rows),
        rates_tv=fmean(tv["commanded"] if (tv := r.result.get("rates_tv")) else nan for r in rows),
        turned_back=_turned_back(rows),
        plan_ms=median(r.result["plan_ms"]["p50"] for r in rows),
        crashes=dict(
            Counter(_where_it_ended(r) for r in rows if r.outcome != FINISHED).most_common()
        ),
        commits=tuple(sorted({r.code for r in rows})),
    )


def pair_stats(a: str, b: str, rows_a: Sequence[Row], rows_b: Sequence[Row]) -> PairStats:
    of_a, of_b = ({r.seed: r for r in rows} for rows in (rows_a, rows_b))
    pairs = [(of_a[seed], of_b[seed]) for seed in of_a if seed in of_b]
    laps = mean_interval(
        [mean_lap(y) - mean_lap(x) for x, y in pairs if x.outcome == y.outcome == FINISHED]
    )
    only_a = sum(x.outcome == FINISHED != y.outcome for x, y in pairs)
    only_b = sum(y.outcome == FINISHED != x.outcome for x, y in pairs)
    k_a, k_b = (sum(r.outcome == FINISHED for r in rows) for rows in (rows_a, rows_b))
    return PairStats(
        course=rows_a[0].course,
        a=a,
        b=b,
        lap_difference=laps,
        detectable=detectable(laps.sd, laps.n),
        only_a=only_a,
        only_b=only_b,
        success_p=mcnemar(only_a, only_b) if pairs else fisher(k_a, len(rows_a), k_b, len(rows_b)),
        thrust_tv_ratio=ratio_interval([(thrust_tv(x), thrust_tv(y)) for x, y in pairs]),
        seeds=len(pairs),
    )


def all_pairs(names: Sequence[str], rows: Sequence[Sequence[Row]]) -> list[PairStats]:
    """Every two variants of one course."""
    variants = zip(names, rows, strict=True)
    return [pair_stats(a, b, x, y) for (a, x), (b, y) in combinations(variants, 2) if x and y]


def mean_lap(row: Row) -> float:
    """[s]; nan for a flight without laps."""
    return fmean(row.result["laps"] or [nan])


def thrust_tv(row: Row, of: Literal["commanded", "delivered"] = "commanded") -> float:
    """[m/s^2/s]; nan for a system without thrust. of: commanded, delivered"""
    return row.result["thrust_tv"][of] if row.result["thrust_tv"] else nan


def lap_limit(spec: dict) -> float:
    """What a flight that does not finish counts as, a lap [s]; spec: the record of one."""
    return spec["timeout"] / (spec.get("laps") or 1)


def best_known_time(spec: dict) -> float:
    """The best known limit of a race from the record of one flight, of its nominal vehicle [s];
    nan: not known."""
    limit = limit_of(spec, Path("runs") / LIMITS)
    return limit.time if limit else nan


def _where_it_ended(row: Row) -> str:
    crash = row.result["crash"]
    if crash is None:
        return row.outcome
    if obstacle := crash.get("obstacle"):
        return f"obstacle {obstacle}"
    return f"gate {crash['gate']}" if crash["gate"] else crash["kind"]


def _turned_back(rows: Sequence[Row]) -> int | None:
    known = [turns for r in rows if (turns := r.result.get("turned_back")) is not None]
    return sum(1 for turns in known if turns) if len(known) == len(rows) else None


def _median(values: Sequence[float]) -> float:
    return median(values) if values else nan
