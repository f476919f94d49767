"""Gains of Betaflight's rate loop, found by step responses on the test bench.

For each axis in turn, the command is a step of the body rate, and later a constant external angular
acceleration disturbs the vehicle (the push). The gains minimise the difference to the step response
of an ideal rate loop with the same rotor lag and a damping ratio of at least .7, and the effect of
the push on the body rate:

    |omega - omega_wanted| + |omega - omega_cmd| while pushed + overshoot beyond a limit
    + what is missing at the end of the step + a little for each point of D

The errors are root mean squares, as shares of the step. The first term alone would give no
integral gain, as nothing on the bench resists a rotation; the push requires one. D amplifies the
noise of a gyro, so it costs a little.

A grid of P and D comes first, then Nelder and Mead's search over the logarithms of the gains, from
the best points of the grid.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from itertools import product
from math import exp, log
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from quadsim.dynamics.quadrotor import Control
from quadsim.firmware.gains import Gains
from quadsim.firmware.identification import RATES, STILL, THRUST, NewActuators, TestBench
from quadsim.physics.actuators import Actuators
from quadsim.physics.link import Link
from quadsim.vehicle import Vehicle

# Parts of the flight: the thrust settles, the step, the push [s]
SETTLING = 0.2
STEP = 0.5
PUSH = 0.4
END = 0.15  # last part of the step, in which the body rate should have settled [s]
# Change of the body rate of the ideal loop, which has no integral, by the push; share of the step
PUSHED = 0.2

DAMPING = 0.7  # least damping ratio of the desired response
MOST_OVERSHOOT = 0.1
PUSH_WEIGHT = 0.3
OVERSHOOT_WEIGHT = 2.0
END_WEIGHT = 0.5
D_WEIGHT = 2e-3

# What a pilot would fly
LEAST = Gains(4, 10, 1)
LEAST_OF_YAW = Gains(4, 1, 0)
MOST = Gains(120, 120, 70)
# The grid; I of roll and pitch equals P in the grid
P_GRID = (8, 16, 32, 64)
D_OF_P = (0.6, 1.2, 2.4)
YAW_I = (2, 6, 18)
TRIALS = 60  # evaluations of the search after the grid
STARTS = 2  # starting points of the search after the grid
FIRST_STEP = 0.25  # initial step of the logarithm of each gain

YAW = 2


class StepResponse(NamedTuple):
    """The response of a body rate to a step, and then to a push."""

    level: float  # height of the step [rad/s]
    rates: np.ndarray  # body rate after each physics step since the command  (n,)
    pushed: np.ndarray  # body rate after each physics step since the push  (m,)
    dt: float  # physics step [s]

    @property
    def rise_time(self) -> float:
        """The time from 10 to 90 % of the step [s]; nan if 90 % is not reached."""
        share = self.rates / self.level
        above = [np.flatnonzero(share >= part) for part in (0.1, 0.9)]
        if not all(len(found) for found in above):
            return np.nan
        return float(above[1][0] - above[0][0]) * self.dt

    @property
    def overshoot(self) -> float:
        """The overshoot of the body rate, as a share of the step."""
        return max(float(self.rates.max()) / self.level - 1.0, 0.0)

    @property
    def settled_error(self) -> float:
        """The mean error at the end of the step, as a share of the step."""
        last = self.rates[-round(END / self.dt) :]
        return float(last.mean()) / self.level - 1.0


WithGains = Callable[[Gains], NewActuators]
Show = Callable[[float], None]  # called with the finished share of the search


def step_response(
    vehicle: Vehicle, axis: int, dt: float, new_actuators: NewActuators
) -> StepResponse:
    """Return the response of a body rate on the test bench.

    Args:
        vehicle: the vehicle.
        axis: 0, 1, 2 for x, y, z.
        dt: physics step [s].
        new_actuators: function that starts the actuators.

    Raises:
        FirmwareError: the firmware does not run.
    """
    level = min(RATES[axis], vehicle.omega_max[axis])
    still = Control(0.0, 0.0, 0.0, THRUST * vehicle.thrust_max)
    stepped = still._replace(**{Control._fields[axis]: level})
    push = [0.0, 0.0, 0.0]
    push[axis] = PUSHED * level / vehicle.rate_tau[axis]
    pushes = (push[0], push[1], push[2])

    with closing(new_actuators()) as actuators:
        bench = TestBench(actuators, dt)

        def rates(command: Control, duration: float, push=STILL) -> Iterator[float]:
            for _ in range(round(duration / dt)):
                bench.step(command, push)
                yield bench.rates[axis]

        # Discard the body rates until the thrust has settled.
        list(rates(still, SETTLING))
        response = np.array(list(rates(stepped, STEP)))
        pushed = np.array(list(rates(stepped, PUSH, pushes)))
    return StepResponse(level, response, pushed, dt)


def wanted_response(vehicle: Vehicle, axis: int, dt: float, period: float) -> StepResponse:
    """Return the desired step response; for the arguments see `search`.

    It is the response of the vehicle's ideal rate loop, or of a slower loop if the lag of the
    rotors leaves the ideal one too little damping.
    """
    assert vehicle.rotors
    slowest = 4.0 * DAMPING**2 * vehicle.rotors.motor_tau
    x, y, z = (max(tau, slowest) for tau in vehicle.rate_tau)
    ideal = replace(vehicle, rate_tau=(x, y, z))
    link = Link(dt, interpolation=period)
    return step_response(vehicle, axis, dt, lambda: Actuators(ideal, dt, link=link))


def shortfall(response: StepResponse, wanted: StepResponse) -> float:
    """Return the cost of a response relative to the desired one; see the top of the file."""
    level = response.level
    return (
        _rms(response.rates - wanted.rates) / level
        + PUSH_WEIGHT * _rms(response.pushed - level) / level
        + OVERSHOOT_WEIGHT * max(response.overshoot - MOST_OVERSHOOT, 0.0)
        + END_WEIGHT * abs(response.settled_error)
    )


def search(
    vehicle: Vehicle,
    axis: int,
    dt: float,
    period: float,
    before: Gains,
    with_gains: WithGains,
    show: Show = lambda share: None,
) -> Gains:
    """Return the gains of one axis with the best step response.

    Args:
        vehicle: the vehicle.
        axis: 0, 1, 2 for roll, pitch, yaw. Yaw keeps its D.
        dt: physics step [s].
        period: control period, over which commands are interpolated linearly [s].
        before: present gains, which are tried too, so that the result is never worse.
        with_gains: function from gains of the axis to a function that starts the actuators.
        show: called with the finished share of the search.

    Raises:
        FirmwareError: the firmware does not run.
    """
    wanted = wanted_response(vehicle, axis, dt, period)
    tried: dict[Gains, float] = {}
    grid = list(_grid(axis, before))
    trials = TRIALS if axis != YAW else 2 * TRIALS // 3

    def cost(gains: Gains) -> float:
        if gains not in tried:
            response = step_response(vehicle, axis, dt, with_gains(gains))
            tried[gains] = shortfall(response, wanted) + D_WEIGHT * gains.d
            show(min(len(tried) / (len(grid) + trials), 1.0))
        return tried[gains]

    numbers = 2 if axis == YAW else 3
    best = sorted(grid, key=cost)[:STARTS]
    for start in best:
        point = np.log([max(gain, 1) for gain in start[:numbers]])
        minimize(
            lambda point, start=start: cost(_rounded(point, start)),
            point,
            method="Nelder-Mead",
            options={
                "initial_simplex": np.vstack([point, point + FIRST_STEP * np.eye(numbers)]),
                "maxfev": trials // STARTS,
                "xatol": 0.01,
                "fatol": 1e-5,
            },
        )
    show(1.0)
    # Of equally good gains, take the smallest
    return min(tried, key=lambda gains: (tried[gains], gains))


def _grid(axis: int, before: Gains) -> Iterator[Gains]:
    yield before
    if axis == YAW:
        for p, i in product(P_GRID, YAW_I):
            yield Gains(p, i, before.d)
    else:
        for p, ratio in product(P_GRID, D_OF_P):
            yield _limited(Gains(p, p, round(ratio * p)), LEAST)


def _rounded(point: np.ndarray, start: Gains) -> Gains:
    """Return the gains at a point of the search, rounded and clipped to the limits.

    point: logarithms of P, I and D, or of P and I alone for yaw, which keeps its D.
    """
    # clipped against overflow, far beyond every limit
    found = [round(exp(min(number, log(1000)))) for number in point]
    if len(found) == len(start):
        return _limited(Gains(*found), LEAST)
    p, i = found
    return _limited(Gains(p, i, start.d), LEAST_OF_YAW)


def _limited(gains: Gains, least: Gains) -> Gains:
    limits = zip(least, gains, MOST, strict=True)
    p, i, d = (min(max(low, gain), high) for low, gain, high in limits)
    return Gains(p, i, d)


def _rms(errors: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))
