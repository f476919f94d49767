"""The rate loop: how the body rates follow their setpoints.

As the plants and the planner have it, a loop asks for the angular acceleration
(setpoint - rate) / tau_omega, and the rotors follow with their lag:

    omega' = beta,  beta' = (beta_cmd - beta) / tau_m,
    beta_cmd = (omega_cmd(t - delay) - omega) / tau_omega

The loop is stepped as often as the plants step it, several times in a row of a log: its gain
(1 - exp(-dt / tau)) / dt depends on the step. With steps of 5 ms, a lag of 50 ms would come out
2.4 % low.

Unless the flight controller corrects its motors for the voltage of the battery, a full battery
makes the loop faster: torques, and with them the gain 1 / tau_omega, grow with a power of the
voltage, 2 for a thrust of the square of the speed. The lags are those at the reference voltage.

The answer is linear in the setpoints and in where a piece begins. So each piece begins where it
fits best, which a projection finds without a search. Pieces with saturated motors are left out, and
of a long log the pieces in which the setpoints change least.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import floor
from typing import NamedTuple

import numpy as np

from quadsim.dynamics.first_order import response
from quadsim.identify.descent import Limits, descend
from quadsim.identify.prepared import LEAST_SPREAD, Prepared, reference_voltage
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
MOST_PIECES = 240  # of all logs
# Power of the voltage by which the loop's gain grows: 0 with a correction, about 2 without
POWER = 1.0
POWER_STD = 1.0
LOWEST_POWER = -1.0
HIGHEST_POWER = 4.0
STEP = 1e-4  # of the finite differences, in standard deviations of the prior
TINY = 1e-4  # least distance of a start to a limit [s]
LEAST_NOISE = 1e-4  # [rad/s]
SECOND_DIFFERENCE = 6.0  # variance of the second difference of white noise, over the noise's


class RateLoopFit(NamedTuple):
    """The lags of the rate loop and the delay from a setpoint to its effect."""

    tau: Vec3  # at the reference voltage [s]
    delay: float  # [s]
    # the gain grows with this power of the voltage; None: the log does not tell it
    voltage_power: float | None
    linearized: Linearized  # by the lags, the delay and the power
    pieces: int  # that are fitted
    left_out: int  # usable pieces that tell less


class _Axis(NamedTuple):
    """Setpoints and rates about one axis in pieces of one stretch, and what acts on its loop."""

    axis: int
    dt: float
    steps: int  # of the loop in a row
    setpoints: np.ndarray  # whole stretch  (n,)
    rates: np.ndarray  # (n,)
    ratio: np.ndarray  # voltage over the reference  (n,)
    rows: np.ndarray  # of the usable pieces  (p, length)
    first: int  # number of the first piece


def fit_rate_loop(parts: Sequence[Prepared], rotor_lag: float, prior: Vec3) -> RateLoopFit | None:
    """Return the rate loop of a log with setpoints and rates, None if it tells none.

    Args:
        parts: the log.
        rotor_lag: lag of the rotors [s].
        prior: lags of a similar vehicle [s].
    """
    axes, left_out = _axes(parts)
    if len({axis.axis for axis in axes}) < 3:
        return None
    has_power = any(np.std(axis.ratio[axis.rows]) > LEAST_SPREAD for axis in axes)
    count = 5 if has_power else 4
    mean = np.array([*prior, 0.0, POWER])[:count]
    std = np.array([LAG, LAG, LAG, DELAY, POWER_STD])[:count]
    low = np.array([SHORTEST, SHORTEST, SHORTEST, 0.0, LOWEST_POWER])[:count]
    high = np.array([LONGEST, LONGEST, LONGEST, LONGEST_DELAY, HIGHEST_POWER])[:count]

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
        begin = np.clip([*prior, delay, POWER][:count], low + TINY, high - TINY) / std
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
    tau_x, tau_y, tau_z, delay, *power = map(float, x)
    return RateLoopFit(
        tau=(tau_x, tau_y, tau_z),
        delay=delay,
        voltage_power=power[0] if power else None,
        linearized=Linearized(
            jacobian=np.stack(columns, axis=1),
            values=errors(x, noise),
            cluster=np.concatenate(clusters),
            prior_precision=std**-2.0,
        ),
        pieces=sum(len(axis.rows) for axis in axes) // 3,
        left_out=left_out,
    )


def _noise(values: Sequence[np.ndarray], axes: Sequence[_Axis]) -> np.ndarray:
    """Return the standard deviation about each axis, by the median of absolute values  (3,)."""
    sizes = []
    for k in range(3):
        mine = [each.ravel() for each, axis in zip(values, axes, strict=True) if axis.axis == k]
        sizes.append(MAD * float(np.median(np.abs(np.concatenate(mine)))))
    return np.maximum(sizes, LEAST_NOISE)


class _Pieces(NamedTuple):
    """The usable pieces of one stretch."""

    part: Prepared
    rows: np.ndarray  # (p, length)
    change: np.ndarray  # how much the setpoints change in each, over what is usual  (p,)


def _axes(parts: Sequence[Prepared]) -> tuple[list[_Axis], int]:
    """Return the pieces about each axis, and how many usable ones are left out."""
    usable = [pieces for part in parts if (pieces := _usable_pieces(part)) is not None]
    if not usable:
        return [], 0
    change = np.concatenate([pieces.change for pieces in usable])
    least = np.sort(change)[::-1][min(MOST_PIECES, len(change)) - 1]
    reference = reference_voltage([pieces.part.stretch for pieces in usable])
    found = []
    first = 0
    for part, rows, its_change in usable:
        stretch = part.stretch
        chosen = rows[its_change >= least]
        if not len(chosen):
            continue
        ratio = np.ones(len(stretch))
        if reference is not None and stretch.battery is not None:
            ratio = np.nan_to_num(stretch.battery / reference, nan=1.0)
        assert stretch.rate_setpoints is not None
        assert stretch.body_rates is not None
        steps = round(stretch.dt / stretch.plant_step)
        for k in range(3):
            setpoints = np.nan_to_num(stretch.rate_setpoints[:, k])
            rates = np.nan_to_num(stretch.body_rates[:, k])
            found.append(_Axis(k, stretch.dt, steps, setpoints, rates, ratio, chosen, first))
        first += len(chosen)
    return found, len(change) - first


def _usable_pieces(part: Prepared) -> _Pieces | None:
    """Return the usable pieces of a stretch, None if there are fewer than LEAST_PIECES."""
    stretch = part.stretch
    if stretch.rate_setpoints is None or stretch.body_rates is None:
        return None
    length = round(PIECE / stretch.dt)
    count = len(stretch) // length
    shape = (count, length)
    known = np.all(np.isfinite(stretch.body_rates) & np.isfinite(stretch.rate_setpoints), axis=1)
    usable = (part.usable & known)[: count * length].reshape(shape).all(axis=1)
    saturated = _saturated(part)[: count * length].reshape(shape).mean(axis=1)
    usable &= saturated <= SATURATED
    if np.sum(usable) < LEAST_PIECES:
        return None
    rows = np.arange(count * length).reshape(shape)[usable]
    spread = np.std(stretch.rate_setpoints[rows], axis=1)
    usual = np.maximum(np.mean(spread, axis=0), LEAST_NOISE)
    return _Pieces(part, rows, np.sum(spread / usual, axis=1))


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
    dt = axis.dt / axis.steps
    power = x[4] if len(x) > 4 else 0.0
    # Rows first, then pieces
    gain = response(float(x[axis.axis]), dt) / dt * axis.ratio[axis.rows].T ** power
    acting = _delayed(np.repeat(axis.setpoints, axis.steps), float(x[3]) / dt)
    acting = acting.reshape(-1, axis.steps)[axis.rows].transpose(1, 2, 0)
    follow = response(rotor_lag, dt)
    length, count = gain.shape

    # The answer to the setpoints, to a rate at the begin, and to an acceleration at the begin; see
    # quadsim.dynamics.quadrotor.step for the order.
    omega = np.zeros((3, count))
    omega[1] = 1.0
    beta = np.zeros((3, count))
    beta[2] = 1.0 / rotor_lag
    answers = np.empty((length, 4, count))
    answers[:, 3] = 1.0  # a torque of the air, or a bias of the gyro
    for row in range(length):
        answers[row, :3] = omega
        for setpoint in acting[row]:
            asked = -gain[row] * omega
            asked[0] += gain[row] * setpoint
            beta += follow * (asked - beta)
            omega += dt * beta
    missing = axis.rates[axis.rows] - answers[:, 0].T

    # einsum: BLAS would start threads, see quadsim.identify.products
    free = answers[:, 1:]
    inner = np.einsum("nap,nbp->pab", free, free)
    own = np.linalg.solve(inner, np.einsum("nap,pn->pa", free, missing)[..., None])[..., 0]
    return missing - np.einsum("nap,pa->pn", free, own)


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
