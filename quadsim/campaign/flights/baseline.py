"""Baseline files guard lap times: they store results, against which new flights are tested.

    course: figure8
    variant: race+laps=1+randomize=1   # as in --variants: presets, samplers and settings
    attempts: 20                       # consecutive seeds
    effects: {lap: 0.03, success: 0.2, thrust_tv: 0.25}   # worsening to rule out
    stored: ...                        # written by race regress --regen

A number passes if its worsening is below its effect with 95 % confidence. A racer that is worse by
the effect therefore fails with a probability of 95 %, for any number of attempts; the number of
attempts decides how often an unchanged racer fails. If an unchanged racer would always fail, the
verdict is "undecided", and a file with too few attempts for any racer to pass is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, nan, sqrt
from pathlib import Path
from statistics import fmean, stdev
from typing import Annotated, NamedTuple

import yaml
from msgspec import Meta, Struct, to_builtins
from msgspec.structs import replace

from quadsim.campaign.flights.stats import FINISHED
from quadsim.campaign.run.attempt import Flown, result
from quadsim.campaign.run.database import code_of
from quadsim.campaign.run.pool import Pool
from quadsim.campaign.run.runner import PlannedAttempt, Tally, fly_attempts
from quadsim.campaign.run.variants import Variant
from quadsim.config.setting_texts import Settings, parse_parts, resolve
from quadsim.files.data_files import read_text
from quadsim.files.strict_yaml import parse, unit
from quadsim.record.run import ERROR, RunError
from quadsim.statistics import false_alarm, proportion_difference, upper_bound

CONFIDENCE = 0.95
MOST_ATTEMPTS = 10_000
Share = Annotated[float, Meta(gt=0, le=10)]
Lap = Annotated[float, unit("s", gt=0)]
ThrustVariation = Annotated[float, unit("m/s^2/s", ge=0)]


class Effects(Struct, frozen=True):
    """The worsening of each number that a test has to rule out."""

    lap: Share = 0.03  # relative
    success: Annotated[float, Meta(gt=0, le=1)] = 0.2  # points of the share that finishes
    thrust_tv: Share = 0.25  # relative


class StoredNumbers(Struct, frozen=True):
    """The results of a baseline's attempts, one number for each, ordered by seed."""

    commit: str
    cpu: str
    laps: Annotated[tuple[Lap | None, ...], Meta(min_length=1)]  # mean lap; null: not finished
    thrust_tv: Annotated[tuple[ThrustVariation, ...], Meta(min_length=1)]  # commanded


class Baseline(Struct, frozen=True, kw_only=True):
    """A baseline file."""

    course: str
    variant: str
    attempts: Annotated[int, Meta(ge=4, le=MOST_ATTEMPTS)] = 20
    effects: Effects = Effects()
    stored: StoredNumbers | None = None


def load_baseline(path: Path) -> Baseline:
    """Read a baseline file.

    Raises:
        FileError: the file cannot be used, or has too few attempts for its effect on success.
    """
    document = parse(read_text(path), str(path))
    baseline = document.fill(Baseline)
    effect = baseline.effects.success
    needed = attempts_needed(effect)
    if needed is None or baseline.attempts < needed:
        wanted = f"{needed} or more" if needed else f"more than {MOST_ATTEMPTS}"
        problem = (
            f"expected {wanted}, got {baseline.attempts}: with fewer, even flights that all "
            f"finish do not show with 95 % confidence that success is less than "
            f"{100 * effect:.3g} points worse (effects: {{success: {effect:g}}})"
        )
        raise document.error("attempts", problem)
    return baseline


def attempts_needed(effect: float, share: float = 1.0) -> int | None:
    """Return the fewest attempts with which an unchanged racer passes the test of success.

    Args:
        effect: worsening of the share that finishes, which is to be ruled out.
        share: share of the attempts that finish, in the stored and in the new flights.

    Returns:
        The number; None: more than a baseline may have.
    """

    def passes(attempts: int) -> bool:
        finished = round(share * attempts)
        return _success_bound(finished, attempts, finished, attempts) < effect

    return next(filter(passes, range(1, MOST_ATTEMPTS + 1)), None)


def _success_bound(finished_now: int, now: int, finished_then: int, then: int) -> float:
    """Return the upper 95 % bound of the decrease of the share that finishes."""
    # The upper limit of a two-sided interval is the one-sided bound of another confidence.
    two_sided = 2 * CONFIDENCE - 1
    return proportion_difference(finished_now, now, finished_then, then, two_sided)[1]


def baseline_text(baseline: Baseline, stored: StoredNumbers) -> str:
    """Return the text of a baseline file with new numbers."""
    values = to_builtins(replace(baseline, stored=stored))
    return yaml.safe_dump(values, default_flow_style=None, sort_keys=False, width=120)


def baseline_variant(name: str, baseline: Baseline, settings: Settings) -> Variant:
    """Return the variant that a baseline flies.

    Args:
        name: name of the variant.
        baseline: baseline with the course and the variant to fly.
        settings: settings that replace those of the variant.

    Raises:
        SettingError: a setting is invalid.
        FileError: a course, a vehicle or a preset cannot be read.
        ValueError: course, laps and vehicle do not fit together.
    """
    own = parse_parts(baseline.variant)
    return Variant(name, resolve(baseline.course, own | dict(settings)))


def fly_baselines(
    pool: Pool, variants: Sequence[Variant], attempts: Sequence[int]
) -> list[StoredNumbers]:
    """Fly every attempt of every variant, and return the results.

    Args:
        pool: pool that flies the attempts.
        variants: variants of the baselines.
        attempts: the number of attempts of each variant.

    Raises:
        RunError: an attempt was lost twice with its worker, or an error of the user's own code
            ended it.
    """
    wanted = [
        [PlannedAttempt(variant, spec) for spec in variant.attempts(number)]
        for variant, number in zip(variants, attempts, strict=True)
    ]
    todo = [attempt for of_variant in wanted for attempt in of_variant]
    with Tally(len(todo)) as tally:
        flown = {id(spec): flight for _, spec, flight in fly_attempts(pool, todo, tally)}
    lost = len(todo) - len(flown)
    if lost:
        raise RunError(f"{lost} of {len(todo)} attempts were lost with their workers")
    for variant, spec in todo:
        run = flown[id(spec)].run
        if run.outcome == ERROR:
            label = f"{variant.course} {variant.name} seed {spec.seed}"
            raise RunError(f"{label}: an error of your own code ended the flight: {run.fault}")
    return [_stored([flown[id(spec)] for _, spec in of_variant]) for of_variant in wanted]


def _stored(flights: Sequence[Flown]) -> StoredNumbers:
    """Return the numbers of these attempts, lap times to a tenth of a millisecond."""
    results = [result(flight) for flight in flights]
    return StoredNumbers(
        commit=code_of(flights[0].provenance),
        cpu=flights[0].provenance["cpu"],
        laps=tuple(_lap(flight) for flight in flights),
        thrust_tv=tuple(round(r["thrust_tv"]["commanded"], 2) for r in results),
    )


def _lap(flight: Flown) -> float | None:
    finished = flight.run.outcome == FINISHED
    return round(fmean(flight.run.laps), 4) if finished else None


@dataclass(frozen=True)
class Verdict:
    """The verdict on one number.

    `worse` is relative for lap and thrust_tv, and points for success; positive is worse.
    """

    name: str  # lap, success, thrust_tv
    stored: float
    now: float
    worse: float
    bound: float  # `worse` is below this with 95 % confidence; nan: too few attempts
    effect: float
    # Greatest probability that an unchanged racer on another machine fails.
    unchanged_fails: float
    undecided: str = ""  # why these flights cannot tell, and what is needed; "": they can

    @property
    def ok(self) -> bool:
        """Return whether the number passes."""
        return self.bound < self.effect


def judge(then: StoredNumbers, now: StoredNumbers, effects: Effects) -> list[Verdict]:
    """Return the verdicts on success, lap and thrust variation.

    Laps and thrust variation are paired by seed, over the seeds that both have.
    """
    laps = [
        (before, after)
        for before, after in zip(then.laps, now.laps, strict=False)
        if before is not None and after is not None
    ]
    chatter = list(zip(then.thrust_tv, now.thrust_tv, strict=False))
    return [
        _success(then.laps, now.laps, effects.success),
        _relative("lap", laps, effects.lap),
        _relative("thrust_tv", chatter, effects.thrust_tv),
    ]


class WorstSeed(NamedTuple):
    """The attempt that has become worst, with its mean laps [s]; None for one without a finish."""

    number: int  # of the attempt, from 0
    then: float | None
    now: float | None


def worst_seed(then: StoredNumbers, now: StoredNumbers) -> WorstSeed | None:
    """Return the attempt that has become worst; None if no attempt has finished then.

    An attempt that does not finish any more is worse than one that is slower.
    """
    pairs = zip(then.laps, now.laps, strict=False)
    both = [WorstSeed(k, before, after) for k, (before, after) in enumerate(pairs)]
    finished = [one for one in both if one.then is not None]
    return max(finished, key=_lost_time, default=None)


def _lost_time(pair: WorstSeed) -> float:
    """Return by how much an attempt is slower [s], inf if it does not finish any more."""
    return inf if pair.now is None else pair.now - (pair.then or 0.0)


def _relative(name: str, pairs: Sequence[tuple[float, float]], effect: float) -> Verdict:
    """Judge a number relative to its stored mean, so that no unusual seed can dominate."""
    before = [then for then, _ in pairs]
    after = [now for _, now in pairs]
    if len(pairs) < 2 or not any(before):
        return _unknown(name, pairs, effect)
    mean = fmean(before)
    differences = [(now - then) / mean for then, now in pairs]
    # The standard deviation of a difference, if the seeds shared nothing.
    sd = sqrt(2) * stdev(before) / mean
    return Verdict(
        name,
        stored=mean,
        now=fmean(after),
        worse=fmean(differences),
        bound=upper_bound(differences, CONFIDENCE),
        effect=effect,
        unchanged_fails=false_alarm(sd, len(pairs), effect, CONFIDENCE),
    )


def _unknown(name: str, pairs: Sequence[tuple[float, float]], effect: float) -> Verdict:
    """Return the verdict on a number without a stored mean to compare with."""
    if len(pairs) < 2:
        why = f"2 seeds that finished then and now are needed, got {len(pairs)}"
        return Verdict(name, nan, nan, nan, nan, effect, unchanged_fails=1.0, undecided=why)
    now = fmean(after for _, after in pairs)
    # All stored values are 0: no change, or one without a limit.
    worse = inf if now else 0.0
    return Verdict(name, 0.0, now, worse, worse, effect, unchanged_fails=1.0)


def _success(then: Sequence[float | None], now: Sequence[float | None], effect: float) -> Verdict:
    """Judge the share that finishes.

    The verdict is "undecided" if an unchanged racer could not pass either and the observed
    decrease is below the effect.
    """
    finished_then = sum(lap is not None for lap in then)
    finished_now = sum(lap is not None for lap in now)
    bound = _success_bound(finished_now, len(now), finished_then, len(then))
    stored = finished_then / len(then)
    share = finished_now / len(now)
    unchanged = _success_bound(round(stored * len(now)), len(now), finished_then, len(then))
    cannot_pass = unchanged >= effect
    is_undecided = cannot_pass and bound >= effect and stored - share < effect
    return Verdict(
        "success",
        stored=stored,
        now=share,
        worse=stored - share,
        bound=bound,
        effect=effect,
        unchanged_fails=float(cannot_pass),
        undecided=_why_undecided(len(then), len(now), stored, effect) if is_undecided else "",
    )


def _why_undecided(then: int, now: int, share: float, effect: float) -> str:
    """Return why the test of success is undecided, and how many attempts it needs.

    Args:
        then: the number of stored attempts.
        now: the number of new attempts.
        share: share of the stored attempts that finished.
        effect: worsening to rule out.
    """
    needed = attempts_needed(effect, share)
    wanted = f"{needed} attempts" if needed else "a larger effect"
    return (
        f"{wanted} needed, got {then} stored and {now} now: where {100 * share:.0f} % finish, "
        f"fewer do not rule out a success that is {100 * effect:.3g} points worse"
    )
