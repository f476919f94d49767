"""The rate loop: how the body rates follow their setpoints.

As the plants and the planner have it, a loop asks for the angular acceleration
(setpoint - rate) / tau_omega, which follows with the lag of the rotors:

    omega' = beta,  beta' = (beta_cmd - beta) / tau_beta,
    beta_cmd = (omega_cmd(t - delay) - omega) / tau_omega

A flight controller with filters and an integral has a tau_beta of its own about each axis, which
is taken if the log shows it beyond doubt.

The loop is stepped as often as the plants step it, several times in a row of a log: its gain
(1 - exp(-dt / tau)) / dt depends on the step. With steps of 5 ms, a lag of 50 ms would come out
2.4 % low.

Unless a flight controller corrects its motors for the voltage of the battery, a full battery
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
from quadsim.identify.descent import NumberLimits, descend
from quadsim.identify.intervals import covariances
from quadsim.identify.prepared import LEAST_SPREAD, Prepared, reference_voltage
from quadsim.identify.search import LEAST_GAIN, MAD, Linearized
from quadsim.identify.stretches import PLANT_STEP
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
FEW_PIECES = 60  # that are enough to tell good starts from bad ones
POWER = 1.0  # mean, and standard deviation, of the prior of the power of the voltage: 0 or 2
LARGEST_POWER = 4.0
# A lag of its own is taken if it differs as much from the lag of the rotors, and as certainly.
OTHER_LAG = 0.15
CERTAIN = 16.3  # 99.9 % quantile of chi-square with three degrees of freedom
STEP = 1e-4  # of the finite differences, in standard deviations of the prior
TINY = 1e-4  # least distance of a start to a limit
LEAST_NOISE = 1e-4  # [rad/s]
SECOND_DIFFERENCE = 6.0  # variance of the second difference of white noise, over the noise's
TAU = ("tau_x", "tau_y", "tau_z")
LAGS = ("lag_x", "lag_y", "lag_z")


class LoopNumbers(NamedTuple):
    """The numbers of a rate loop."""

    # lags of the rates, at the reference voltage [s]
    tau_x: float
    tau_y: float
    tau_z: float
    # time from a setpoint to its effect [s]
    delay: float
    # lags of the angular accelerations [s]
    lag_x: float
    lag_y: float
    lag_z: float
    # The gain grows with this power of the voltage.
    voltage_power: float

    @property
    def tau(self) -> Vec3:
        """The lags of the rates [s]."""
        return self.tau_x, self.tau_y, self.tau_z

    @property
    def lag(self) -> Vec3:
        """The lags of the angular accelerations [s]."""
        return self.lag_x, self.lag_y, self.lag_z


class RateLoopFit(NamedTuple):
    """The rate loop of a log."""

    numbers: LoopNumbers
    searched: tuple[str, ...]  # names of the numbers that the log tells
    linearized: Linearized  # by the searched numbers
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


def fit_rate_loop(
    parts: Sequence[Prepared], rotor_lag: float, prior: Vec3, reference: float | None = None
) -> RateLoopFit | None:
    """Return the rate loop of a log with setpoints and rates, None if they do not determine it.

    Args:
        parts: the log.
        rotor_lag: lag of the rotors [s].
        prior: lags of a similar vehicle [s].
        reference: voltage to which the lags refer [V]; None: the median of the stretches.
    """
    axes, left_out = _axes(parts, reference)
    if len({axis.axis for axis in axes}) < 3:
        return None
    lags = (rotor_lag, rotor_lag, rotor_lag)
    searched = (*TAU, "delay")
    # Pieces that all have one voltage, but not the reference, tell no power: lags are less certain.
    off = np.concatenate([(axis.ratio[axis.rows] - 1.0).ravel() for axis in axes])
    has_power = float(np.sqrt(np.mean(off**2))) > LEAST_SPREAD
    if has_power:
        searched += ("voltage_power",)
    start = LoopNumbers(*prior, 0.0, *lags, voltage_power=POWER if has_power else 0.0)

    few = _thinned(axes)
    starts = [start._replace(delay=delay) for delay in DELAYS]
    best, _ = min((_searched(few, start, searched, at) for at in starts), key=lambda end: end[1])
    found = _solved(axes, start, searched, best)
    larger = _solved(axes, start, (*searched, *LAGS), found.numbers)
    change = np.array(larger.numbers.lag) - rotor_lag
    if np.max(np.abs(change)) > OTHER_LAG * rotor_lag and _is_certain(larger, LAGS, change):
        found = larger
    pieces = sum(len(axis.rows) for axis in axes) // 3
    return found._replace(pieces=pieces, left_out=left_out)


def _is_certain(found: RateLoopFit, names: Sequence[str], change: np.ndarray) -> bool:
    """Return whether some numbers differ from their priors by more than their uncertainty."""
    index = [found.searched.index(name) for name in names]
    covariance = covariances(found.linearized).reported[np.ix_(index, index)]
    return float(change @ np.linalg.solve(covariance, change)) > CERTAIN


def _errors(axes: Sequence[_Axis], numbers: LoopNumbers, noise: np.ndarray) -> np.ndarray:
    """Return all residuals over their noise  (m,)."""
    return np.concatenate([(_residuals(axis, numbers) / noise[axis.axis]).ravel() for axis in axes])


def _priors(start: LoopNumbers, searched: Sequence[str]) -> tuple[NumberLimits, np.ndarray]:
    """Return the priors of the searched numbers, and their standard deviations."""
    mean = np.array([getattr(start, name) for name in searched])
    is_power = np.array([name == "voltage_power" for name in searched])
    is_delay = np.array([name == "delay" for name in searched])
    std = np.where(is_power, POWER, np.where(is_delay, DELAY, LAG))
    low = np.where(is_power, -LARGEST_POWER, np.where(is_delay, 0.0, SHORTEST))
    high = np.where(is_power, LARGEST_POWER, np.where(is_delay, LONGEST_DELAY, LONGEST))
    return NumberLimits(mean / std, low / std, high / std), std


def _searched(
    axes: Sequence[_Axis], start: LoopNumbers, searched: Sequence[str], begin: LoopNumbers
) -> tuple[LoopNumbers, float]:
    """Return the numbers that fit best, and their cost.

    Args:
        axes: what is fitted.
        start: the prior, and what is not searched.
        searched: names of the numbers that are searched.
        begin: where the search begins.
    """
    limits, std = _priors(start, searched)
    noise = _noise([np.diff(axis.rates[axis.rows], n=2, axis=1) for axis in axes], axes)
    noise /= np.sqrt(SECOND_DIFFERENCE)

    # The search is in standard deviations of the prior.
    def numbers(x: np.ndarray) -> LoopNumbers:
        return start._replace(**dict(zip(searched, map(float, x * std), strict=True)))

    def residuals(x: np.ndarray) -> np.ndarray:
        return _errors(axes, numbers(x), noise)

    def derivatives(x: np.ndarray, r: np.ndarray) -> np.ndarray:
        steps = STEP * np.eye(len(x))
        return np.stack([(residuals(x + step) - r) / STEP for step in steps], axis=1)

    x = np.array([getattr(begin, name) for name in searched]) / std
    x = np.clip(x, limits.low + TINY, limits.high - TINY)
    x, cost = descend(residuals, derivatives, x, limits, LEAST_GAIN)
    return numbers(x), cost


def _solved(
    axes: Sequence[_Axis], start: LoopNumbers, searched: Sequence[str], begin: LoopNumbers
) -> RateLoopFit:
    """Return the numbers that fit best, with the derivatives there; see `_searched`."""
    numbers, _ = _searched(axes, start, searched, begin)
    # The residuals there tell the noise, and with it the intervals.
    noise = _noise([_residuals(axis, numbers) for axis in axes], axes)
    _, std = _priors(start, searched)
    columns = []
    for name, its_std in zip(searched, std, strict=True):
        step = STEP * its_std
        value = getattr(numbers, name)
        ahead, behind = (
            _errors(axes, numbers._replace(**{name: value + h}), noise) for h in (step, -step)
        )
        columns.append((ahead - behind) / (2.0 * step))
    clusters = [
        np.repeat(axis.first + np.arange(len(axis.rows)), axis.rows.shape[1]) for axis in axes
    ]
    linearized = Linearized(
        jacobian=np.stack(columns, axis=1),
        values=_errors(axes, numbers, noise),
        cluster=np.concatenate(clusters),
        prior_precision=std**-2.0,
    )
    return RateLoopFit(numbers, tuple(searched), linearized, pieces=0, left_out=0)


def _thinned(axes: Sequence[_Axis]) -> list[_Axis]:
    """Return some FEW_PIECES of the pieces, evenly spread."""
    every = max(sum(len(axis.rows) for axis in axes) // (3 * FEW_PIECES), 1)
    return [axis._replace(rows=axis.rows[::every]) for axis in axes]


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


def _axes(parts: Sequence[Prepared], reference: float | None) -> tuple[list[_Axis], int]:
    """Return the pieces about each axis, and how many usable ones are left out."""
    usable = [pieces for part in parts if (pieces := _usable_pieces(part)) is not None]
    if not usable:
        return [], 0
    change = np.concatenate([pieces.change for pieces in usable])
    least = np.sort(change)[::-1][min(MOST_PIECES, len(change)) - 1]
    reference = reference or reference_voltage([pieces.part.stretch for pieces in usable])
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
        steps = max(round(stretch.dt / PLANT_STEP), 1)
        for k in range(3):
            setpoints = np.nan_to_num(stretch.rate_setpoints[:, k])
            rates = np.nan_to_num(stretch.body_rates[:, k])
            axis = _Axis(k, stretch.dt, steps, setpoints, rates, ratio, chosen, first)
            found.append(axis)
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

    Idling motors have the lowest command. If a flight controller corrects its commands for the
    voltage of the battery, they have the lowest speed instead.
    """
    motors = part.stretch.motor_commands
    if motors is None or not np.any(part.usable):
        return np.zeros(len(part.stretch), bool)
    at_end = motors >= 1.0 - EDGE
    for values in (motors, motors * part.ratio[:, None]):
        at_end |= values <= np.nanmin(values[part.usable]) + EDGE
    return np.any(at_end, axis=1)


def _residuals(axis: _Axis, numbers: LoopNumbers) -> np.ndarray:
    """Return measured minus predicted rates in pieces that begin where they fit best.  (p, n)"""
    dt = axis.dt / axis.steps
    lag = numbers.lag[axis.axis]
    # Rows first, then pieces
    gain = (
        response(numbers.tau[axis.axis], dt) / dt * axis.ratio[axis.rows].T ** numbers.voltage_power
    )
    acting = _delayed(np.repeat(axis.setpoints, axis.steps), numbers.delay / dt)
    acting = acting.reshape(-1, axis.steps)[axis.rows].transpose(1, 2, 0)
    follow = response(lag, dt)
    length, count = gain.shape

    # The answer to the setpoints, to a rate at the begin, and to an acceleration at the begin; see
    # quadsim.dynamics.quadrotor.step for the order.
    omega = np.zeros((3, count))
    omega[1] = 1.0
    beta = np.zeros((3, count))
    beta[2] = 1.0 / lag
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
