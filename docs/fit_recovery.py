"""The table of fit_results.md: how well fits of generated logs find the numbers of known vehicles.

Each vehicle flies the manoeuvres of `race fly --excite` once, with motors that answer 20 ms late
and slow down as the battery sags, which the flight controller does not correct. Each seed draws the
noise of motion capture and inertial sensor anew. The fits continue where they were interrupted:

    .venv/bin/python docs/fit_recovery.py --seeds 20
    .venv/bin/python docs/fit_recovery.py --seeds 100 --vehicles swift --jobs 2
    .venv/bin/python docs/fit_recovery.py --table
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from math import hypot
from pathlib import Path
from time import process_time
from typing import NamedTuple

import numpy as np

from quadsim.config.resolve import EXCITATION
from quadsim.controllers.excitation import ENDS, Excitation
from quadsim.course import load_course
from quadsim.dynamics.allocation import PerRotor
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.quadrotor import State
from quadsim.dynamics.rotors import SOUND, Motors, RotorHealth
from quadsim.identify import VehicleFit, fit_vehicle
from quadsim.logs.cleaning import cleaned
from quadsim.logs.flight_log import FlightLog
from quadsim.logs.raw_log import RawLog
from quadsim.logs.resampling import interpolated
from quadsim.physics.actuators import Actuators
from quadsim.physics.faults import FaultOfVehicle
from quadsim.physics.plant import RigidPlant
from quadsim.physics.plant_state import PlantState
from quadsim.rotation import Vec3
from quadsim.sensing.imu import Imu
from quadsim.sensing.pose import PoseSensor
from quadsim.sensing.sensing_file import load_sensing
from quadsim.streams import sensor_streams
from quadsim.vehicle import Rotors, Vehicle, load_vehicle
from quadsim.vehicle.scaling import KnownNumbers, scaled_vehicle

VEHICLES = ("swift", "kingfisher", "flightmare", "cpc", "crazyflie")
RUNS = Path("runs/fit_recovery")
DT = 1 / 400  # of the plant and of the inertial sensor [s]
CONTROL = 4  # steps of the plant in a period of the control
LATE = 0.02  # latency of the commands, and from a motor's command to its effect [s]
NOMINAL = 16.0  # voltage at which a rotor's full command is its full speed [V]
FULL = 16.8  # voltage at the start [V]
FADE = 0.02  # loss of voltage per time [V/s]
SAG = 0.8  # loss of voltage at full thrust [V]
VOLTAGE_NOISE = 0.02  # [V]
SHARES = (0.5, 0.75, 1.0)  # of the full command, at which thrust maps are compared


class Flight(NamedTuple):
    """The true course of one flight of manoeuvres, a row for each step of the plant."""

    states: np.ndarray  # in the order of State  (n, 14)
    commands: np.ndarray  # body rates [rad/s] and thrust [m/s^2]  (n, 4)
    motors: np.ndarray  # commands of the motors, 0 to 1  (n, 4)
    voltage: np.ndarray  # [V]  (n,)


# key of a number -> value, limits of the interval, source
Fitted = Mapping[str, tuple[float, float, float, str]]


class Truth(NamedTuple):
    """The true value of a fitted number, and how a difference to it counts."""

    value: float
    bar: float  # largest error, relative


class BatteryMotors(Motors):
    """Motors that turn with the voltage of a battery, which the flight controller ignores."""

    def __init__(self, vehicle: Vehicle, rotors: Rotors, dt: float):
        """Begin with a full battery; the arguments are those of Motors."""
        super().__init__(vehicle, rotors, dt)
        self.voltage = FULL
        self.commands: PerRotor = (0.0,) * 4  # 0 to 1
        self._most = rotors.motor_omega_max
        self._full_thrust = 4.0 * rotors.thrust(rotors.motor_omega_max)
        self._loss = FADE * dt  # in a step [V]
        self._charge = FULL  # voltage without thrust [V]

    def follow(self, commands: Iterable[float], health: RotorHealth = SOUND) -> tuple[float, Vec3]:
        """Advance the rotors by one step; see Motors.follow."""
        asked = tuple(commands)
        a, b, c, d = (speed / self._most for speed in asked)
        self.commands = (a, b, c, d)
        ratio = self.voltage / NOMINAL
        force, torque = super().follow([ratio * speed for speed in asked], health)
        self._charge -= self._loss
        self.voltage = self._charge - SAG * force / self._full_thrust
        return force, torque


class BatteryActuators(Actuators):
    """Actuators with such motors."""

    def __init__(self, vehicle: Vehicle, dt: float, faults: Sequence[FaultOfVehicle] = ()):
        """See Actuators."""
        super().__init__(vehicle, dt, faults)
        assert vehicle.rotors
        self.battery = self.motors = BatteryMotors(vehicle, vehicle.rotors, dt)


def flight_of(name: str) -> Flight:
    """Return the flight of a vehicle, which is flown once and then kept."""
    file = RUNS / f"{name}.npz"
    if not file.exists():
        RUNS.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(file, **flown(name)._asdict())
    return Flight(**np.load(file))


def flown(name: str) -> Flight:
    """Return the flight of a vehicle: manoeuvres on the true state in quadsim's rigid world."""
    vehicle = load_vehicle(name).but(latency=LATE)
    course = load_course(EXCITATION["course"])
    controller = Excitation(vehicle, course)
    actuators = BatteryActuators(vehicle, DT)
    plant = RigidPlant(course, vehicle, DT, actuators=lambda *_: actuators)
    rows = []
    u = controller.rest
    for k in range(round(ENDS[-1] / DT)):
        if k % CONTROL == 0:
            u, _ = controller.control(Estimate(plant.state.t, np.array(plant.state.x)))
        before = plant.state.x
        voltage = actuators.battery.voltage
        plant.step(u.tolist())
        rows.append((before, u, actuators.battery.commands, voltage))
    states, commands, motors, voltage = (np.array(column) for column in zip(*rows, strict=True))
    # A motor's command is logged one latency before it acts.
    early = round(LATE / DT)
    motors = np.concatenate([motors[early:], np.repeat(motors[-1:], early, axis=0)])
    return Flight(states, commands, motors, voltage)


def log_of(flight: Flight, seed: int) -> FlightLog:
    """Return what the sensors of mocap measure of a flight, on the inertial sensor's clock."""
    sensing = load_sensing("mocap")
    assert sensing.imu
    assert sensing.pose
    streams = sensor_streams(np.random.SeedSequence(seed))
    imu = Imu(replace(sensing.imu, rate=1 / DT), streams.imu)
    pose = PoseSensor(sensing.pose, streams.pose)
    inertial, poses = [], []
    for k, x in enumerate(flight.states):
        state = PlantState(k * DT, State(*x.tolist()), ())
        inertial.append(imu.sample(state))
        poses.append(pose.sample(state))
    inertial = inertial[1:]
    poses = [one for one in poses if one is not None]
    t = np.array([one.t for one in inertial])
    own = np.array([one.t for one in poses])
    noise = np.random.default_rng(seed).standard_normal(len(t))
    return cleaned(
        RawLog(
            f"seed {seed}",
            t,
            {
                "position": interpolated(t, own, np.array([one.position for one in poses])),
                "velocity": interpolated(t, own, np.array([one.velocity for one in poses])),
                "quaternion": interpolated(t, own, np.array([one.attitude for one in poses])),
                "body_rates": np.array([one.gyro for one in inertial]),
                "specific_force": np.array([one.specific_force for one in inertial]),
                "motor_commands": flight.motors[1:],
                "rate_setpoints": flight.commands[1:, :3],
                "thrust_setpoint": flight.commands[1:, 3],
                "battery": flight.voltage[1:] + VOLTAGE_NOISE * noise,
            },
        )
    )


def truths(name: str, flight: Flight) -> dict[str, Truth]:
    """Return the true numbers by their keys in a fit."""
    vehicle = load_vehicle(name)
    rotors = vehicle.rotors
    assert rotors
    # A fit refers to the median voltage.
    ratio = float(np.median(flight.voltage)) / NOMINAL
    speed = rotors.motor_omega_max * ratio
    found = {
        f"thrust at {share:.0%}": Truth(4.0 * rotors.thrust(share * speed) / vehicle.mass, 0.02)
        for share in SHARES
    }
    found["rotors.motor_tau"] = Truth(rotors.motor_tau, 0.02)
    found["motor_delay"] = Truth(LATE, 0.02)
    arm_x, arm_y = rotors.positions[2]
    for axis, moment, arm in zip("xyz", vehicle.inertia, (arm_y, arm_x, rotors.kappa), strict=True):
        found[f"inertia_over_arm.{axis}"] = Truth(moment / (vehicle.mass * arm), 0.05)
    for axis, drag in zip("xyz", vehicle.drag, strict=True):
        found[f"drag.{axis}"] = Truth(drag, 0.05)
    for axis, lag in zip("xyz", vehicle.rate_tau, strict=True):
        # Torques, and with them the gain of the rate loop, grow with the square of the voltage.
        found[f"rate_tau.{axis}"] = Truth(lag / ratio**2, 0.02)
    found["latency"] = Truth(LATE, 0.02)
    return found


def fitted(name: str, seed: int) -> dict[str, object]:
    """Return the numbers of one fit with their limits, its remarks and its CPU time."""
    known = load_vehicle(name)
    assert known.rotors
    numbers = KnownNumbers(
        mass=known.mass,
        thrust_to_weight=known.thrust_to_weight,
        arm=hypot(*known.rotors.positions[0]),
    )
    log = log_of(flight_of(name), seed)
    begin = process_time()
    fit = fit_vehicle([log], base=start_of(known, numbers), mass=known.mass, name=name)
    took = process_time() - begin
    rows = {n.key: (n.value, n.low, n.high, n.source) for n in fit.numbers}
    return {"numbers": {**rows, **thrusts(fit)}, "remarks": fit.remarks, "cpu": took}


def start_of(known: Vehicle, numbers: KnownNumbers) -> Vehicle:
    """Return the vehicle that its owner would start from: that of `race vehicle`."""
    start = scaled_vehicle(numbers, "start").vehicle
    # The arms are measured, too.
    assert known.rotors
    x, y = known.rotors.positions[2]
    return start.but(rotors={"rotor_x": x, "rotor_y": y})


def thrusts(fit: VehicleFit) -> Fitted:
    """Return the fitted thrusts over the mass at some shares of the full command."""
    rotors = fit.vehicle.rotors
    assert rotors
    full = fit["thrust_max"]
    found = {}
    for share in SHARES:
        value = 4.0 * rotors.thrust(share * rotors.motor_omega_max) / fit.vehicle.mass
        low, high = (value * limit / full.value for limit in (full.low, full.high))
        found[f"thrust at {share:.0%}"] = (value, low, high, full.source)
    return found


def keep(name: str, seed: int) -> str:
    """Fit a seed unless it has been, keep what is found, and return a line on it."""
    file = RUNS / f"{name}_{seed}.json"
    if not file.exists():
        file.write_text(json.dumps(fitted(name, seed)))
    return f"{name} {seed}: {json.loads(file.read_text())['cpu']:.1f} s of CPU"


def table(names: Sequence[str]) -> Iterator[str]:
    """Yield the table: largest error of each number, and how many intervals have the true one.

    Args:
        names: vehicles, a column each.
    """
    known = {name: fits_of(name) for name in names}
    true = {name: truths(name, flight_of(name)) for name in names}
    yield ", ".join(f"{name}: {len(fits)} seeds" for name, fits in known.items())
    yield ""
    yield f"| number | {' | '.join(names)} | bar | intervals with the true number |"
    yield f"|---|{'---|' * len(names)}---|---|"
    for key, one in true[names[0]].items():
        told = [(true[name][key], _told(key, known[name])) for name in names]
        cells = [_largest(number, rows) for number, rows in told]
        covered = [low <= number.value <= high for number, rows in told for _, low, high in rows]
        share = f"{sum(covered)} of {len(covered)}"
        yield f"| {key} | {' | '.join(cells)} | {100.0 * one.bar:g} % | {share} |"


def fits_of(name: str) -> list[Fitted]:
    """Return the numbers of the fits of a vehicle that were kept."""
    files = sorted(RUNS.glob(f"{name}_*.json"))
    return [json.loads(file.read_text())["numbers"] for file in files]


def _told(key: str, fits: Sequence[Fitted]) -> list[tuple[float, float, float]]:
    """Return a number and its limits in each fit whose log tells it."""
    return [(fit[key][0], fit[key][1], fit[key][2]) for fit in fits if fit[key][3] == "log"]


def _largest(true: Truth, rows: Sequence[tuple[float, float, float]]) -> str:
    """Return the largest error of a number: in per cent, or itself if the number is 0."""
    if not rows:
        return "not determined"
    largest = max((value - true.value for value, _, _ in rows), key=abs)
    return f"{100.0 * largest / true.value:+.2f} %" if true.value else f"{largest:+.4f}"


def main() -> None:
    """Fit what is asked for and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20, help="noise is drawn from 0 to SEEDS - 1")
    parser.add_argument("--vehicles", nargs="+", default=VEHICLES, metavar="NAME")
    parser.add_argument("--jobs", type=int, default=1, help="fits at once")
    parser.add_argument("--table", action="store_true", help="print the table alone")
    given = parser.parse_args()
    if unknown := [name for name in given.vehicles if name not in VEHICLES]:
        parser.error(f"--vehicles: expected some of {', '.join(VEHICLES)}, got {unknown[0]!r}")
    if not given.table:
        for name in given.vehicles:
            flight_of(name)
        pairs = [(name, seed) for seed in range(given.seeds) for name in given.vehicles]
        with ProcessPoolExecutor(given.jobs) as pool:
            for said in pool.map(keep, *zip(*pairs, strict=True)):
                print(said, file=sys.stderr)
    print(*table(given.vehicles), sep="\n")


if __name__ == "__main__":
    main()
