"""A baseline file: lap times and chatter as they were, and the verdict on those flown now.

    flight: figure8 --laps 1 --randomize 1      # what `race fly` would fly, any flag
    attempts: 20                                # consecutive seeds
    effects: {lap: 0.03, success: 0.2, thrust_tv: 0.25}   # what must not get worse by as much
    stored: ...                                 # written by race regress --regen

A number passes when its worsening is below its effect with 95 % confidence. So a racer that is
worse by the effect fails with probability 95 %, however many attempts; their number decides how
often an unchanged one fails.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan, sqrt
from pathlib import Path
from statistics import fmean, stdev
from typing import Annotated

import yaml
from msgspec import Meta, Struct, to_builtins
from msgspec.structs import replace

from quadsim.files.data_files import read_text
from quadsim.files.strict_yaml import load, unit
from quadsim.record.statistics import false_alarm, proportion_difference, upper_bound

CONFIDENCE = 0.95
Share = Annotated[float, Meta(gt=0, le=10)]


class Effects(Struct, frozen=True):
    """What must be caught."""

    lap: Share = 0.03  # relative
    success: Annotated[float, Meta(gt=0, le=1)] = 0.2  # points of the share that finishes
    thrust_tv: Share = 0.25  # relative


class Stored(Struct, frozen=True):
    """One number an attempt, by seed."""

    commit: str
    cpu: str
    laps: Annotated[
        tuple[Annotated[float, unit("s", gt=0)] | None, ...], Meta(min_length=1)
    ]  # mean [s]; null: none
    thrust_tv: Annotated[
        tuple[Annotated[float, unit("m/s^2/s", ge=0)], ...], Meta(min_length=1)
    ]  # commanded


class Baseline(Struct, frozen=True, kw_only=True):
    """A baseline file."""

    flight: str
    attempts: Annotated[int, Meta(ge=4, le=10_000)] = 20
    effects: Effects = Effects()
    stored: Stored | None = None


@dataclass(frozen=True)
class Verdict:
    """On one number: relative worsening for lap and chatter, points for success; positive is
    worse."""

    name: str  # lap, success, thrust_tv
    stored: float
    now: float
    worse: float
    bound: float  # below this with 95 % confidence; nan: too few attempts
    effect: float
    # how often this many attempts of an unchanged racer on another machine would
    unchanged_fails: float

    @property
    def ok(self) -> bool:
        return self.bound < self.effect


def load_baseline(path: Path) -> Baseline:
    """Raises FileError."""
    return load(read_text(path), str(path), Baseline)


def baseline_text(baseline: Baseline, stored: Stored) -> str:
    """The file with new numbers."""
    values = to_builtins(replace(baseline, stored=stored))
    return yaml.safe_dump(values, default_flow_style=None, sort_keys=False, width=120)


def judge(then: Stored, now: Stored, effects: Effects) -> list[Verdict]:
    """Paired by seed, over the seeds that both have."""
    laps = [
        (a, b) for a, b in zip(then.laps, now.laps, strict=False) if a is not None and b is not None
    ]
    chatter = list(zip(then.thrust_tv, now.thrust_tv, strict=False))
    return [
        _success(then.laps, now.laps, effects.success),
        _relative("lap", laps, effects.lap),
        _relative("thrust_tv", chatter, effects.thrust_tv),
    ]


def _relative(name: str, pairs: Sequence[tuple[float, float]], effect: float) -> Verdict:
    """Relative to the stored mean, so that one unusual seed cannot dominate."""
    a, b = zip(*pairs, strict=True) if pairs else ((), ())
    if len(pairs) < 2 or not any(a):
        return Verdict(name, nan, nan, nan, nan, effect, 1.0)
    differences = [(y - x) / fmean(a) for x, y in pairs]
    sd = sqrt(2) * stdev(a) / fmean(a)  # of a difference, if the seeds shared nothing
    alarm = false_alarm(sd, len(a), effect, CONFIDENCE)
    bound = upper_bound(differences, CONFIDENCE)
    return Verdict(name, fmean(a), fmean(b), fmean(differences), bound, effect, alarm)


def _success(then: Sequence[float | None], now: Sequence[float | None], effect: float) -> Verdict:
    """p_then - p_now. With so few flights that even all of them finishing shows too little, it
    never passes."""
    (k, n), (k0, n0) = ((sum(t is not None for t in laps), len(laps)) for laps in (now, then))
    two_sided = 2 * CONFIDENCE - 1  # its upper limit is the one-sided bound
    bound = proportion_difference(k, n, k0, n0, two_sided)[1]
    best = proportion_difference(k0, n0, k0, n0, two_sided)[1]
    return Verdict("success", k0 / n0, k / n, k0 / n0 - k / n, bound, effect, float(best >= effect))
