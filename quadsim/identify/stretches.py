"""Stretches: readings of a log without a gap, on one uniform clock, ready for a fit.

A log may have its pose at 100 Hz beside its gyro at 1 kHz, and a clock with jitter. A command is
held until the next one. Measured signals are interpolated, and are missing over gaps. Two signals
are derived if a log lacks them: the velocity from the position, the body rates from the attitude.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from math import sqrt

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import savgol_filter

from quadsim.logs.flight_log import FlightLog
from quadsim.rotation import quaternion_rate, without_jumps

SHORTEST = 1.0  # a shorter stretch is left out [s]
LONGEST_HOLE = 0.06  # missing readings of a measured signal are interpolated over this time [s]
LONGEST_HOLD = 0.25  # a missing command is the one before it for this time [s]
LEAST_RATE = 250.0  # logs with more rows are thinned to this rate or more [Hz]
MAD = 1.4826  # standard deviation of a normal distribution over its median absolute deviation
PLANT_STEP = 1 / 400  # of quadsim's plants; real vehicles move continuously [s]
JITTER = 0.01  # relative error of a log's clock
SMOOTH = 0.05  # time over which a velocity is smoothed [s]
# A voltage is averaged, over a time as short as this noise of its mean permits: it sags within
# hundredths of a second when the thrust rises.
VOLTAGE_NOISE = 0.003  # relative standard deviation
SMOOTH_VOLTAGE = 0.1  # longest time over which a voltage is averaged [s]
# A vehicle flies while its motors' mean command, averaged over this time, is above this share of
# the median of the commands that turn its rotors.
FLYING_TIME = 0.3  # [s]
FLYING_SHARE = 0.5
TURNING = 0.05
LEAST_HEIGHT = 0.15  # above the lowest position: nearer, the ground changes the thrust [m]


@dataclass(frozen=True, eq=False)
class Stretch:
    """Readings of one log at equal steps of time; a signal that the log lacks is None.

    The names and units are the log's. Missing readings are NaN.
    """

    log: str
    start: float  # in the log [s]
    dt: float  # [s]
    thinned: int  # rows of the log in one of the stretch
    motor_commands: np.ndarray | None  # (n, 4)
    rotor_speeds: np.ndarray | None  # (n, 4)
    battery: np.ndarray | None  # (n,)
    rate_setpoints: np.ndarray | None  # (n, 3)
    thrust_setpoint: np.ndarray | None  # (n,)
    throttle: np.ndarray | None  # (n,)
    specific_force: np.ndarray | None  # (n, 3)
    body_rates: np.ndarray | None  # (n, 3)
    position: np.ndarray | None  # (n, 3)
    velocity: np.ndarray | None  # (n, 3)
    quaternion: np.ndarray | None  # (n, 4)
    flying: np.ndarray  # (n,)

    def __len__(self) -> int:
        """Return the number of readings."""
        return len(self.flying)

    @property
    def duration(self) -> float:
        """The time of the stretch [s]."""
        return len(self) * self.dt

    @property
    def plant_step(self) -> float:
        """The step of time in which the vehicle moves, at most a row of the log [s]."""
        return min(self.dt / self.thinned, PLANT_STEP)

    @property
    def has_all_commands(self) -> bool:
        """Whether the log has a row for each step of a plant, between which no command changes."""
        return self.dt / self.thinned < (1.0 + JITTER) * PLANT_STEP


def stretches(log: FlightLog) -> list[Stretch]:
    """Return the stretches of a log in which the vehicle flies at least part of the time.

    They have all rows of the log, see `thinned`.
    """
    found = []
    for piece in log.pieces:
        t = log.t[piece]
        if len(t) < 2 or t[-1] - t[0] < SHORTEST:
            continue
        stretch = _stretch(log, piece)
        if np.sum(stretch.flying) * stretch.dt >= SHORTEST:
            found.append(stretch)
    return found


def _stretch(log: FlightLog, piece: slice) -> Stretch:
    """Return one piece of a log on a uniform clock."""
    t = log.t[piece]
    dt = float(np.median(np.diff(t)))
    clock = t[0] + dt * np.arange(int((t[-1] - t[0]) / dt + 1e-6) + 1)

    def held(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else _held(t, values[piece], clock)

    def measured(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else _interpolated(t, values[piece], clock)

    quaternion = measured(_turning(log.quaternion))
    if quaternion is not None:
        quaternion = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    position = measured(log.position)
    velocity = measured(log.velocity)
    if velocity is None and position is not None:
        velocity = _derivative(position, dt)
    elif velocity is not None:
        velocity = _smoothed(velocity, dt)
    body_rates = measured(log.body_rates)
    if body_rates is None and quaternion is not None:
        body_rates = _turn_rates(quaternion, dt)
    battery = held(log.battery)
    if battery is not None:
        battery = _calm_voltage(battery, dt)
    motor_commands = held(log.motor_commands)
    rotor_speeds = measured(log.rotor_speeds)
    thrust_setpoint = held(log.thrust_setpoint)
    throttle = held(log.throttle)
    drive = next(
        (
            each
            for each in (motor_commands, rotor_speeds, thrust_setpoint, throttle)
            if each is not None
        ),
        np.ones(len(clock)),
    )
    return Stretch(
        log=log.name,
        start=float(t[0]),
        dt=dt,
        thinned=1,
        motor_commands=motor_commands,
        rotor_speeds=rotor_speeds,
        battery=battery,
        rate_setpoints=held(log.rate_setpoints),
        thrust_setpoint=thrust_setpoint,
        throttle=throttle,
        specific_force=measured(log.specific_force),
        body_rates=body_rates,
        position=position,
        velocity=velocity,
        quaternion=quaternion,
        flying=_flying(drive, position, dt),
    )


def _calm_voltage(voltage: np.ndarray, dt: float) -> np.ndarray:
    """Return a moving average of a voltage, whose window reduces its noise to VOLTAGE_NOISE."""
    steps = np.abs(np.diff(voltage))
    if not np.any(np.isfinite(steps)):
        return voltage
    noise = MAD * float(np.nanmedian(steps)) / sqrt(2.0) / float(np.nanmedian(voltage))
    wanted = (noise / VOLTAGE_NOISE) ** 2 * dt
    window = min(_odd(wanted, dt), _odd(SMOOTH_VOLTAGE, dt))
    return uniform_filter1d(voltage, window, mode="nearest") if window > 1 else voltage


def _turning(values: np.ndarray | None) -> np.ndarray | None:
    """Return attitudes whose signs do not change, so that they can be interpolated."""
    if values is None:
        return None
    known = np.all(np.isfinite(values), axis=1)
    turning = np.full(values.shape, np.nan)
    turning[known] = without_jumps(values[known])
    return turning


def _held(t: np.ndarray, values: np.ndarray, clock: np.ndarray) -> np.ndarray:
    """Return the last known reading at each time of the clock, NaN if it is too old."""
    known = np.isfinite(values if values.ndim == 1 else values.sum(axis=1))
    if not np.any(known):
        return np.full((len(clock), *values.shape[1:]), np.nan)
    t = t[known]
    # A reading that is later by less than half a step of a trembling clock is the one of this time.
    half = 0.5 * (clock[1] - clock[0])
    last = np.searchsorted(t, clock + half, side="right") - 1
    result = values[known][np.maximum(last, 0)].astype(float)
    result[(last < 0) | (clock - t[np.maximum(last, 0)] > LONGEST_HOLD)] = np.nan
    return result


def _interpolated(t: np.ndarray, values: np.ndarray, clock: np.ndarray) -> np.ndarray:
    """Return a measured signal at each time of the clock, NaN in its holes."""
    known = np.isfinite(values if values.ndim == 1 else values.sum(axis=1))
    result = np.full((len(clock), *values.shape[1:]), np.nan)
    if np.sum(known) < 2:
        return result
    t = t[known]
    values = values[known]
    after = np.clip(np.searchsorted(t, clock), 1, len(t) - 1)
    before = after - 1
    share = (clock - t[before]) / (t[after] - t[before])
    tolerance = 0.5 * (clock[1] - clock[0]) / (t[after] - t[before])
    within = (share >= -tolerance) & (share <= 1.0 + tolerance)
    short = t[after] - t[before] <= LONGEST_HOLE
    share = share if values.ndim == 1 else share[:, None]
    mixed = values[before] + share * (values[after] - values[before])
    usable = within & short
    result[usable] = mixed[usable]
    return result


def _odd(time: float, dt: float) -> int:
    """Return the odd number of readings nearest to a time, at least one."""
    return 2 * round(0.5 * time / dt) + 1


def _smoothed(values: np.ndarray, dt: float) -> np.ndarray:
    """Return a signal smoothed by parabolas, which do not flatten its peaks as means do."""
    window = _odd(SMOOTH, dt)
    if not 3 < window <= len(values):
        return values
    return _parabolas(values, window, dt)


def _derivative(position: np.ndarray, dt: float) -> np.ndarray:
    """Return the velocity, the slope of a parabola through the positions around each. [m/s]"""
    window = max(_odd(2.0 * SMOOTH, dt), 5)
    if len(position) < window:
        return np.full_like(position, np.nan)
    return _parabolas(position, window, dt, deriv=1)


def _parabolas(values: np.ndarray, window: int, dt: float, deriv: int = 0) -> np.ndarray:
    """Return the value or the slope at each reading of a parabola through those around it.

    At both ends of a signal with missing readings it is missing, too.
    """
    ends = "interp" if np.isfinite(values).all() else "constant"
    found = savgol_filter(values, window, 2, deriv=deriv, delta=dt, axis=0, mode=ends, cval=np.nan)
    return np.asarray(found)


def _turn_rates(quaternion: np.ndarray, dt: float) -> np.ndarray:
    """Return the body rates, the turns between attitudes divided by time. [rad/s]"""
    slope = _derivative(quaternion, dt)
    w, x, y, z = quaternion.T
    # q' = q x (0, omega) / 2, so that omega = 2 (conjugate of q) x q'.
    dw, dx, dy, dz = slope.T
    ux, uy, uz = quaternion_rate((w, -x, -y, -z), (dx, dy, dz))[1:]
    return 2.0 * np.stack([ux - x * dw, uy - y * dw, uz - z * dw], axis=1)


def _flying(drive: np.ndarray, position: np.ndarray | None, dt: float) -> np.ndarray:
    """Return when the vehicle flies freely: its rotors carry it, and the ground is not near."""
    mean = np.nan_to_num(drive if drive.ndim == 1 else drive.mean(axis=1))
    turning = mean[mean > TURNING * np.max(mean)]
    level = FLYING_SHARE * np.median(turning) if len(turning) else np.inf
    flying = uniform_filter1d(mean, _odd(FLYING_TIME, dt), mode="nearest") >= level
    if position is not None:
        height = position[:, 2] - np.nanmin(position[:, 2])
        grounded = ~flying
        # Without a time on the ground, the lowest position says nothing.
        if np.any(grounded):
            flying &= ~(height < LEAST_HEIGHT)
    return flying


def thinned(part: Stretch, least_rate: float = LEAST_RATE) -> Stretch:
    """Return a stretch with fewer rows, at a rate [Hz] or more.

    Commands are averaged over the time in which they act, from a row to the next; what is measured,
    around the row.
    """
    rows = int(1.0 / (part.dt * least_rate) + 1e-6)
    if rows <= 1:
        return part
    count = len(part) // rows

    def ahead(values: np.ndarray | None) -> np.ndarray | None:
        if values is None:
            return None
        return values[: count * rows].reshape(count, rows, *values.shape[1:]).mean(axis=1)

    def around(values: np.ndarray | None) -> np.ndarray | None:
        if values is None:
            return None
        half = (rows // 2, (rows - 1) // 2)
        ends = np.pad(values, (half, *((0, 0),) * (values.ndim - 1)), mode="edge")
        # An even number of rows is half a row off the middle: the outer ones count half.
        if rows % 2 == 0:
            ends = 0.5 * (ends[:-1] + ends[1:])
            ends = np.concatenate([ends, ends[-1:]])
        means = np.mean([ends[k : k + len(values)] for k in range(rows)], axis=0)
        return means[: count * rows : rows]

    quaternion = around(part.quaternion)
    if quaternion is not None:
        quaternion = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    return replace(
        part,
        dt=rows * part.dt,
        thinned=rows,
        motor_commands=ahead(part.motor_commands),
        rotor_speeds=around(part.rotor_speeds),
        battery=ahead(part.battery),
        rate_setpoints=ahead(part.rate_setpoints),
        thrust_setpoint=ahead(part.thrust_setpoint),
        throttle=ahead(part.throttle),
        specific_force=around(part.specific_force),
        body_rates=around(part.body_rates),
        position=around(part.position),
        velocity=around(part.velocity),
        quaternion=quaternion,
        flying=part.flying[: count * rows].reshape(count, rows).all(axis=1),
    )


def cropped(part: Stretch, rows: slice) -> Stretch:
    """Return some rows of a stretch."""
    changes = {
        field.name: value[rows]
        for field in fields(part)
        if isinstance(value := getattr(part, field.name), np.ndarray)
    }
    return replace(part, start=part.start + (rows.start or 0) * part.dt, **changes)


def total_time(parts: Sequence[Stretch]) -> float:
    """Return the time in flight of some stretches [s]."""
    return sum(float(np.sum(part.flying)) * part.dt for part in parts)
