"""The main numbers of a run, as one record."""

from __future__ import annotations

from dataclasses import dataclass

from quadsim.limit.limits import StoredSolution
from quadsim.record.run import RecordedRun
from quadsim.report.estimate_metrics import sensing_numbers
from quadsim.report.metrics import (
    commanded_rates,
    delivered_rates,
    motor_use,
    path_length,
    speed,
    splits,
    total_variation,
)


@dataclass(frozen=True)
class RunMetrics:
    """The numbers of one run; None if a number is not known.

    Attributes:
        laps: times of the completed laps, penalties included [s].
        penalties: the part of each completed lap's time that was added for hits [s].
        splits: flown times from gate to gate [s], one tuple for each lap; the last lap may be
            unfinished.
        best_lap: time of the fastest completed lap [s]; None if there is none.
        race_time: time of all laps from the standing start [s]; None if the race was not finished.
        limit: the best known limit of the race [s]; None if none is known.
        above_limit: excess of the race time over the limit, as a share of the limit.
        top_speed: largest speed [m/s].
        mean_speed: path length divided by the time of flight [m/s].
        path_length: length of the flown path [m].
        thrust_tv: total variation of the commanded thrust per second, a measure of chatter
            [m/s^2/s].
        thrust_tv_delivered: total variation of the delivered thrust per second [m/s^2/s].
        rates_tv: total variation of the commanded body rates per second, summed over roll, pitch
            and yaw [rad/s^2].
        rates_tv_delivered: total variation of the delivered body rates per second [rad/s^2].
        motor_variation: total variation of the firmware's motor commands per second, averaged over
            the motors; a command is 1 at the largest speed [1/s]. None without a firmware.
        thrust_lost: mean of the commanded thrust that was not delivered because a motor was at its
            largest command, mass-normalised [m/s^2]; None without a firmware.
        plan_ms_p50: median of the planning times on the wall clock [ms].
        plan_ms_p95: 95th percentile of the planning times on the wall clock [ms].
        nees: mean normalised estimation error squared, 9 for a consistent estimate; None if the
            planner was given the true state.
        position_rms: RMS distance from the estimated to the true position [m]; None like nees.

    Examples:
        >>> import quadsim
        >>> metrics = quadsim.fly("figure8", laps=1, samples=256).metrics
        >>> metrics.best_lap == metrics.race_time  # of one lap [s]
        True
        >>> len(metrics.splits[0])
        8
    """

    laps: tuple[float, ...]
    penalties: tuple[float, ...]
    splits: tuple[tuple[float, ...], ...]
    best_lap: float | None
    race_time: float | None
    limit: float | None
    above_limit: float | None
    top_speed: float
    mean_speed: float
    path_length: float
    thrust_tv: float
    thrust_tv_delivered: float
    rates_tv: float
    rates_tv_delivered: float
    motor_variation: float | None
    thrust_lost: float | None
    plan_ms_p50: float
    plan_ms_p95: float
    nees: float | None
    position_rms: float | None


def run_metrics(run: RecordedRun, limit: StoredSolution | None) -> RunMetrics:
    """Return the numbers of a run.

    Args:
        run: the run.
        limit: the best known limit of the run's race.
    """
    x = run.telemetry
    length = path_length(run)
    flown = float(x["t"][-1] - x["t"][0]) if len(x["t"]) else 0.0
    finished = run.outcome == "finished"
    sensing = sensing_numbers(run)
    plan_ms = run.wall["plan_ms"]
    motors = motor_use(run)
    return RunMetrics(
        laps=tuple(run.laps),
        penalties=tuple(run.penalties),
        splits=tuple(map(tuple, splits(run))),
        best_lap=min(run.laps, default=None),
        race_time=sum(run.laps) if finished else None,
        limit=limit.time if limit else None,
        above_limit=limit.above(run.duration) if limit and finished else None,
        top_speed=float(speed(run).max(initial=0.0)),
        mean_speed=length / flown if flown > 0.0 else 0.0,
        path_length=length,
        thrust_tv=total_variation(x["t"], x["a_cmd"]),
        thrust_tv_delivered=total_variation(x["t"], x["a"]),
        rates_tv=total_variation(x["t"], commanded_rates(run)),
        rates_tv_delivered=total_variation(x["t"], delivered_rates(run)),
        motor_variation=motors.motor_variation if motors else None,
        thrust_lost=motors.thrust_lost if motors else None,
        plan_ms_p50=plan_ms["p50"],
        plan_ms_p95=plan_ms["p95"],
        nees=sensing["nees"] if sensing else None,
        position_rms=sensing["position_rms"] if sensing else None,
    )
