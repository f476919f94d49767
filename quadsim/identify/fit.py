"""The fit of a vehicle to logs: delays first, then all numbers together, then the rate loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from quadsim.files.values import SettingError
from quadsim.identify.delays import answer_time, spins_other_way
from quadsim.identify.geometry import Geometry
from quadsim.identify.intervals import covariances
from quadsim.identify.numbers import Numbers, Prior
from quadsim.identify.prediction import predictions
from quadsim.identify.prepared import (
    SINGLE_DRIVES,
    VOLTAGE_DRIVES,
    Prepared,
    drive_of,
    middle,
    prepare,
    reference_voltage,
)
from quadsim.identify.prior import prior_of
from quadsim.identify.rate_loop import fit_rate_loop
from quadsim.identify.result import VehicleFit
from quadsim.identify.rotors import rotor_speeds
from quadsim.identify.search import Solution, solve
from quadsim.identify.stretches import stretches, thinned
from quadsim.identify.to_vehicle import Found, SpeedScale, fitted_numbers, fitted_vehicle
from quadsim.identify.traces import traces
from quadsim.logs.flight_log import FlightLog
from quadsim.vehicle import Vehicle, load_vehicle, vehicle_names

# How delay and lag of the rotors may share the time to the answer, which shows the fast part of a
# lag alone: starts of the search
SHARES = ((0.0, 1.5), (0.3, 0.9), (0.7, 0.3))
COARSE = 40.0  # time of flight from which the starts are searched [s]
# Thrust maps with a linear and a constant part have to fit better than this: the 99.9 % quantile of
# chi-square with two degrees of freedom.
SQUARE_ALONE = 13.8
LEAST_EXPLAINED = 0.3  # of the rotation about an axis: with less its inertia is not told
LEAST_SPREAD = 0.01  # of the voltage, standard deviation over mean: less tells nothing
COARSE_PIECE = 4.0  # of one flight, at least [s]
MAP = ("c2", "c1", "c0")
ROTORS = ("delay", "tau")
DRAG = ("drag_x", "drag_y", "drag_z")
FORCE = ("bias_z",)
FORCE_ASIDE = ("bias_x", "bias_y", "tilt_x", "tilt_y", "flapping")
POSE = ("pose_tilt_x", "pose_tilt_y", "velocity_lag")
INERTIA = ("inertia_x", "inertia_y", "inertia_z", "offset_x", "offset_y", "offset_z", "yaw_lead")


def fit_vehicle(
    logs: Sequence[FlightLog],
    *,
    test: Sequence[FlightLog] = (),
    name: str = "fitted",
    base: Vehicle | None = None,
    mass: float | None = None,
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

    Raises:
        SettingError: neither base nor mass is given, or the logs have nothing to fit.
    """
    prior_vehicle = base or _nearest(mass)
    if prior_vehicle.rotors is None:
        raise SettingError("base", f"expected a vehicle with rotors, got {prior_vehicle.name!r}")
    parts = [part for log in logs for part in stretches(log) if drive_of(part)]
    if not parts:
        wanted = "expected a flight of a second or more with motor commands or thrust setpoints"
        raise SettingError("logs", f"{wanted}, got none in {len(logs)}")
    remarks = [f"{log.name}: {remark}" for log in logs for remark in log.remarks]
    ready = prepare([thinned(part) for part in parts], prior_vehicle)
    geometry = Geometry.of(prior_vehicle)
    if spins_other_way(ready, geometry):
        geometry = geometry.mirrored()
        remarks.append("rotors turn the other way round than quadsim's, which makes no difference")
    prior = prior_of(prior_vehicle)

    search = _search(ready, geometry, prior)
    solution = search.solution
    remarks += search.remarks
    lag = solution.numbers.tau
    loop = fit_rate_loop(prepare(parts, prior_vehicle), lag, prior_vehicle.rate_tau)
    if loop is None:
        remarks.append("the logs have no flight on rate setpoints: rate_tau is the prior's")
    found = Found(
        numbers=solution.numbers,
        covariance=covariances(solution.linearized).reported,
        searched=solution.searched,
        untold=search.untold,
        drive=ready[0].drive,
        dt=ready[0].stretch.dt,
        speed_scale=_speed_scale(ready, solution.numbers),
        loop=loop,
    )
    tested = [
        thinned(part) for log in test for part in stretches(log) if drive_of(part) == ready[0].drive
    ]
    shown = (
        prepare(tested, prior_vehicle, reference_voltage([part.stretch for part in ready]))
        if tested
        else ready
    )
    numbers = fitted_numbers(found, prior_vehicle, mass or prior_vehicle.mass, mass is not None)
    return VehicleFit(
        name=name,
        vehicle=fitted_vehicle(name, found, numbers, prior_vehicle),
        numbers=numbers,
        remarks=tuple(remarks),
        predictions=predictions(shown, solution.numbers, geometry, search.turning),
        traces=traces(shown, solution.numbers, geometry, search.turning),
        residuals=solution.by_channel(),
    )


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


def _searchable(parts: Sequence[Prepared]) -> tuple[str, ...]:
    """Return the names of the numbers that the signals of the logs may tell."""
    drive = parts[0].drive
    has_force = any(part.stretch.specific_force is not None for part in parts)
    has_velocity = any(part.v_body is not None for part in parts)
    has_rates = drive in SINGLE_DRIVES and any(
        part.stretch.body_rates is not None for part in parts
    )
    names: list[str] = []
    if has_force or has_velocity:
        names += MAP
    if drive != "rotor_speeds":
        names += ROTORS
    if drive in VOLTAGE_DRIVES and _spread(parts) > LEAST_SPREAD:
        names.append("voltage_power")
    if has_velocity:
        names += [*DRAG, *POSE]
    if has_force:
        names += FORCE if has_velocity else ()
        names += FORCE_ASIDE if has_velocity else ()
    if has_rates:
        names += INERTIA
        names += ("force_lag",) if has_force else ()
    return tuple(names)


def _spread(parts: Sequence[Prepared]) -> float:
    """Return the standard deviation of the voltage over its mean."""
    return float(np.std(np.concatenate([part.ratio[part.usable] for part in parts])))


class Search(NamedTuple):
    """The best numbers, and what the logs do not tell."""

    solution: Solution
    turning: tuple[int, ...]  # axes about which the rotors explain the rotation
    untold: tuple[str, ...]  # names of the numbers that stay at the prior
    remarks: tuple[str, ...]


def _search(parts: Sequence[Prepared], geometry: Geometry, prior: Mapping[str, Prior]) -> Search:
    """Return the numbers that fit best: delays first, then simple models before larger ones."""
    searched = _searchable(parts)
    start = Numbers(**{name: prior[name].mean for name in Numbers._fields})
    # The time of the answer is known from the correlation, how delay and lag share it is not.
    time = answer_time(parts, geometry)
    square = [name for name in searched if name not in MAP[1:]]
    starts = [
        start._replace(delay=delay * time, tau=tau * time, c1=0.0, c0=0.0) for delay, tau in SHARES
    ]
    solution = solve(_coarse(parts), geometry, prior, square, starts)
    solution = solve(parts, geometry, prior, square, [solution.numbers])

    # Rotation that the rotors do not explain would only spoil the rest.
    remarks = []
    turning = []
    for k, axis in enumerate("xyz"):
        share = solution.explained.get(f"rate_{axis}")
        if share is not None and share >= LEAST_EXPLAINED:
            turning.append(k)
        elif share is not None:
            remarks.append(
                f"inertia about {axis}: the motors' commands explain {100 * max(share, 0.0):.0f} % of "
                "the rotation, too little to tell it, and the prior is kept"
            )
    lost = [
        f"{name}_{axis}"
        for k, axis in enumerate("xyz")
        if k not in turning
        for name in ("inertia", "offset")
    ]
    if not turning:
        lost.append("force_lag")
    if 2 not in turning:
        lost.append("yaw_lead")
    lost = [name for name in lost if name in searched]
    searched = [name for name in searched if name not in lost]
    if lost:
        square = [name for name in searched if name not in MAP[1:]]
        begin = solution.numbers._replace(**{name: getattr(start, name) for name in lost})
        solution = solve(parts, geometry, prior, square, [begin], turning)

    # A linear and a constant part of the thrust map have to pay.
    if MAP[0] in searched:
        whole = solve(parts, geometry, prior, searched, [solution.numbers], turning)
        if _needs_whole_map(whole):
            solution = whole

    # What the log tells worse than the prior stays at the prior.
    told = covariances(solution.linearized).log_alone
    pairs = zip(solution.searched, told, strict=True)
    untold = tuple(name for name, std in pairs if not std < prior[name].std)
    if untold:
        kept = [name for name in solution.searched if name not in untold]
        at_prior = {name: prior[name].mean for name in untold}
        begin = solution.numbers._replace(**at_prior)
        solution = solve(parts, geometry, prior, kept, [begin], turning)
    remarks += [_untold(name) for name in untold]
    return Search(solution, tuple(turning), (*lost, *untold), tuple(remarks))


def _coarse(parts: Sequence[Prepared]) -> list[Prepared]:
    """Return the middles of the flights, which are enough to tell good starts from bad ones."""
    each = max(COARSE / len(parts), COARSE_PIECE)
    return [middle(part, each) for part in parts]


def _needs_whole_map(solution: Solution) -> bool:
    """Return whether the thrust is not proportional to the square of the command."""
    index = [solution.searched.index(name) for name in MAP[1:]]
    covariance = covariances(solution.linearized).reported[np.ix_(index, index)]
    values = np.array([solution.numbers.c1, solution.numbers.c0])
    return float(values @ np.linalg.solve(covariance, values)) > SQUARE_ALONE


def _speed_scale(parts: Sequence[Prepared], numbers: Numbers) -> SpeedScale | None:
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


def _untold(name: str) -> str:
    """Return the line on a number that the logs do not tell."""
    return (
        f"{name}: the flights excite it too little to tell it better than the prior, which is kept"
    )
