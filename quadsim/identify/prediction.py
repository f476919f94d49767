"""Predictions: open-loop flights from many measured states, against the measured flight.

A flight of a second begins at each of many rows of a log, at the measured position and velocity,
and follows the logged commands. With the measured attitude the thrust acts along the attitude of
the log; with the simulated attitude the rotors turn the vehicle, too. Beside them stands the
simplest prediction, constant velocity.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from quadsim.identify.geometry import Geometry
from quadsim.identify.numbers import FitNumbers
from quadsim.identify.prepared import Prepared
from quadsim.identify.problem import (
    angular_accelerations,
    single_thrusts,
    torques,
    world_acceleration,
)
from quadsim.rotation import quaternion_rate, to_body

HORIZONS = (0.1, 0.25, 0.5, 1.0)  # [s]
ALL = "all"  # name of the row over all logs
BEGINS = 0.1  # time between the starts of two flights [s]


class Prediction(NamedTuple):
    """Root mean squares of the errors after some time, over many flights in one log."""

    log: str
    seconds: float  # since the start of a flight
    begins: int  # number of flights
    measured_attitude: float  # error of the position with it [m]
    simulated_attitude: float | None  # the same; None: the log tells no torques
    constant_velocity: float  # [m]
    attitude: float | None  # error of the simulated attitude [rad]
    rates: float | None  # error of the simulated body rates [rad/s]


class Paths(NamedTuple):
    """Predicted and measured states of the flights of one log, one after the other."""

    rows: np.ndarray  # of the stretch at each begin and step  (steps + 1, begins)
    measured: np.ndarray  # positions [m]  (steps + 1, begins, 3)
    along_measured: np.ndarray  # predicted positions with the measured attitude
    along_simulated: np.ndarray | None  # and with the simulated one
    constant: np.ndarray  # with constant velocity
    attitude: np.ndarray | None  # angle between simulated and measured attitude [rad]
    rates: np.ndarray | None  # error of the body rates [rad/s]  (steps + 1, begins, 3)


def predictions(
    parts: Sequence[Prepared], numbers: FitNumbers, geometry: Geometry, turning: Sequence[int]
) -> tuple[Prediction, ...]:
    """Return the errors of the predictions in each log.

    Args:
        parts: stretches of the logs.
        numbers: fitted parameters of the vehicle.
        geometry: arms and directions of the rotors, which are not fitted.
        turning: axes about which the torques are known; about the others the rates stay.
    """
    flown: list[tuple[str, Paths, float]] = []
    for part in parts:
        path = paths(part, numbers, geometry, turning)
        if path is not None:
            flown.append((part.stretch.log, path, part.stretch.dt))
    logs = list(dict.fromkeys(log for log, _, _ in flown))
    found = []
    for log in logs:
        mine = [(path, dt) for name, path, dt in flown if name == log]
        found += [_errors(log, seconds, mine) for seconds in HORIZONS]
    if len(logs) > 1:
        every = [(path, dt) for _, path, dt in flown]
        found += [_errors(ALL, seconds, every) for seconds in HORIZONS]
    return tuple(found)


def _errors(log: str, seconds: float, flown: Sequence[tuple[Paths, float]]) -> Prediction:
    """Return the errors after some seconds."""
    rows = [(path, round(seconds / dt)) for path, dt in flown]

    def rms(errors: Sequence[np.ndarray | None]) -> float | None:
        known = [each.reshape(-1, each.shape[-1]) for each in errors if each is not None]
        if not known:
            return None
        return float(np.sqrt(np.mean(np.sum(np.concatenate(known) ** 2, axis=1))))

    def position(predicted: Sequence[np.ndarray | None]) -> float | None:
        pairs = zip(predicted, rows, strict=True)
        return rms([None if p is None else p[k] - path.measured[k] for p, (path, k) in pairs])

    measured = position([path.along_measured for path, _ in rows])
    constant = position([path.constant for path, _ in rows])
    assert measured is not None
    assert constant is not None
    return Prediction(
        log=log,
        seconds=seconds,
        begins=sum(path.rows.shape[1] for path, _ in rows),
        measured_attitude=measured,
        simulated_attitude=position([path.along_simulated for path, _ in rows]),
        constant_velocity=constant,
        attitude=rms([None if p.attitude is None else p.attitude[k][:, None] for p, k in rows]),
        rates=rms([None if p.rates is None else p.rates[k] for p, k in rows]),
    )


def paths(
    part: Prepared, numbers: FitNumbers, geometry: Geometry, turning: Sequence[int]
) -> Paths | None:
    """Return the flights of one stretch, None if it has no pose or is too short."""
    stretch = part.stretch
    if part.attitude is None or part.v_body is None or stretch.position is None:
        return None
    dt = stretch.dt
    steps = round(HORIZONS[-1] / dt)
    usable = part.usable & part.has_pose & np.all(np.isfinite(stretch.position), axis=1)
    if stretch.body_rates is not None:
        usable &= np.all(np.isfinite(stretch.body_rates), axis=1)
    begins = np.arange(0, len(stretch) - steps, max(round(BEGINS / dt), 1))
    good = np.concatenate([[0], np.cumsum(~usable)])
    begins = begins[good[begins + steps + 1] == good[begins]]
    if not len(begins):
        return None
    rows = begins + np.arange(steps + 1)[:, None]
    single = single_thrusts(part, numbers)
    time = dt * np.arange(steps + 1)[:, None, None]
    start = stretch.position[begins]
    velocity = _begin_velocity(part, numbers, single)[begins]
    along_measured, _, _ = _flown(part, numbers, geometry, rows, single, velocity, None)
    along_simulated = attitude = rates = None
    if part.has_single and part.rates is not None:
        along_simulated, turned, rates = _flown(
            part, numbers, geometry, rows, single, velocity, turning
        )
        inner = np.abs(np.sum(turned * part.attitude[rows], axis=2))
        attitude = 2.0 * np.arccos(np.clip(inner, 0.0, 1.0))
        rates = rates - part.rates[rows]
    return Paths(
        rows=rows,
        measured=stretch.position[rows],
        along_measured=along_measured,
        along_simulated=along_simulated,
        constant=start + time * velocity,
        attitude=attitude,
        rates=rates,
    )


def _begin_velocity(part: Prepared, numbers: FitNumbers, single: np.ndarray) -> np.ndarray:
    """Return the velocity at each row, ahead of the measured one by its lag [m/s]  (n, 3)."""
    assert part.attitude is not None
    assert part.v_body is not None
    assert part.stretch.velocity is not None
    acceleration = world_acceleration(single.sum(axis=1), part.attitude, part.v_body, numbers)
    return part.stretch.velocity + numbers.velocity_lag * acceleration


def _flown(
    part: Prepared,
    numbers: FitNumbers,
    geometry: Geometry,
    rows: np.ndarray,
    single: np.ndarray,
    velocity: np.ndarray,
    turning: Sequence[int] | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions, attitudes and body rates of flights from many begins.

    In the plants' order: velocities by the forces of a step, then poses by the new velocities.

    Args:
        part: the stretch.
        numbers: what predicts.
        geometry: what is not fitted.
        rows: of the stretch at each step and begin  (steps + 1, begins).
        single: thrusts of the rotors over the mass [m/s^2]  (n, 4).
        velocity: at the begins [m/s]  (begins, 3).
        turning: axes about which the rotors turn the vehicle; None: it has the measured attitude.
    """
    assert part.attitude is not None
    assert part.stretch.position is not None
    dt = part.stretch.dt
    torque = torques(part, single, numbers, geometry)
    p = part.stretch.position[rows[0]]
    v = velocity
    q = part.attitude[rows[0]]
    omega = part.rates[rows[0]] if part.rates is not None else np.zeros_like(v)
    known = np.isin(np.arange(3), turning or ())
    positions = [p]
    attitudes = [q]
    body_rates = [omega]
    for now in rows[1:]:
        v_body = np.stack(to_body(q.T, v.T), axis=1)
        acceleration = world_acceleration(single[now].sum(axis=1), q, v_body, numbers)
        v = v + acceleration * dt
        p = p + v * dt
        if turning is not None:
            omega = (
                omega + known * angular_accelerations(omega, torque[now], numbers, geometry) * dt
            )
            half = 0.5 * dt * omega.T
            q = q + np.stack(quaternion_rate(tuple(q.T), tuple(half)), axis=1)
            q = q / np.linalg.norm(q, axis=1, keepdims=True)
        else:
            q = part.attitude[now]
        positions.append(p)
        attitudes.append(q)
        body_rates.append(omega)
    return np.stack(positions), np.stack(attitudes), np.stack(body_rates)
