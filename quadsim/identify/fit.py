"""The fit of a vehicle to logs: delays first, then all numbers together, then the rate loop."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import hypot, inf

import numpy as np

from quadsim.files.values import SettingError
from quadsim.identify.budget import liveliest
from quadsim.identify.delays import spins_other_way
from quadsim.identify.geometry import Geometry
from quadsim.identify.gyro import gyro_errors
from quadsim.identify.intervals import covariances
from quadsim.identify.numbers import FitNumbers
from quadsim.identify.plausible import expect_answers, expect_inertia, expect_plausible
from quadsim.identify.prediction import Prediction, predictions
from quadsim.identify.prepared import (
    Prepared,
    drive_of,
    prepare,
    reference_voltage,
)
from quadsim.identify.prior import prior_of
from quadsim.identify.rate_loop import LAGS, PIECE, RateLoopFit, fit_rate_loop
from quadsim.identify.result import VehicleFit
from quadsim.identify.rotors import rotor_speeds
from quadsim.identify.row_errors import between_rows
from quadsim.identify.stages import search_numbers
from quadsim.identify.stretches import Stretch, stretches, thinned, total_time
from quadsim.identify.to_vehicle import (
    FoundNumbers,
    SpeedScale,
    fitted_numbers,
    fitted_vehicle,
    from_log,
)
from quadsim.identify.traces import traces
from quadsim.logs.flight_log import FlightLog
from quadsim.vehicle import Vehicle, load_vehicle, unlikely_inertia, vehicle_names

LEAST_TIME = 5.0  # in flight, of all logs [s]
LOOP_RATE = 400.0  # least rate of the rows to which a rate loop is fitted [Hz]


def fit_vehicle(
    logs: Sequence[FlightLog],
    *,
    test: Sequence[FlightLog] = (),
    name: str = "fitted",
    base: Vehicle | None = None,
    mass: float | None = None,
    arm: float | None = None,
) -> VehicleFit:
    """Return the vehicle that flies as in the logs.

    Args:
        logs: flights to fit.
        test: flights on which the predictions of the fitted vehicle are measured; with none, the
            fitted flights.
        name: name of the vehicle.
        base: a similar vehicle with rotors: the prior of each number, and the source of what no log
            tells; None: the vehicle of quadsim with the nearest mass.
        mass: of the vehicle, by a scale [kg]; None: the mass of `base`.
        arm: from the centre to a rotor [m]; None: the arm of `base`, which may be another one.

    Raises:
        SettingError: neither base nor mass is given, the logs have nothing to fit, or what fits
            them is no vehicle that can fly.
    """
    prior_vehicle = base or _nearest(mass)
    if prior_vehicle.rotors is None:
        raise SettingError("base", f"expected a vehicle with rotors, got {prior_vehicle.name!r}")
    if arm is not None:
        prior_vehicle = with_arm(prior_vehicle, arm)
    parts = _flown_parts(logs)
    flown = total_time(parts)
    remarks = [f"{log.name}: {remark}" for log in logs for remark in log.remarks]
    reference = reference_voltage(parts)
    if reference is not None:
        remarks.append(f"thrust and rate_tau are those at {reference:.4g} V, the median in flight")
    parts = liveliest(parts)
    kept = total_time(parts)
    if kept < flown:
        remarks.append(
            f"the liveliest {kept:.0f} s of {flown:.0f} s of flight are fitted, the rest left out"
        )
    ready = prepare([thinned(part) for part in parts], prior_vehicle, reference)
    geometry = Geometry.of(prior_vehicle)
    if spins_other_way(ready, geometry):
        geometry = geometry.mirrored()
        remarks.append("rotors turn the other way round than quadsim's, which makes no difference")
    prior = prior_of(prior_vehicle)

    search = search_numbers(ready, geometry, prior)
    solution = search.solution
    expect_inertia(solution, geometry)
    expect_answers(solution)
    remarks += search.remarks
    if not ready[0].has_single:
        remarks.append("the logs have no motor commands: inertia and full thrust are the prior's")
    lag = solution.numbers.tau
    finer = [thinned(part, LOOP_RATE) for part in parts]
    loop = fit_rate_loop(
        prepare(finer, prior_vehicle, reference), lag, prior_vehicle.rate_tau, reference
    )
    if arm is None and "inertia_x" in solution.searched:
        remarks.append(
            f"inertia: the arm is that of {prior_vehicle.name}, and the intervals are wide for it: "
            "give the arm"
        )
    remarks += _remarks_on(loop)
    found = FoundNumbers(
        numbers=solution.numbers,
        covariance=covariances(solution.linearized).reported
        + between_rows(ready, geometry, prior, search),
        searched=solution.searched,
        untold=search.untold,
        drive=ready[0].drive,
        dt=ready[0].stretch.dt,
        lowest=_lowest_command(ready),
        speed_scale=_speed_scale(ready, solution.numbers),
        loop=loop,
    )
    shown = _tested(test, ready, prior_vehicle, reference) or ready
    numbers = fitted_numbers(found, prior_vehicle, mass, has_arm=arm is not None)
    with_gyro = {log.name for log in logs if log.has("body_rates")}
    numbers += tuple(
        from_log(number.key, number.unit, number.value, number.std)
        for number in gyro_errors([part for part in ready if part.stretch.log in with_gyro])
    )
    vehicle = fitted_vehicle(name, found, numbers, prior_vehicle)
    expect_plausible(vehicle)
    if unlikely := unlikely_inertia(vehicle):
        remarks.append(unlikely)
    predicted = predictions(shown, solution.numbers, geometry, search.turning)
    remarks += remarks_on_attitude(predicted)
    return VehicleFit(
        name=name,
        vehicle=vehicle,
        numbers=numbers,
        remarks=tuple(remarks),
        predictions=predicted,
        traces=traces(shown, solution.numbers, geometry, search.turning),
        residuals=solution.by_channel(),
    )


def _flown_parts(logs: Sequence[FlightLog]) -> list[Stretch]:
    """Return the stretches of logs in which a vehicle flies by known commands.

    Raises:
        SettingError: they are too short, or there are none.
    """
    parts = [part for log in logs for part in stretches(log) if drive_of(part)]
    if not parts:
        wanted = "expected a flight of a second or more with motor commands or thrust setpoints"
        raise SettingError("logs", f"{wanted}, got none in {len(logs)}")
    flown = total_time(parts)
    if flown < LEAST_TIME:
        wanted = f"expected at least {LEAST_TIME:g} s of flight"
        raise SettingError("logs", f"{wanted}, got {flown:.2g} s: a minute of manoeuvres is best")
    return parts


def _remarks_on(loop: RateLoopFit | None) -> Iterator[str]:
    """Yield what the logs say of the rate loop besides its numbers."""
    if loop is None:
        yield "the logs have no flight on rate setpoints: rate_tau is the prior's"
        return
    if LAGS[0] in loop.searched:
        flags = " ".join(f"{lag:.3g}" for lag in loop.numbers.lag)
        yield (
            "the body rates' accelerations lag otherwise than the rotors, as behind filters, which "
            f"a vehicle file lacks: fly it with --model-rate-lag {flags}"
        )
    if loop.left_out:
        yield (
            f"rate_tau is fitted to the {loop.pieces} pieces of {PIECE:g} s in which the setpoints "
            f"change most; {loop.left_out} others are left out"
        )


def remarks_on_attitude(predicted: Sequence[Prediction]) -> Iterator[str]:
    """Yield a remark if the simulated attitude makes predictions worse than none would be."""
    # The rows of the last name are those of all logs.
    rows = [row for row in predicted if row.log == predicted[-1].log]
    lost = [row.seconds for row in rows if (row.simulated_attitude or 0.0) > row.constant_velocity]
    if lost:
        yield (
            f"with the simulated attitude, predictions are worse than constant velocity after "
            f"{lost[0]:g} s: the flights turn too little to tell all torques; a planner corrects "
            "the attitude by measurements at each step"
        )


def with_arm(vehicle: Vehicle, arm: float) -> Vehicle:
    """Return a vehicle with rotors that are at another distance from its centre.

    Args:
        vehicle: with rotors.
        arm: from the centre to a rotor [m].

    Raises:
        SettingError: the arm is not a length.
    """
    assert vehicle.rotors
    if not 0.0 < arm < inf:
        raise SettingError("arm", f"expected more than 0 [m], got {arm:g}")
    x, y = vehicle.rotors.positions[2]
    ratio = arm / hypot(x, y)
    return vehicle.but(rotors={"rotor_x": ratio * x, "rotor_y": ratio * y})


def _nearest(mass: float | None) -> Vehicle:
    """Return the vehicle of the project with rotors and the nearest mass.

    Raises:
        SettingError: there is no mass.
    """
    if mass is None:
        wanted = (
            "expected the mass by a scale [kg], or a base vehicle: a log tells only ratios to it"
        )
        raise SettingError("mass", f"{wanted}, got neither")
    known = [load_vehicle(name) for name in vehicle_names()]
    with_rotors = [vehicle for vehicle in known if vehicle.rotors]
    return min(with_rotors, key=lambda vehicle: abs(np.log(vehicle.mass / mass)))


def _tested(
    test: Sequence[FlightLog], fitted: Sequence[Prepared], base: Vehicle, reference: float | None
) -> list[Prepared]:
    """Return the stretches of the tested logs that have the same drive as the fitted ones."""
    found = [part for log in test for part in stretches(log)]
    alike = [thinned(part) for part in found if drive_of(part) == fitted[0].drive]
    return prepare(alike, base, reference) if alike else []


def _lowest_command(parts: Sequence[Prepared]) -> float:
    """Return the lowest command of a rotor in flight, 1 if the log has none of each rotor."""
    commands = [part.command[part.usable].min(initial=1.0) for part in parts if part.has_single]
    return float(min(commands, default=1.0))


def _speed_scale(parts: Sequence[Prepared], numbers: FitNumbers) -> SpeedScale | None:
    """Return how logged rotor speeds follow the commands; None if a log has not both."""
    shares, speeds = [], []
    for part in parts:
        logged = part.stretch.rotor_speeds
        if part.drive != "motor_commands" or logged is None:
            continue
        usable = part.usable & np.all(np.isfinite(logged), axis=1)
        shares.append(rotor_speeds(part, numbers)[usable].ravel())
        speeds.append(logged[usable].ravel())
    if not shares or not sum(map(len, shares)):
        return None
    full, idle = np.polyfit(np.concatenate(shares), np.concatenate(speeds), 1)
    return SpeedScale(float(full), float(idle))
