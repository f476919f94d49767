"""The least-squares problem: what the numbers predict of a log, against what it measured.

    speed of a rotor      s = lag(command (voltage / reference)^power)
    thrust over mass      a = sum of c2 s^2 + c1 s + c0 over the rotors
    accelerometer         a (tilt_x - flapping w_y, tilt_y + flapping w_x, 1) - d v_body + bias
    body rates            omega' = (signs a + offset sum a) / inertia - gyroscopic
    velocity              v' = R(q) (a (pose_tilt_x, pose_tilt_y, 1) - d v_body) - g e_z

Body rates and velocity are predicted over short open-loop pieces, each from an initial value of its
own (multiple shooting). As the pieces follow the measured attitude and rates, their initial values
enter linearly, and leave with the mean of the residuals of a piece.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np

from quadsim.identify.numbers import Numbers
from quadsim.identify.rotors import lagged, thrusts, torque_signs
from quadsim.identify.stretches import Stretch, cropped
from quadsim.physics.actuators import gyroscopic
from quadsim.rotation import to_body, to_world
from quadsim.vehicle import GRAVITY, Vehicle

PIECE = 0.25  # duration of a piece of body rates [s]
VELOCITY_PIECE = 1.0  # and of velocities [s]
CLUSTER = 1.0  # residuals within this time are taken as one reading for the intervals [s]
SETTLED = 0.3  # time after the begin of a stretch in which the speeds of the rotors are not known [s]
MOST_ROWS = 10_000  # of each signal; in longer logs, neighbouring residuals are averaged
LONGEST_MEAN = 0.02  # neighbours are averaged over this time at most [s]

Drive = Literal["motor_commands", "rotor_speeds", "thrust_setpoint", "throttle"]
# Drives that tell each rotor, and drives whose effect changes with the battery's voltage
SINGLE_DRIVES = ("motor_commands", "rotor_speeds")
VOLTAGE_DRIVES = ("motor_commands", "throttle")


class Geometry(NamedTuple):
    """What a log does not tell of the torques; of the prior vehicle."""

    signs: np.ndarray  # of the rotors' thrusts in the torques about x, y, z  (3, 4)
    arm_x: float  # of the rotors [m]
    arm_y: float
    # inertia about z over the mean of the other two
    flatness: float

    @classmethod
    def of(cls, vehicle: Vehicle) -> Geometry:
        """Return the geometry of a vehicle with rotors."""
        assert vehicle.rotors
        x, y = vehicle.rotors.positions[2]
        jx, jy, jz = vehicle.inertia
        return cls(torque_signs(vehicle.rotors), x, y, 2.0 * jz / (jx + jy))

    def inertia(self, numbers: Numbers) -> tuple[float, float, float]:
        """Return the inertia over the mass [m^2]."""
        jx = numbers.inertia_x * self.arm_y
        jy = numbers.inertia_y * self.arm_x
        return jx, jy, 0.5 * self.flatness * (jx + jy)


class Residuals(NamedTuple):
    """Residuals of one kind in one stretch."""

    kind: str
    values: np.ndarray  # (m,)
    cluster: np.ndarray  # number of the cluster of each, within its stretch  (m,)


class Prepared(NamedTuple):
    """A stretch with what does not depend on the numbers."""

    stretch: Stretch
    ratio: np.ndarray  # voltage over the reference  (n,)
    usable: np.ndarray  # flying, settled, and the motors known  (n,)
    drive: Drive
    command: np.ndarray  # what drives the rotors, in shares of the full command  (n, 4)
    v_body: np.ndarray | None  # (n, 3)
    mean_rows: int  # neighbouring residuals that are averaged


def reference_voltage(parts: Sequence[Stretch]) -> float | None:
    """Return the median voltage in flight, None if a log lacks it. [V]"""
    if any(part.battery is None for part in parts):
        return None
    values = np.concatenate([part.battery[part.flying] for part in parts if part.battery is not None])
    values = values[np.isfinite(values) & (values > 0.0)]
    return float(np.median(values)) if len(values) else None


def drive_of(part: Stretch) -> Drive | None:
    """Return what a log tells of the rotors, the nearest to them first; None for nothing."""
    if part.motor_commands is not None:
        return "motor_commands"
    if part.rotor_speeds is not None:
        return "rotor_speeds"
    if part.thrust_setpoint is not None:
        return "thrust_setpoint"
    return None if part.throttle is None else "throttle"


def _command(part: Stretch, drive: Drive, base: Vehicle) -> np.ndarray:
    """Return the commands of the rotors in shares of the full one, NaN where missing  (n, 4)."""
    assert base.rotors
    if drive == "motor_commands":
        assert part.motor_commands is not None
        return part.motor_commands
    if drive == "rotor_speeds":
        assert part.rotor_speeds is not None
        return part.rotor_speeds / base.rotors.omega_max
    if drive == "thrust_setpoint":
        # The flight controller asks each rotor for a quarter, by the prior's thrust map.
        assert part.thrust_setpoint is not None
        share = np.sqrt(np.clip(part.thrust_setpoint / base.thrust_max, 0.0, 1.0))
    else:
        assert part.throttle is not None
        share = part.throttle
    return np.repeat(share[:, None], 4, axis=1)


def prepared(
    part: Stretch, drive: Drive, base: Vehicle, reference: float | None, mean_rows: int
) -> Prepared:
    """Return a stretch with what does not depend on the numbers.

    Args:
        part: the stretch.
        drive: what drives the rotors.
        base: the prior vehicle.
        reference: voltage to which the numbers refer [V]; None: the log has no voltage.
        mean_rows: neighbouring residuals that are averaged.
    """
    ratio = np.ones(len(part))
    # Speeds are what they are, whatever the voltage.
    if reference is not None and part.battery is not None and drive in VOLTAGE_DRIVES:
        ratio = np.where(part.battery > 0.0, part.battery / reference, np.nan)
    ratio = np.where(np.isfinite(ratio), ratio, 1.0)
    command = _command(part, drive, base)
    usable = part.flying & np.all(np.isfinite(command), axis=1)
    usable[: round(SETTLED / part.dt)] = False
    v_body = None
    if part.velocity is not None and part.quaternion is not None:
        v_body = np.stack(to_body(part.quaternion.T, part.velocity.T), axis=1)
    return Prepared(part, ratio, usable, drive, _filled(command), v_body, mean_rows)


def beginning(part: Prepared, time: float) -> Prepared:
    """Return the first rows of a stretch in flight.

    Args:
        part: the stretch.
        time: duration of what is returned [s].
    """
    first = int(np.argmax(part.usable))
    rows = slice(first, first + round(time / part.stretch.dt))
    return part._replace(
        stretch=cropped(part.stretch, rows),
        ratio=part.ratio[rows],
        usable=part.usable[rows],
        command=part.command[rows],
        v_body=None if part.v_body is None else part.v_body[rows],
    )


def rows_to_average(parts: Sequence[Stretch]) -> int:
    """Return how many neighbouring residuals are averaged."""
    rows = sum(len(part) for part in parts)
    dt = min(part.dt for part in parts)
    return max(min(round(rows / MOST_ROWS), int(LONGEST_MEAN / dt)), 1)


def rotor_speeds(part: Prepared, numbers: Numbers) -> np.ndarray:
    """Return the speeds of the rotors, in shares of the full command  (n, 4)."""
    if part.drive == "rotor_speeds":
        return part.command
    command = part.command * (part.ratio**numbers.voltage_power)[:, None]
    return lagged(command, part.stretch.dt, numbers.tau, numbers.delay)


def _filled(values: np.ndarray) -> np.ndarray:
    """Return a signal whose missing readings are those before them."""
    known = np.all(np.isfinite(values), axis=1)
    if np.all(known):
        return values
    last = np.maximum.accumulate(np.where(known, np.arange(len(values)), 0))
    return np.nan_to_num(values[last])


def residuals(part: Prepared, numbers: Numbers, geometry: Geometry) -> Iterator[Residuals]:
    """Yield the residuals of one stretch, measured minus predicted.

    Args:
        part: the stretch.
        numbers: numbers that predict it.
        geometry: what is not fitted.
    """
    single = thrusts(rotor_speeds(part, numbers), numbers)
    total = single.sum(axis=1)
    stretch = part.stretch
    if stretch.specific_force is not None:
        yield from _force_residuals(part, numbers, total)
    if stretch.body_rates is not None and part.drive in SINGLE_DRIVES:
        yield from _rate_residuals(part, numbers, geometry, single)
    if part.v_body is not None:
        yield from _velocity_residuals(part, numbers, total)


def drag_acceleration(v_body: np.ndarray, numbers: Numbers) -> np.ndarray:
    """Return the acceleration by the drag, in the body's axes [m/s^2]  (n, 3)."""
    return -v_body * np.array([numbers.drag_x, numbers.drag_y, numbers.drag_z])


def _force_residuals(part: Prepared, numbers: Numbers, total: np.ndarray) -> Iterator[Residuals]:
    """Yield the residuals of the accelerometer."""
    force = part.stretch.specific_force
    assert force is not None
    axis = np.array([numbers.tilt_x, numbers.tilt_y, 1.0])
    predicted = total[:, None] * axis + (numbers.bias_x, numbers.bias_y, numbers.bias_z)
    # Without a velocity the drag is not known, and the sides of the accelerometer tell nothing.
    axes = "z"
    if part.v_body is not None:
        predicted += drag_acceleration(part.v_body, numbers)
        axes = "xyz"
        if part.stretch.body_rates is not None:
            x, y, _ = part.stretch.body_rates.T
            side = numbers.flapping * total
            predicted[:, 0] -= side * y
            predicted[:, 1] += side * x
    missing = force - predicted
    usable = part.usable & np.all(np.isfinite(missing), axis=1)
    for name in axes:
        values = missing[:, "xyz".index(name)]
        yield from _pieces(part, f"force_{name}", values, usable, PIECE, is_free=False)


def _rate_residuals(
    part: Prepared, numbers: Numbers, geometry: Geometry, single: np.ndarray
) -> Iterator[Residuals]:
    """Yield the residuals of the body rates, from the thrusts of the rotors  (n, 4)."""
    stretch = part.stretch
    rates = stretch.body_rates
    assert rates is not None
    known = np.all(np.isfinite(rates), axis=1)
    beta = angular_accelerations(np.nan_to_num(rates), single, numbers, geometry)
    # As the plants do, the rates of a row are those before it and the acceleration of this row.
    predicted = np.cumsum(beta, axis=0) * stretch.dt - numbers.gyro_lag * beta
    for k, name in enumerate("xyz"):
        values = rates[:, k] - predicted[:, k]
        yield from _pieces(part, f"rate_{name}", values, part.usable & known, PIECE, is_free=True)


def angular_accelerations(
    rates: np.ndarray, single: np.ndarray, numbers: Numbers, geometry: Geometry
) -> np.ndarray:
    """Return the angular accelerations by the rotors [rad/s^2]  (n, 3).

    Args:
        rates: body rates [rad/s]  (n, 3).
        single: thrusts of the rotors over the mass [m/s^2]  (n, 4).
        numbers: with the inertia.
        geometry: what is not fitted.
    """
    over_arm = np.array([numbers.inertia_x, numbers.inertia_y, numbers.inertia_z])
    offset = np.array([numbers.offset_x, numbers.offset_y, numbers.offset_z])
    torque = single @ geometry.signs.T + single.sum(axis=1)[:, None] * offset
    inertia = geometry.inertia(numbers)
    gyro = np.stack(gyroscopic(tuple(rates.T), inertia), axis=1) / np.array(inertia)
    return torque / over_arm - gyro


def _velocity_residuals(part: Prepared, numbers: Numbers, total: np.ndarray) -> Iterator[Residuals]:
    """Yield the residuals of the velocity, along the measured attitude."""
    stretch = part.stretch
    assert part.v_body is not None
    assert stretch.quaternion is not None
    assert stretch.velocity is not None
    known = np.all(np.isfinite(part.v_body), axis=1)
    acceleration = world_acceleration(total, np.nan_to_num(stretch.quaternion), np.nan_to_num(part.v_body), numbers)
    predicted = np.cumsum(acceleration, axis=0) * stretch.dt - numbers.velocity_lag * acceleration
    for k, name in enumerate("xyz"):
        values = stretch.velocity[:, k] - predicted[:, k]
        usable = part.usable & known
        yield from _pieces(part, f"velocity_{name}", values, usable, VELOCITY_PIECE, is_free=True)


def world_acceleration(
    total: np.ndarray, quaternion: np.ndarray, v_body: np.ndarray, numbers: Numbers
) -> np.ndarray:
    """Return the acceleration in the world [m/s^2]  (n, 3).

    Args:
        total: thrust over mass [m/s^2]  (n,).
        quaternion: measured attitude  (n, 4).
        v_body: velocity in the body's axes [m/s]  (n, 3).
        numbers: with drag and the direction of the thrust.
    """
    axis = np.array([numbers.pose_tilt_x, numbers.pose_tilt_y, 1.0])
    body = total[:, None] * axis + drag_acceleration(v_body, numbers)
    world = np.stack(to_world(quaternion.T, body.T), axis=1)
    world[:, 2] -= GRAVITY
    return world


def _pieces(
    part: Prepared, kind: str, values: np.ndarray, usable: np.ndarray, time: float, *, is_free: bool
) -> Iterator[Residuals]:
    """Yield the residuals of whole usable pieces, averaged, and without their mean if it is free."""
    dt = part.stretch.dt
    average = part.mean_rows
    length = max(round(time / dt / average), 2) * average
    count = len(values) // length
    if not count:
        return
    whole = usable[: count * length].reshape(count, length).all(axis=1)
    if not np.any(whole):
        return
    rows = values[: count * length].reshape(count, length // average, average)[whole].mean(axis=2)
    if is_free:
        rows = rows - rows.mean(axis=1, keepdims=True)
    begins = np.flatnonzero(whole) * length * dt
    cluster = np.repeat((begins / CLUSTER).astype(int), rows.shape[1])
    yield Residuals(kind, rows.ravel(), cluster)
