"""Logs of known vehicles with the mistakes of a user: wrong units, signs, frames, lost columns.

Each is refused, or the fitted numbers are right within their intervals.

    python -m tests.identify.mistakes 10          # every mistake with ten vehicles
    python -m tests.identify.mistakes 5 --first 4 # with the last of five vehicles
"""

from __future__ import annotations

import argparse
import random
import sys
from collections import Counter
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from quadsim.files.strict_yaml import FileError
from quadsim.files.values import SettingError
from quadsim.identify import FittedNumber, VehicleFit, fit_vehicle
from quadsim.logs.cleaning import cleaned
from quadsim.logs.flight_log import SIGNALS
from quadsim.logs.frames import products
from quadsim.logs.raw_log import RawLog
from quadsim.rotation import to_body
from quadsim.vehicle import Vehicle, load_vehicle
from tests.identify.fit_cases import flight, noisy

Signals = dict[str, np.ndarray]
SECONDS = 12.0
POSE = ("position", "velocity", "quaternion")
# Signals that a log of gyro, accelerometer and motors lacks
FEW = (*POSE, "rate_setpoints", "thrust_setpoint")
LATE_POSE = 0.15  # [s]
# A number is right within this many halves of its interval, or this share of it.
HALVES = 2.5
SHARE = 0.03


class Mistake(NamedTuple):
    """A mistake of a user."""

    change: Callable[[Signals], Signals]
    # signals that this log lacks
    without: tuple[str, ...] = ()


def scaled(name: str, factor: float) -> Callable[[Signals], Signals]:
    """Return a change that multiplies a signal."""
    return lambda signals: {**signals, name: factor * signals[name]}


def signed(name: str, *signs: float) -> Callable[[Signals], Signals]:
    """Return a change of the signs of a signal's columns."""
    return lambda signals: {**signals, name: signals[name] * signs}


def reordered(name: str, *columns: int) -> Callable[[Signals], Signals]:
    """Return a change of the order of a signal's columns."""
    return lambda signals: {**signals, name: signals[name][:, list(columns)]}


def each(*changes: Callable[[Signals], Signals]) -> Callable[[Signals], Signals]:
    """Return several changes, one after the other."""

    def changed(signals: Signals) -> Signals:
        for change in changes:
            signals = change(signals)
        return signals

    return changed


def unchanged(signals: Signals) -> Signals:
    """Return the log as it is."""
    return signals


def in_body_axes(signals: Signals) -> Signals:
    """Return a log whose velocity is in the body's axes."""
    turned = to_body(signals["quaternion"].T, signals["velocity"].T)
    return {**signals, "velocity": np.stack(turned, axis=1)}


def turned_pose(signals: Signals) -> Signals:
    """Return a log whose attitude is turned by 90 degrees about the vertical."""
    quarter = np.array((0.5**0.5, 0.0, 0.0, 0.5**0.5))
    return {**signals, "quaternion": products(quarter, signals["quaternion"])}


def north_east_down(signals: Signals) -> Signals:
    """Return a log in north, east, down and forward, right, down."""
    to_ned = np.array((0.0, 0.5**0.5, 0.5**0.5, 0.0))
    half = np.array((0.0, 1.0, 0.0, 0.0))
    found = {
        "position": signals["position"][:, [1, 0, 2]] * (1.0, 1.0, -1.0),
        "velocity": signals["velocity"][:, [1, 0, 2]] * (1.0, 1.0, -1.0),
        "quaternion": products(products(to_ned, signals["quaternion"]), half),
    }
    for name in ("body_rates", "specific_force", "rate_setpoints"):
        if name in signals:
            found[name] = signals[name] * (1.0, -1.0, -1.0)
    return {**signals, **found}


def late_pose(signals: Signals) -> Signals:
    """Return a log whose pose is late by .15 s."""
    rows = int(np.searchsorted(signals["t"], LATE_POSE))
    late = {name: np.roll(signals[name], rows, axis=0) for name in POSE}
    for values in late.values():
        values[:rows] = values[rows]
    return {**signals, **late}


def on_the_ground(signals: Signals) -> Signals:
    """Return a log of a vehicle that stands on the ground with motors that turn."""
    rng = np.random.default_rng(0)
    n = len(signals["motor_commands"])
    motors = np.repeat(0.3 + 0.05 * (np.arange(n) % 400 > 200), 4).reshape(n, 4)
    return {
        "motor_commands": motors + 0.002 * rng.standard_normal((n, 4)),
        "body_rates": 0.004 * rng.standard_normal((n, 3)),
        "specific_force": (0.0, 0.0, 9.81) + 0.04 * rng.standard_normal((n, 3)),
    }


def without_gravity(signals: Signals) -> Signals:
    """Return a log whose accelerometer is without gravity, in the body's axes."""
    up = np.stack(to_body(signals["quaternion"].T, (0.0, 0.0, 9.81)), axis=1)
    return {**signals, "specific_force": signals["specific_force"] - up}


def conjugated(signals: Signals) -> Signals:
    """Return a log whose attitude turns vectors of the world into the body's."""
    return {**signals, "quaternion": signals["quaternion"] * (1.0, -1.0, -1.0, -1.0)}


RADIANS = 180.0 / np.pi
MISTAKES: Mapping[str, Mistake] = {
    "none": Mistake(unchanged),
    "none, without a pose": Mistake(unchanged, POSE),
    "gyro in rad/s read as deg/s": Mistake(scaled("body_rates", 1.0 / RADIANS)),
    "gyro in rad/s read as deg/s, no pose": Mistake(scaled("body_rates", 1.0 / RADIANS), FEW),
    "gyro in deg/s read as rad/s, no pose": Mistake(scaled("body_rates", RADIANS), FEW),
    "gyro of twice the scale": Mistake(scaled("body_rates", 2.0)),
    "gyro of half the scale, no setpoints": Mistake(scaled("body_rates", 0.5), ("rate_setpoints",)),
    "accelerometer of twice the scale": Mistake(scaled("specific_force", 2.0)),
    "accelerometer of twice the scale, no pose": Mistake(scaled("specific_force", 2.0), FEW),
    "accelerometer without gravity": Mistake(without_gravity),
    "north and east exchanged": Mistake(
        each(reordered("position", 1, 0, 2), reordered("velocity", 1, 0, 2))
    ),
    "velocity in the body's axes": Mistake(in_body_axes, ("position",)),
    "attitude turned by 90 degrees": Mistake(turned_pose),
    "north, east, down read as east, north, up": Mistake(north_east_down, ("specific_force",)),
    "xyzw read as wxyz, no gyro": Mistake(reordered("quaternion", 1, 2, 3, 0), ("body_rates",)),
    "attitude the other way round, no gyro": Mistake(conjugated, ("body_rates",)),
    "pose late by .15 s": Mistake(late_pose),
    "on the ground": Mistake(on_the_ground, FEW),
    "two motors exchanged": Mistake(reordered("motor_commands", 2, 1, 0, 3)),
    "position in mm, no velocity": Mistake(scaled("position", 0.1), ("velocity",)),
    "setpoints in deg/s read as rad/s": Mistake(scaled("rate_setpoints", RADIANS)),
    "gyro with y and z to the other side, no pose": Mistake(
        signed("body_rates", 1.0, -1.0, -1.0), FEW
    ),
}


def vehicle_of(seed: int) -> Vehicle:
    """Return a vehicle that no fit knows."""
    rng = random.Random(seed)

    def about(share: float) -> float:
        return rng.uniform(1.0 - share, 1.0 + share)

    base = load_vehicle(("kingfisher", "archer", "kolibri", "swift", "cf21b_500")[seed % 5])
    assert base.rotors
    size = about(0.2)
    return base.but(
        mass=base.mass * about(0.15),
        inertia=[size * value for value in base.inertia],
        drag=[rng.uniform(0.1, 0.6) for _ in range(3)],
        rate_tau=[value * about(0.3) for value in base.rate_tau],
        latency=rng.choice((0.0, 0.01, 0.02)),
        rotors={
            "motor_tau": base.rotors.motor_tau * about(0.3),
            "kappa": base.rotors.kappa * about(0.2),
            # A log is fitted with rotors of one lag, up and down.
            "motor_response": None,
        },
    )


def log_of(vehicle: Vehicle, mistake: Mistake, seed: int) -> RawLog:
    """Return the log of a flight as a mapping with a mistake reads it."""
    whole = noisy(flight(SECONDS, 2.0, vehicle, seed), seed)
    signals = {name: getattr(whole, name) for name in SIGNALS}
    known = {name: values for name, values in signals.items() if values is not None}
    changed = mistake.change({**known, "t": whole.t})
    lost = ("t", *mistake.without)
    kept = {name: values for name, values in changed.items() if name not in lost}
    return RawLog("flight", whole.t.copy(), kept)


def truth(vehicle: Vehicle) -> dict[str, float]:
    """Return the true numbers by key."""
    rotors = vehicle.rotors
    assert rotors
    x, y = rotors.positions[2]
    return {
        "thrust_max": vehicle.thrust_max,
        "rotors.motor_tau": rotors.motor_tau,
        "inertia_over_arm.x": vehicle.inertia[0] / (vehicle.mass * y),
        "inertia_over_arm.y": vehicle.inertia[1] / (vehicle.mass * x),
        "inertia.x": vehicle.inertia[0],
        "inertia.y": vehicle.inertia[1],
        **{f"drag.{axis}": value for axis, value in zip("xyz", vehicle.drag, strict=True)},
        **{f"rate_tau.{axis}": v for axis, v in zip("xyz", vehicle.rate_tau, strict=True)},
    }


def is_right(number: FittedNumber, true: float) -> bool:
    """Return whether a number that the log tells is right within its interval."""
    half = 0.5 * (number.high - number.low)
    return abs(number.value - true) <= HALVES * half + SHARE * abs(true)


def verdict(seed: int, mistake: str) -> str:
    """Return how a fit ends: "refused: ...", "right", or "WRONG: ...".

    Args:
        seed: of the vehicle and its flight.
        mistake: a key of MISTAKES.
    """
    vehicle = vehicle_of(seed)
    try:
        log = cleaned(log_of(vehicle, MISTAKES[mistake], seed))
        found = fit_vehicle([log], mass=vehicle.mass)
    except (FileError, SettingError) as error:
        return f"refused: {error}"
    if found.doubt:
        return f"refused: {found.doubt}"
    wrong = wrong_numbers(found, vehicle)
    return f"WRONG: {'; '.join(wrong)}" if wrong else "right"


def wrong_numbers(found: VehicleFit, vehicle: Vehicle) -> list[str]:
    """Return the numbers from the log that are wrong without a word."""
    true = truth(vehicle)
    told = {number.key: number for number in found.numbers if number.source == "log"}
    return [
        f"{key} {number.low:.4g} to {number.high:.4g}, true {true[key]:.4g}"
        for key, number in told.items()
        if key in true and not is_right(number, true[key])
    ]


def main() -> int:
    """Print how each fit ends. Return 1 if one is wrong without a word."""
    parser = argparse.ArgumentParser(prog="python -m tests.identify.mistakes", description=__doc__)
    parser.add_argument("vehicles", type=int, help="number of vehicles")
    parser.add_argument("--first", type=int, default=0, help="vehicle to begin with")
    args = parser.parse_args()
    ends: Counter[str] = Counter()
    for seed in range(args.first, args.vehicles):
        for mistake in MISTAKES:
            end = verdict(seed, mistake)
            ends[end.partition(":")[0]] += 1
            print(f"{seed:3} {mistake:<46}{end}", flush=True)
    print(dict(ends))
    return 1 if ends["WRONG"] else 0


if __name__ == "__main__":
    sys.exit(main())
