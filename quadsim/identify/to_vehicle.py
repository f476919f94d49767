"""From the numbers of a fit to a vehicle, each number with its interval and its source."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import isclose, sqrt
from typing import Literal, NamedTuple

import numpy as np

from quadsim.identify.geometry import Geometry
from quadsim.identify.intervals import TWO_SIDED, covariances
from quadsim.identify.numbers import FitNumbers
from quadsim.identify.prepared import Drive
from quadsim.identify.prior import FLATNESS, prior_of
from quadsim.identify.rate_loop import RateLoopFit
from quadsim.physics.domain_randomization import widths
from quadsim.physics.randomization_file import OUTDOOR
from quadsim.vehicle import Uncertainty, Vehicle
from quadsim.vehicle.vehicle import NO_LEAD

# "derived": not as the prior vehicle has it, but by numbers of the log, or by the mass
Source = Literal["log", "prior", "given", "derived"]

DIGITS = 5  # of the vehicle's numbers
# A fitted thrust map may fall at low speeds; the idle speed is this share above its lowest point.
ABOVE = 1e-4
# What a log cannot tell whatever its length, one standard deviation: the scale factors of small
# inertial units, which are off by some tenths of a per cent, and times below a part of a row.
SCALE_FACTOR = 0.003
PART_OF_ROW = 0.05
DRAG_SHARE = 0.01  # of the drag, whose velocity is smoothed and late by a part of a row
LOOP_SHARE = 0.01  # of the lags of the rate loop, and of the rotors' lag in the latency
# of a drag [1/s]: the bias of a small accelerometer wanders by some mm/s^2 in a second
DRAG_FLOOR = 0.002
# numbers of the rate loop -> keys
LOOP_KEYS = {
    "tau_x": "rate_tau.x",
    "tau_y": "rate_tau.y",
    "tau_z": "rate_tau.z",
    "delay": "latency",
    "lag_x": "rate_lag.x",
    "lag_y": "rate_lag.y",
    "lag_z": "rate_lag.z",
    "voltage_power": "rate_voltage_power",
}
ARM = 0.2  # relative standard deviation of the arm that the prior vehicle has
SAME = 1e-9  # relative difference below which a number is the prior's
WEIGHED = 0.005  # relative standard deviation of a mass by a scale
LARGEST_SHARE = 0.5


class FittedNumber(NamedTuple):
    """One number of a fitted vehicle."""

    key: str  # as in a vehicle file, with the axis
    unit: str
    value: float
    low: float  # limits of the 95 % interval
    high: float
    source: Source

    @property
    def std(self) -> float:
        """The standard deviation."""
        return (self.high - self.low) / (2.0 * TWO_SIDED)


class FoundNumbers(NamedTuple):
    """The numbers that the search has found in the logs, with their covariance."""

    numbers: FitNumbers
    covariance: np.ndarray  # of the searched numbers  (k, k)
    searched: tuple[str, ...]
    untold: tuple[str, ...]  # numbers that the log does not determine, although it has the signals
    drive: Drive
    dt: float  # time between two rows [s]
    lowest: float  # least commanded speed of a rotor in flight, as a share of the full speed
    speed_scale: SpeedScale | None
    loop: RateLoopFit | None


class SpeedScale(NamedTuple):
    """Speed of a rotor [rad/s] = full share + idle."""

    full: float
    idle: float


class _Row(NamedTuple):
    """How one number of the vehicle follows from the searched ones."""

    unit: str
    value: Callable[[FitNumbers], float]
    needs: tuple[str, ...]
    floor: float = 0.0  # least standard deviation, absolute
    scale: float = 0.0  # and relative


def fitted_numbers(
    found: FoundNumbers, base: Vehicle, mass: float | None, *, has_arm: bool
) -> tuple[FittedNumber, ...]:
    """Return all numbers of the vehicle.

    Args:
        found: what was found in the logs.
        base: the prior vehicle.
        mass: of the vehicle, by a scale [kg]; None: the mass of `base`.
        has_arm: whether the arms of `base` were measured on the vehicle.
    """
    source: Source = "prior" if mass is None else "given"
    mass = mass or base.mass
    numbers = [FittedNumber("mass", "kg", mass, mass, mass, source)]
    prior = FitNumbers(**{name: each.mean for name, each in prior_of(base).items()})
    before = _rows(found, base, base.mass, has_arm=has_arm)
    for key, row in _rows(found, base, mass, has_arm=has_arm).items():
        numbers.append(_number(key, row, found, before[key].value(prior)))
    return (*numbers, *_loop_numbers(found, base))


def _rows(found: FoundNumbers, base: Vehicle, mass: float, *, has_arm: bool) -> Mapping[str, _Row]:
    """Return the numbers that follow from the searched ones, by key."""
    geometry = Geometry.of(base)
    late = PART_OF_ROW * found.dt

    def inertia(k: int) -> Callable[[FitNumbers], float]:
        return lambda n: mass * geometry.inertia(n)[k]

    def field(name: str) -> Callable[[FitNumbers], float]:
        return lambda n: getattr(n, name)

    def kappa(n: FitNumbers) -> float:
        return geometry.inertia(n)[2] / n.inertia_z

    turned = ("inertia_x", "inertia_y")
    ratio = SCALE_FACTOR
    # Without gyroscopic torques the log tells the inertia about z over the reaction torque alone.
    flat = ratio if "flatness" in found.searched else FLATNESS / 2.0
    # And the inertia over the arm alone: arms of a similar vehicle are not those of this one.
    arm = 0.0 if has_arm else ARM

    rows = _thrust_rows(found, base, mass)
    rows |= {
        "rotors.motor_tau": _Row("s", field("tau"), ("tau",), floor=late),
        "motor_delay": _Row("s", field("delay"), ("delay",), floor=late),
        "voltage_power": _Row("1", field("voltage_power"), ("voltage_power",)),
    }
    for axis in "xyz":
        name = f"inertia_{axis}"
        rows[f"inertia_over_arm.{axis}"] = _Row("m", field(name), (name,), scale=ratio)
    for k, axis in enumerate("xyz"):
        needs = (f"inertia_{axis}",) if axis != "z" else (*turned, "flatness")
        share = sqrt((flat if axis == "z" else ratio) ** 2 + arm**2)
        rows[f"inertia.{axis}"] = _Row("kg m^2", inertia(k), needs, scale=share)
    needs = ("inertia_z", *turned, "flatness")
    rows["rotors.kappa"] = _Row("m", kappa, needs, scale=sqrt(flat**2 + arm**2))
    for axis in "xyz":
        name = f"drag_{axis}"
        rows[f"drag.{axis}"] = _Row("1/s", field(name), (name,), floor=DRAG_FLOOR, scale=DRAG_SHARE)
    extras = {
        "offset": ("1", "xyz"),
        "bias": ("m/s^2", "xyz"),
        "tilt": ("rad", "xy"),
        "pose_tilt": ("rad", "xy"),
    }
    for name, (unit, axes) in extras.items():
        for axis in axes:
            key = f"{name}_{axis}"
            rows[f"{name}.{axis}"] = _Row(unit, field(key), (key,))
    for name in ("flapping", "yaw_lead", "force_lag", "velocity_lag"):
        rows[name] = _Row("s", field(name), (name,), floor=late)
    # Nuisances that are not searched say nothing.
    quiet = (
        *extras,
        "flapping",
        "yaw_lead",
        "force_lag",
        "velocity_lag",
        "voltage_power",
        "motor_delay",
    )
    return {
        key: row
        for key, row in rows.items()
        if key.split(".")[0] not in quiet or any(name in found.searched for name in row.needs)
    }


def _thrust_rows(found: FoundNumbers, base: Vehicle, mass: float) -> dict[str, _Row]:
    """Return the numbers of the thrust, by key.

    A log with setpoints of the thrust tells the ratio of the thrust to them. Full thrust and the
    rotors' map are the prior's.
    """
    thrust = ("c2", "c1", "c0")
    ratio = SCALE_FACTOR
    is_ratio = found.drive == "thrust_setpoint"

    def coefficient(k: int) -> Callable[[FitNumbers], float]:
        return lambda n: mass * speed_map(n, found, base)[k]

    def full(n: FitNumbers) -> float:
        return 4.0 * (n.c2 + n.c1 + n.c0)

    needs = () if is_ratio else thrust
    rows = {
        "thrust_max": _Row(
            "m/s^2", (lambda _: base.thrust_max) if is_ratio else full, needs, scale=ratio
        ),
        "rotors.thrust_map.c2": _Row("N s^2", coefficient(0), needs, scale=ratio),
        "rotors.thrust_map.c1": _Row("N s", coefficient(1), needs),
        "rotors.thrust_map.c0": _Row("N", coefficient(2), needs),
    }
    if is_ratio:
        rows["thrust_ratio"] = _Row("1", lambda n: full(n) / base.thrust_max, thrust, scale=ratio)
    return rows


def _number(key: str, row: _Row, found: FoundNumbers, prior: float) -> FittedNumber:
    """Return a number with its interval, by the derivatives.

    Args:
        key: of the number.
        row: how it follows from the searched ones.
        found: what was found in the logs.
        prior: the number of the prior vehicle.
    """
    value = row.value(found.numbers)
    told = [name for name in row.needs if name in found.searched]
    # A log of the rotors' speeds alone does not tell the full speed.
    is_scaled = found.drive == "rotor_speeds" and key == "thrust_max"
    if is_scaled or not told:
        source: Source = "prior" if isclose(value, prior, rel_tol=SAME) else "derived"
        return FittedNumber(key, row.unit, value, value, value, source)
    gradient = np.zeros(len(found.searched))
    for k, name in enumerate(found.searched):
        at = getattr(found.numbers, name)
        step = 1e-5 * max(abs(at), 1e-3)
        ahead, behind = (row.value(found.numbers._replace(**{name: at + h})) for h in (step, -step))
        gradient[k] = (ahead - behind) / (2.0 * step)
    variance = float(gradient @ found.covariance @ gradient)
    std = float(np.sqrt(variance + row.floor**2 + (row.scale * value) ** 2))
    return from_log(key, row.unit, value, std)


def _loop_numbers(found: FoundNumbers, base: Vehicle) -> list[FittedNumber]:
    """Return the lags of the rate loop and the latency."""
    late = PART_OF_ROW * found.dt
    if found.loop is None:
        rows = zip("xyz", base.rate_tau, strict=True)
        lags = [FittedNumber(f"rate_tau.{axis}", "s", tau, tau, tau, "prior") for axis, tau in rows]
        return [*lags, _latency_of_motors(found, base)]
    loop = found.loop
    std = np.sqrt(np.diag(covariances(loop.linearized).reported))
    deviations = dict(zip(loop.searched, std, strict=True))
    numbers = []
    for name, key in LOOP_KEYS.items():
        if name not in loop.searched:
            continue
        value = getattr(loop.numbers, name)
        # The loop is taken as linear, which its rotors are not: their lag depends on the step.
        share = LOOP_SHARE * (found.numbers.tau if name == "delay" else value)
        floor = 0.0 if name.endswith("power") else float(np.hypot(late, share))
        deviation = float(np.hypot(deviations[name], floor))
        unit = "1" if name.endswith("power") else "s"
        numbers.append(from_log(key, unit, value, deviation))
    return numbers


def _latency_of_motors(found: FoundNumbers, base: Vehicle) -> FittedNumber:
    """Return the latency of a log without setpoints: the delay of its commands."""
    if "delay" not in found.searched:
        return FittedNumber("latency", "s", base.latency, base.latency, base.latency, "prior")
    k = found.searched.index("delay")
    std = float(np.hypot(np.sqrt(found.covariance[k, k]), PART_OF_ROW * found.dt))
    return from_log("latency", "s", found.numbers.delay, std)


def from_log(key: str, unit: str, value: float, std: float) -> FittedNumber:
    """Return a number with the interval of its standard deviation."""
    half = TWO_SIDED * std
    return FittedNumber(key, unit, value, value - half, value + half, "log")


def speed_map(
    numbers: FitNumbers, found: FoundNumbers, base: Vehicle
) -> tuple[float, float, float]:
    """Return c2, c1, c0 of a rotor's thrust over the mass against its speed in rad/s."""
    assert base.rotors
    if found.drive == "thrust_setpoint":
        square, linear, constant = base.rotors.thrust_map
        return square / base.mass, linear / base.mass, constant / base.mass
    scale = found.speed_scale or SpeedScale(base.rotors.motor_omega_max, 0.0)
    # s = (W - idle) / full
    c2 = numbers.c2 / scale.full**2
    c1 = numbers.c1 / scale.full - 2.0 * c2 * scale.idle
    c0 = numbers.c0 - numbers.c1 / scale.full * scale.idle + c2 * scale.idle**2
    return c2, c1, c0


def fitted_vehicle(
    name: str, found: FoundNumbers, numbers: tuple[FittedNumber, ...], base: Vehicle
) -> Vehicle:
    """Return the vehicle with the fitted numbers, rounded.

    Raises:
        SettingError: the numbers are not those of a vehicle that can fly.
    """
    assert base.rotors
    by_key = {number.key: number.value for number in numbers}

    def value(key: str) -> float:
        return float(f"{by_key[key]:.{DIGITS}g}")

    scale = found.speed_scale or SpeedScale(base.rotors.motor_omega_max, 0.0)
    full = float(f"{scale.full + scale.idle:.{DIGITS}g}")
    c2, c1, c0 = (value(f"rotors.thrust_map.{c}") for c in ("c2", "c1", "c0"))
    # Rotors idle no faster than they were told to turn, and the thrust has to rise from there on.
    idle = min(base.rotors.motor_omega_min / base.rotors.motor_omega_max, found.lowest)
    lowest = max(
        idle * full,
        -c1 / (2.0 * c2) * (1.0 + ABOVE),
    )
    x, y = base.rotors.positions[2]
    told = {number.key for number in numbers if number.source == "log"}
    # Rotors that rise and fall by other lags would go beside the lag that was found.
    response = None if "rotors.motor_tau" in told else base.rotors.motor_response
    # So would a rate loop with a lead.
    lead = NO_LEAD if "rate_tau.x" in told else base.rate_lead
    jx, jy, jz = (value(f"inertia.{axis}") for axis in "xyz")
    return base.but(
        name=name,
        source=f"fitted from logs by quadsim; what they do not tell: {base.name}",
        mass=value("mass"),
        # A flat body has jz = jx + jy, the most of any body, which rounding must not exceed.
        inertia=[jx, jy, min(jz, jx + jy)],
        rate_tau=[value(f"rate_tau.{axis}") for axis in "xyz"],
        rate_lead=lead,
        drag=[max(value(f"drag.{axis}"), 0.0) for axis in "xyz"],
        latency=max(value("latency"), 0.0),
        rotors={
            "rotor_x": x,
            "rotor_y": y,
            "motor_omega_min": float(f"{lowest:.{DIGITS}g}"),
            "motor_omega_max": full,
            "motor_tau": value("rotors.motor_tau"),
            "motor_response": response,
            "thrust_map": [c2, c1, c0],
            "kappa": value("rotors.kappa"),
        },
        uncertainty=_uncertainty(numbers),
    )


def _uncertainty(numbers: tuple[FittedNumber, ...]) -> Uncertainty:
    """Return the relative standard deviations; those of three axes are relative to their mean.

    Numbers that the logs do not tell are as uncertain as those of any vehicle.
    """
    by_key = {number.key: number for number in numbers}
    usual = widths(OUTDOOR)

    def share(keys: Sequence[str], half_width: float) -> float:
        known = [by_key[key] for key in keys]
        if any(number.source in ("prior", "derived") for number in known):
            return half_width / sqrt(3)
        return _relative(known)

    rates = [f"rate_tau.{axis}" for axis in "xyz"]
    shares = {
        "mass": share(["mass"], usual.mass),
        "thrust": share(["thrust_max"], usual.thrust),
        "rate_lag": share(rates, usual.rate_lag),
        "motor_lag": share(["rotors.motor_tau"], usual.motor_lag),
        "drag": share([f"drag.{axis}" for axis in "xyz"], usual.drag),
    }
    return Uncertainty(**{name: float(f"{value:.3g}") for name, value in shares.items()})


def _relative(numbers: Sequence[FittedNumber]) -> float:
    """Return the standard deviation of some numbers over their mean, at most LARGEST_SHARE."""
    if any(number.source == "given" for number in numbers):
        return WEIGHED
    std = sqrt(np.mean([number.std**2 for number in numbers]))
    size = float(np.mean([abs(number.value) for number in numbers]))
    return min(std / max(size, 1e-9), LARGEST_SHARE)
