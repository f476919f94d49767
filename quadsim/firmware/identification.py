"""The rate loop of a vehicle behind the firmware, identified from a short flight on a test bench.

The vehicle can rotate, but its position is fixed. The commands are random steps of the body rate
about each axis in turn, then of the thrust. The planner's model of this motion,

    beta' = (beta_cmd - beta) / tau_beta,      beta_cmd = (omega_cmd(t - delta) - omega) / tau_omega
    omega' = beta
    a' = (a_cmd(t - delta) - a) / tau_m

(quadsim.dynamics.quadrotor, in steps of the control period), is fitted to the measured response:
the lags tau_omega and tau_beta of each axis, the lag tau_m of the thrust, and a common delay delta.
A second flight with different commands measures the share of the variance that the model explains.

The torque of a rotor grows with its speed, and so do the gains of the rate loop: rates are
identified at the thrust of fast flight.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.random import Generator, SeedSequence, default_rng

from quadsim.dynamics.first_order import response
from quadsim.dynamics.quadrotor import Control, ModelParams
from quadsim.firmware.process import FirmwareError
from quadsim.physics.plant import ActuatorsProtocol
from quadsim.rotation import Quaternion, Vec3, turned_at
from quadsim.streams import identification_streams

DURATION = 3.0  # duration of each part of the flight [s]
LONGEST_HOLD = 0.25  # longest time of a constant command [s]
THRUST = 0.6  # thrust for the identification of body rates, share of the largest
THRUSTS = (0.15, 0.7)  # range of thrust commands for its identification, shares of the largest
RATES: Vec3 = (3.0, 3.0, 1.5)  # largest commanded body rates [rad/s]
CUT = 0.5  # a body rate with a lower limit is next to none, and commanded beyond it [rad/s]
PARTS = ("roll rate", "pitch rate", "yaw rate", "thrust")
# Least standard deviation of an answer as a share of its command's, which is near 1 in flight
LEAST_ANSWER = 0.05
LATER = 0.06  # time in which an answer begins: rotors and filters take some 30 ms [s]
# Correlation between what is missing and the change in this time: .5 to .9 in loops that fly
LEAST_TOWARDS = 0.2
OTHER_WAY = -0.5
# Models of loops that fly explain 96 to 99 % of another flight's roll, pitch and thrust. What one
# misses that explains less than half is more than 70 % as large as the response.
LEAST_EXPLAINED = 0.5
ADVICE = "correct the gains, rates, limits or mixer of the configuration"
# Initial guess of the search, and its limits [s]
FIRST_LAG = 0.03
SHORTEST_LAG = 1e-3
LONGEST_LAG = 1.0
FIRST_DELAY = 0.005
LONGEST_DELAY = 0.1
DIGITS = 4  # digits of the results, which hide differences in the last bits between libraries

STILL: Vec3 = (0.0, 0.0, 0.0)

NewActuators = Callable[[], ActuatorsProtocol]


class Response(NamedTuple):
    """A channel's command and its measured value, at the beginning of each control period."""

    command: np.ndarray  # body rate [rad/s] or thrust [m/s^2]  (n,)
    measured: np.ndarray  # body rate or thrust of the vehicle  (n,)


class RateLoop(NamedTuple):
    """The two lags of one body rate, which make its response second-order."""

    rate_tau: float  # tau_omega [s]
    rate_lag: float  # tau_beta [s]
    explained: float  # share of the variance of another flight

    @property
    def natural_frequency(self) -> float:
        """The natural frequency [rad/s]."""
        return 1.0 / sqrt(self.rate_tau * self.rate_lag)

    @property
    def damping(self) -> float:
        """The damping ratio."""
        return 0.5 * sqrt(self.rate_tau / self.rate_lag)


class Identification(NamedTuple):
    """The lags and the delay of a vehicle, identified from a flight on the test bench."""

    roll: RateLoop
    pitch: RateLoop
    yaw: RateLoop
    thrust_lag: float  # tau_m [s]
    thrust_explained: float  # share of the variance of another flight
    delay: float  # delta [s]

    @property
    def axes(self) -> tuple[RateLoop, RateLoop, RateLoop]:
        """The rate loops about x, y, z."""
        return self.roll, self.pitch, self.yaw

    def model(self, nominal: ModelParams) -> ModelParams:
        """Return the planner's model: the nominal one with the identified numbers."""
        x, y, z = self.axes
        return replace(
            nominal,
            rate_tau=(x.rate_tau, y.rate_tau, z.rate_tau),
            rate_lag=(x.rate_lag, y.rate_lag, z.rate_lag),
            motor_tau=self.thrust_lag,
            delay=self.delay,
            # Betaflight's mixer gives up thrust for yaw, too.
            yaw_first=True,
        )


class NoResponseError(FirmwareError):
    """A vehicle does not answer on the test bench as a quadrotor does; one line."""


def identify(
    nominal: ModelParams, dt: float, period: float, new_actuators: NewActuators
) -> Identification:
    """Identify the rate loop of a vehicle from two flights on the test bench.

    Args:
        nominal: nominal model of the vehicle, with the limits of its commands.
        dt: physics step [s].
        period: control period, the step of the identified model [s].
        new_actuators: function that starts the actuators for one part of a flight.

    Raises:
        NoResponseError: the vehicle does not answer as it is commanded, or no model of this kind
            explains how.
        FirmwareError: the firmware does not run.
    """

    def responses(stream: SeedSequence) -> list[Response]:
        signals = _signals(default_rng(stream), nominal, period)
        found = []
        for signal in signals:
            with closing(new_actuators()) as actuators:
                found.append(_fly(actuators, signal, dt, period))
        return found

    # The first flight gives the numbers, and a second one with different commands checks them.
    flown, checked = (responses(stream) for stream in identification_streams())
    _check_responses(flown, period)
    _check_responses(checked, period)
    numbers = _fitted(flown, period)
    explained = [
        1.0 - np.var(simulated - response.measured) / np.var(response.measured)
        for simulated, response in zip(_simulated(numbers, checked, period), checked, strict=True)
    ]
    axes = [
        RateLoop(tau, lag, float(share))
        for tau, lag, share in zip(numbers.rate_tau, numbers.rate_lag, explained[:3], strict=True)
    ]
    found = Identification(
        *axes,
        thrust_lag=numbers.thrust_lag,
        thrust_explained=float(explained[3]),
        delay=numbers.delay,
    )
    check_explained(found)
    return found


def _check_responses(flown: Sequence[Response], period: float) -> None:
    """Raise NoResponseError if a vehicle does not follow its commands.

    Whatever its gains are, a rate loop turns the vehicle towards its command: the change that
    follows has the sign of what is missing.
    """
    later = max(round(LATER / period), 1)
    for name, part in zip(PARTS, flown, strict=True):
        wanted = f"expected the {name} to follow its command"
        if not np.all(np.isfinite(part.measured)):
            raise NoResponseError(f"{wanted}, but it grows without end: {ADVICE}")
        size = float(np.std(part.measured) / np.std(part.command))
        if size < LEAST_ANSWER:
            raise NoResponseError(f"{wanted}, but it does not answer: {ADVICE}")
        missing = (part.command - part.measured)[:-later]
        change = part.measured[later:] - part.measured[:-later]
        towards = float(np.corrcoef(missing, change)[0, 1])
        if towards < OTHER_WAY:
            raise NoResponseError(f"{wanted}, but it goes the other way: {ADVICE}")
        if towards < LEAST_TOWARDS:
            raise NoResponseError(f"{wanted}, but it goes elsewhere: {ADVICE}")


def check_explained(found: Identification) -> None:
    """Raise NoResponseError if the model explains too little of roll, pitch or thrust.

    Yaw may be explained badly: with Betaflight's own gains it swings behind slow rotors, and such
    configurations finish races. See `weak_yaw`.
    """
    shares = (found.roll.explained, found.pitch.explained, found.thrust_explained)
    for name, share in zip((*PARTS[:2], PARTS[3]), shares, strict=True):
        if not share >= LEAST_EXPLAINED:
            wanted = f"expected a model that explains {100 * LEAST_EXPLAINED:g} % of the {name}"
            explained = f"but the best one explains {100 * max(share, 0.0):.3g} %"
            raise NoResponseError(f"{wanted} after commands, {explained}: {ADVICE}")


def weak_yaw(found: Identification, nominal: ModelParams) -> bool:
    """Return whether the model hardly describes the yaw, although it is commanded in flight."""
    return found.yaw.explained < LEAST_EXPLAINED and nominal.rate_max[2] >= CUT


# ---- the flight ----


class Excitation(NamedTuple):
    """The commands of one part of the flight."""

    channel: int  # index in Control of the varied command
    commands: list[Control]  # one for each control period


def _signals(random: Generator, nominal: ModelParams, period: float) -> list[Excitation]:
    """Return the commands of the four parts: body rates about x, y, z, and thrust.

    They stay within the limits, but for a yaw that is next to none.
    """
    periods = round(DURATION / period)
    still = Control(0.0, 0.0, 0.0, THRUST * nominal.thrust_max)
    lowest, highest = (share * nominal.thrust_max for share in THRUSTS)
    lowest = max(lowest, nominal.thrust_min)
    rates = [
        rate if most < CUT else min(rate, most)
        for rate, most in zip(RATES, nominal.rate_max, strict=True)
    ]
    limits = [(-rate, rate) for rate in rates] + [(lowest, highest)]
    signals = []
    for channel, (low, high) in enumerate(limits):
        levels = _random_steps(random, periods, period, low, high)
        name = Control._fields[channel]
        commands = [still._replace(**{name: level}) for level in levels]
        signals.append(Excitation(channel, commands))
    return signals


def _random_steps(
    random: Generator, periods: int, period: float, low: float, high: float
) -> list[float]:
    """Return levels between two limits, each held for a random time."""
    longest = max(round(LONGEST_HOLD / period), 1)
    levels: list[float] = []
    while len(levels) < periods:
        hold = int(random.integers(1, longest + 1))
        levels += [random.uniform(low, high)] * hold
    return levels[:periods]


class TestBench:
    """A vehicle that can rotate, but whose position is fixed."""

    __test__ = False  # keeps pytest from collecting the class by its name

    def __init__(self, actuators: ActuatorsProtocol, dt: float):
        """dt: physics step [s]."""
        self._actuators = actuators
        self._dt = dt
        self._attitude: Quaternion = (1.0, 0.0, 0.0, 0.0)
        self.rates: Vec3 = STILL  # body rates [rad/s]

    def step(self, command: Control, push: Vec3 = STILL) -> None:
        """Advance the rotation by one physics step.

        Args:
            command: present command.
            push: external angular acceleration, body frame [rad/s^2].
        """
        dt = self._dt
        wx, wy, wz = self.rates
        self._actuators.wrench(command, self.rates, STILL, self._attitude)
        bx, by, bz = self._actuators.angular_acceleration
        px, py, pz = push
        self.rates = (wx + (bx + px) * dt, wy + (by + py) * dt, wz + (bz + pz) * dt)
        self._attitude = turned_at(self._attitude, self.rates, dt)


def _fly(actuators: ActuatorsProtocol, signal: Excitation, dt: float, period: float) -> Response:
    """Fly one part of the flight on the test bench, and return the response."""
    bench = TestBench(actuators, dt)
    measured = []
    for command in signal.commands:
        now = (*bench.rates, actuators.thrust)
        measured.append(now[signal.channel])
        for _ in range(round(period / dt)):
            bench.step(command)
    commanded = [command[signal.channel] for command in signal.commands]
    return Response(np.array(commanded), np.array(measured))


# ---- the fit ----


class ModelNumbers(NamedTuple):
    """The numbers of the model that are identified."""

    rate_tau: Vec3  # [s]
    rate_lag: Vec3  # [s]
    thrust_lag: float  # [s]
    delay: float  # [s]


def _fitted(flown: Sequence[Response], period: float) -> ModelNumbers:
    """Return the least-squares fit of the model to the responses."""
    from scipy.optimize import least_squares  # here: commands that fly nothing do not load it

    scales = [np.std(response.measured) for response in flown]

    def errors(x: np.ndarray) -> np.ndarray:
        simulated = _simulated(_named(x), flown, period)
        parts = zip(simulated, flown, scales, strict=True)
        return np.concatenate([(y - response.measured) / scale for y, response, scale in parts])

    lags = 7
    start = np.array([FIRST_LAG] * lags + [FIRST_DELAY])
    limits = [SHORTEST_LAG] * lags + [0.0], [LONGEST_LAG] * lags + [LONGEST_DELAY]
    found = least_squares(errors, start, bounds=limits, x_scale=start)
    return _named([float(f"{number:.{DIGITS}g}") for number in found.x])


def _named(x: Sequence[float] | np.ndarray) -> ModelNumbers:
    """Return the variables of the optimization  (8,)  as a record of the model's numbers."""
    tau_x, tau_y, tau_z, lag_x, lag_y, lag_z, thrust_lag, delay = map(float, x)
    return ModelNumbers((tau_x, tau_y, tau_z), (lag_x, lag_y, lag_z), thrust_lag, delay)


def _simulated(
    numbers: ModelNumbers, responses: Sequence[Response], period: float
) -> Iterator[np.ndarray]:
    """Yield the values that the model predicts under the commands of each response.  (n,)"""
    *rates, thrust = responses
    lags = zip(numbers.rate_tau, numbers.rate_lag, rates, strict=True)
    for tau, lag, flown in lags:
        acting = _delayed(flown.command, flown.measured[0], numbers.delay / period)
        yield _rate(acting, response(tau, period) / period, response(lag, period), period)
    acting = _delayed(thrust.command, thrust.measured[0], numbers.delay / period)
    yield _thrust(acting, thrust.measured[0], response(numbers.thrust_lag, period))


def _delayed(command: np.ndarray, first: float, periods: float) -> list[float]:
    """Return the mean of the delayed command in each period.

    Args:
        command: command of each control period  (n,).
        first: command before the first period.
        periods: delay in control periods.
    """
    whole = int(periods)
    share = periods - whole
    earlier = np.concatenate((np.full(whole + 1, first), command))
    newer, older = earlier[1 : len(command) + 1], earlier[: len(command)]
    return ((1.0 - share) * newer + share * older).tolist()


def _rate(commands: list[float], gain: float, share: float, period: float) -> np.ndarray:
    """Return the body rate about one axis at the beginning of each period [rad/s]  (n,).

    The rate loop is the one of quadsim.dynamics.quadrotor.step, and starts at rest.

    Args:
        commands: commanded rate of each period [rad/s]  (n,).
        gain: gain of the rate loop [1/s].
        share: share of the error of the angular acceleration that is gone after a period.
        period: control period [s].
    """
    rate = acceleration = 0.0
    rates = []
    for command in commands:
        rates.append(rate)
        acceleration += ((command - rate) * gain - acceleration) * share
        rate += acceleration * period
    return np.array(rates)


def _thrust(commands: list[float], thrust: float, share: float) -> np.ndarray:
    """Return the thrust at the beginning of each period."""
    thrusts = []
    for command in commands:
        thrusts.append(thrust)
        thrust += (command - thrust) * share
    return np.array(thrusts)
