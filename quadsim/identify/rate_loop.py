"""The rate loop: how the body rates follow their setpoints.

As the plants and the planner have it, a loop asks for the angular acceleration
(setpoint - rate) / tau_omega, and the rotors follow with their lag:

    omega' = beta,  beta' = (beta_cmd - beta) / tau_m,
    beta_cmd = (omega_cmd(t - delay) - omega) / tau_omega

The loop is stepped as often as the plants step it, several times in a row of a log: its gain
(1 - exp(-dt / tau)) / dt depends on the step. With steps of 5 ms, a lag of 50 ms would come out
2.4 % low.

The answer is linear in the setpoints and in where a piece begins. So each piece begins where it
fits best, which a projection finds without a search. Pieces with saturated motors are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import floor
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from quadsim.dynamics.first_order import response
from quadsim.identify.descent import Limits, descend
from quadsim.identify.prepared import Prepared
from quadsim.identify.search import LEAST_GAIN, MAD, Linearized
from quadsim.rotation import Vec3

PIECE = 0.5  # duration of an open-loop piece [s]
LAG = 0.1  # standard deviation of the prior of the lags [s]
DELAY = 0.1  # and of the delay [s]
SHORTEST = 2e-3
LONGEST = 2.0
LONGEST_DELAY = 0.3  # [s]
DELAYS = (0.005, 0.03, 0.08)  # where the search begins [s]
EDGE = 0.01  # commands this near to the lowest or highest are saturated
SATURATED = 0.02  # share of saturated rows from which on a piece is left out
LEAST_PIECES = 6
STEP = 1e-4  # of the finite differences, in standard deviations of the prior
TINY = 1e-4  # least distance of a start to a limit [s]
LEAST_NOISE = 1e-4  # [rad/s]
SECOND_DIFFERENCE = 6.0  # variance of the second difference of white noise, over the noise's


class RateLoopFit(NamedTuple):
    """The lags of the rate loop and the delay from a setpoint to its effect."""

    tau: Vec3  # [s]
    delay: float  # [s]
    linearized: Linearized


class _Axis(NamedTuple):
    """Setpoints and rates about one axis in pieces of one stretch."""

    axis: int
    dt: float
    steps: int  # of the loop in a row
    setpoints: np.ndarray  # whole stretch  (n,)
    rates: np.ndarray  # (n,)
    rows: np.ndarray  # of the usable pieces  (p, length)
    first: int  # number of the first piece


def fit_rate_loop(parts: Sequence[Prepared], rotor_lag: float, prior: Vec3) -> RateLoopFit | None:
    """Return the rate loop of a log with setpoints and rates, None if it tells none.

    Args:
        parts: the log.
        rotor_lag: lag of the rotors [s].
        prior: lags of a similar vehicle [s].
    """
    axes = _axes(parts)
    if len({axis.axis for axis in axes}) < 3:
        return None
    mean = np.array([*prior, 0.0])
    std = np.array([LAG, LAG, LAG, DELAY])
    low = np.array([SHORTEST, SHORTEST, SHORTEST, 0.0])
    high = np.array([LONGEST, LONGEST, LONGEST, LONGEST_DELAY])

    def errors(x: np.ndarray, noise: np.ndarray) -> np.ndarray:
        parts = [_residuals(axis, x, rotor_lag).ravel() / noise[axis.axis] for axis in axes]
        return np.concatenate(parts)

    # The best of the searches from several delays, in standard deviations of the prior
    noise = _noise([np.diff(axis.rates[axis.rows], n=2, axis=1) for axis in axes], axes)
    noise /= np.sqrt(SECOND_DIFFERENCE)

    def residuals(x: np.ndarray) -> np.ndarray:
        return errors(x * std, noise)

    def derivatives(x: np.ndarray, r: np.ndarray) -> np.ndarray:
        steps = STEP * np.eye(len(x))
        return np.stack([(residuals(x + step) - r) / STEP for step in steps], axis=1)

    limits = Limits(mean / std, low / std, high / std)
    ends = []
    for delay in DELAYS:
        begin = np.clip([*prior, delay], low + TINY, high - TINY) / std
        ends.append(descend(residuals, derivatives, begin, limits, LEAST_GAIN))
    x = min(ends, key=lambda end: end[1])[0] * std

    # The residuals there tell the noise, and with it the intervals.
    left = [_residuals(axis, x, rotor_lag) for axis in axes]
    noise = _noise(left, axes)
    columns = []
    for step in STEP * np.diag(std):
        columns.append((errors(x + step, noise) - errors(x - step, noise)) / (2.0 * step.sum()))
    clusters = [
        np.repeat(axis.first + np.arange(len(axis.rows)), axis.rows.shape[1]) for axis in axes
    ]
    tau_x, tau_y, tau_z, delay = map(float, x)
    return RateLoopFit(
        tau=(tau_x, tau_y, tau_z),
        delay=delay,
        linearized=Linearized(
            jacobian=np.stack(columns, axis=1),
            values=errors(x, noise),
            cluster=np.concatenate(clusters),
            prior_precision=std**-2.0,
        ),
    )


def _noise(values: Sequence[np.ndarray], axes: Sequence[_Axis]) -> np.ndarray:
    """Return the standard deviation about each axis, by the median of absolute values  (3,)."""
    sizes = []
    for k in range(3):
        mine = [each.ravel() for each, axis in zip(values, axes, strict=True) if axis.axis == k]
        sizes.append(MAD * float(np.median(np.abs(np.concatenate(mine)))))
    return np.maximum(sizes, LEAST_NOISE)


def _axes(parts: Sequence[Prepared]) -> list[_Axis]:
    """Return the usable pieces about each axis."""
    found = []
    first = 0
    for part in parts:
        stretch = part.stretch
        if stretch.rate_setpoints is None or stretch.body_rates is None:
            continue
        length = round(PIECE / stretch.dt)
        count = len(stretch) // length
        known = np.all(
            np.isfinite(stretch.body_rates) & np.isfinite(stretch.rate_setpoints), axis=1
        )
        usable = (part.usable & known)[: count * length].reshape(count, length).all(axis=1)
        saturated = _saturated(part)[: count * length].reshape(count, length).mean(axis=1)
        usable &= saturated <= SATURATED
        if np.sum(usable) < LEAST_PIECES:
            continue
        rows = np.arange(count * length).reshape(count, length)[usable]
        steps = round(stretch.dt / stretch.plant_step)
        for k in range(3):
            setpoints = np.nan_to_num(stretch.rate_setpoints[:, k])
            rates = np.nan_to_num(stretch.body_rates[:, k])
            found.append(_Axis(k, stretch.dt, steps, setpoints, rates, rows, first))
        first += len(rows)
    return found


def _saturated(part: Prepared) -> np.ndarray:
    """Return where a motor is at the end of its range  (n,).

    The lowest command is that of idling motors. A flight controller may correct its commands for
    the voltage of the battery, so that the lowest speed is what stays.
    """
    motors = part.stretch.motor_commands
    if motors is None or not np.any(part.usable):
        return np.zeros(len(part.stretch), bool)
    at_end = motors >= 1.0 - EDGE
    for values in (motors, motors * part.ratio[:, None]):
        at_end |= values <= np.nanmin(values[part.usable]) + EDGE
    return np.any(at_end, axis=1)


def _residuals(axis: _Axis, x: np.ndarray, rotor_lag: float) -> np.ndarray:
    """Return measured minus predicted rates in pieces that begin where they fit best.  (p, n)"""
    steps = axis.steps
    dt = axis.dt / steps
    gain = response(float(x[axis.axis]), dt) / dt
    follow = response(rotor_lag, dt)
    # omega after a step from the two before it, see quadsim.dynamics.quadrotor.step
    a = np.array([1.0, -(2.0 - follow - dt * follow * gain), 1.0 - follow])
    b = np.array([0.0, dt * follow * gain])
    acting = _delayed(np.repeat(axis.setpoints, steps), float(x[3]) / dt)
    count, length = axis.rows.shape
    inner = (steps * axis.rows[:, :, None] + np.arange(steps)).reshape(count, -1)
    answer = np.asarray(lfilter(b, a, acting[inner], axis=1))
    missing = axis.rates[axis.rows] - answer[:, ::steps]

    impulse = np.zeros((2, length * steps))
    impulse[0, 0] = 1.0
    impulse[1, 1] = 1.0
    begins = np.asarray(lfilter([1.0], a, impulse, axis=1))
    free = np.concatenate([begins[:, ::steps], np.ones((1, length))])
    basis, _ = np.linalg.qr(free.T)
    # einsum: BLAS would start threads, see quadsim.identify.products
    own = np.einsum("pn,nb->pb", missing, basis)
    return missing - np.einsum("pb,nb->pn", own, basis)


def _delayed(values: np.ndarray, rows: float) -> np.ndarray:
    """Return the mean over each step of a held signal that is later by some steps.

    A derivative may ask for a time below zero; the signal's ends are held.
    """
    whole = floor(rows)
    share = rows - whole
    index = np.arange(len(values))
    last = len(values) - 1
    newer = values[np.clip(index - whole, 0, last)]
    older = values[np.clip(index - whole - 1, 0, last)]
    return (1.0 - share) * newer + share * older
