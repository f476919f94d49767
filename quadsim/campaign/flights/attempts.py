"""The flights of a comparison one by one, as records."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from quadsim.campaign.flights.stats import FINISHED, Section, mean_lap, where_it_ended
from quadsim.campaign.run.store import AttemptRow


@dataclass(frozen=True)
class Attempt:
    """One flight of a comparison; a number that is not known is None.

    Attributes:
        course: name of the course.
        variant: name of the variant.
        seed: attempts of one seed have the same vehicle, start and wind.
        outcome: finished, crashed, stuck, timeout, interrupted, or error: an error of your own code
            ended it.
        ended_at: where a flight that did not finish ended: "gate 3", "obstacle 1", "ground",
            "bounds", "planner", or its outcome; "" for one that finished.
        laps: times of the completed laps [s].
        lap_mean: mean of these [s]; None without a completed lap.
        race_time: all laps from the standing start [s]; None if the race was not finished.
        thrust_tv: chatter of the commanded thrust: its total variation per second [m/s^2/s].
        thrust_tv_delivered: the same of the delivered thrust [m/s^2/s].
        rates_tv: the same of the commanded body rates [rad/s^2].
        motor_variation: total variation of the firmware's motor commands per second [1/s]; None
            without a firmware.
        thrust_lost: mean thrust that was commanded and not given because a motor was at its
            greatest command [m/s^2]; None without a firmware.
        turned_back: how often the vehicle overshot a gate and returned to it.
        plan_ms: median of the planning times, wall clock [ms].
        commit: the commit that flew the attempt.
        folder: the run's folder, which `quadsim.load_run` reads; None if it is not kept. Without
            a campaign it exists as long as the comparison.
        fault: the error that ended the flight: class, message, file, line; None without an error.

    Examples:
        >>> import quadsim
        >>> two = {"attempts": 2, "laps": 1, "samples": 256}
        >>> comparison = quadsim.compare("figure8", ("gaussian", "colored"), **two)
        >>> [(attempt.variant, attempt.seed) for attempt in comparison.attempts]
        [('gaussian', 0), ('gaussian', 1), ('colored', 0), ('colored', 1)]
    """

    course: str
    variant: str
    seed: int
    outcome: str
    ended_at: str
    laps: tuple[float, ...]
    lap_mean: float | None
    race_time: float | None
    thrust_tv: float
    thrust_tv_delivered: float
    rates_tv: float
    motor_variation: float | None
    thrust_lost: float | None
    turned_back: int
    plan_ms: float
    commit: str
    folder: Path | None
    fault: str | None = None


def attempts_of(section: Section) -> Iterator[Attempt]:
    """Yield the flights on one course, one variant after the other, each by seed."""
    for variant, rows in zip(section.variants, section.rows, strict=True):
        for row in sorted(rows, key=lambda row: row.seed):
            yield _attempt(row, variant.name, section.home)


def _attempt(row: AttemptRow, variant: str, home: Path) -> Attempt:
    """Return one flight; home: the folder that the paths of telemetry are relative to."""
    result = row.result
    laps = tuple(result["laps"])
    motors = result["motors"]
    finished = row.outcome == FINISHED
    return Attempt(
        course=row.course,
        variant=variant,
        seed=row.seed,
        outcome=row.outcome,
        ended_at="" if finished else where_it_ended(row),
        laps=laps,
        lap_mean=mean_lap(row) if laps else None,
        race_time=sum(laps) if finished else None,
        thrust_tv=result["thrust_tv"]["commanded"],
        thrust_tv_delivered=result["thrust_tv"]["delivered"],
        rates_tv=result["rates_tv"]["commanded"],
        motor_variation=motors["variation"] if motors else None,
        thrust_lost=motors["thrust_lost"] if motors else None,
        turned_back=len(result["turned_back"]),
        plan_ms=result["plan_ms"]["p50"],
        commit=row.code,
        folder=home / row.folder if row.folder else None,
        fault=result["fault"],
    )
