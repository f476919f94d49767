"""Clocks, with a fake one: what acts while a plan is made, and what a plan that takes too long
costs."""

from typing import NamedTuple

import numpy as np
import pytest
from plant_cases import ModelPlant

from quadsim.controllers.plan import PlanStats
from quadsim.dynamics import System
from quadsim.dynamics.control_periods import ControlPeriods
from quadsim.racing.clock import Clock, WallClock
from quadsim.racing.flight import FlightParts, simulate

DT, PERIOD = 0.0025, 0.01  # four physics steps in a control period


class FakeTime:
    """A time source that moves on only by calls."""

    def __init__(self):
        self.seconds = 100.0

    def __call__(self):
        return self.seconds

    def pass_by(self, seconds):
        self.seconds += seconds


class Planner:
    """A planner that returns the control n from its n-th call, and notes when it was asked.

    The n-th of `durations` is the fake time that its n-th call takes [s].
    """

    rest = np.zeros(1)

    def __init__(self, time, durations):
        self._time, self._durations = time, iter(durations)
        self._periods = ControlPeriods(PERIOD)
        self.begun, self.elapsed = [], []

    def control(self, estimate):
        self.begun.append(round(float(estimate.x[1]), 9))
        self.elapsed.append(self._periods.advance(estimate.t))
        self._time.pass_by(next(self._durations))
        return np.array([float(len(self.begun))]), PlanStats(0.0, 1.0, 1.0)


class Counter(NamedTuple):
    sum: float  # of the controls of all steps
    t: float
    z: float


class Number(NamedTuple):
    n: float


def count(x, u, p, dt):
    return Counter(x.sum + u.n, x.t + dt, 0.0)


class Watch:
    """Ends the flight at a time [s] and notes the control of every physics step."""

    passed, lap, next_gate = 0, 1, 0

    def __init__(self, end):
        self.outcome, self._end, self.controls = None, end, []

    def observe(self, t0, p0, t1, p1, contacts=()):
        self.controls.append(round(p1[0] - p0[0]))
        self.outcome = "finished" if t1 > self._end - DT / 2 else None
        return []


def flown(durations, end, clock=None):
    """Return when plans were begun [s], the elapsed periods, and the control of every step."""
    time = FakeTime()
    planner, watch = Planner(time, durations), Watch(end)
    counter = System(
        "counter", Counter, Number, count, (), DT, low=(0.0,), high=(1e9,), rest=(0.0,)
    )
    plant = ModelPlant(counter, (0.0, 0.0, 0.0))
    clock = clock or WallClock(time, time.pass_by)
    list(simulate(FlightParts(plant, planner, watch, PERIOD, clock=clock)))
    return planner.begun, planner.elapsed, watch.controls


def test_the_control_before_holds_until_the_plan_is_ready_then_the_new_one_acts():
    """Each plan takes half a period: two physics steps under the old control, two under the new
    one."""
    begun, elapsed, controls = flown([0.005] * 4, 0.04)
    assert controls == [1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 4, 4]
    assert begun == [0.0, 0.01, 0.02, 0.03]
    assert elapsed == [0, 1, 1, 1]


def test_a_plan_that_takes_longer_than_a_period_makes_the_next_one_late_by_two_periods():
    begun, elapsed, controls = flown([0.0, 0.018, 0.005, 0.0], 0.0475)
    assert begun == [0.0, 0.01, 0.0275, 0.0375], (
        "at the physics step after it was ready, and on from there"
    )
    assert elapsed == [0, 1, 2, 1]
    assert controls == [1] * 11 + [2] * 2 + [3] * 2 + [4] * 4, (
        "each acts until the next one is ready"
    )


def test_the_first_plan_takes_no_time_of_the_flight_as_it_may_have_to_compile():
    begun, elapsed, controls = flown([20.0, 0.0], 0.02)
    assert (begun, elapsed, controls) == ([0.0, 0.01], [0, 1], [1] * 4 + [2] * 4)


def test_under_the_simulated_clock_no_plan_is_ever_late():
    slow, quick = (flown([seconds] * 4, 0.04, Clock()) for seconds in (0.5, 0.0))
    assert (
        slow
        == quick
        == ([0.0, 0.01, 0.02, 0.03], [0, 1, 1, 1], [k for k in (1, 2, 3, 4) for _ in range(4)])
    )


def test_wall_clock_waits_for_a_later_time_and_returns_at_once_for_an_earlier_one():
    time = FakeTime()
    clock = WallClock(time, time.pass_by)
    assert clock.ready(0.0, 0.0) == 0.0
    clock.wait(0.25)
    assert clock.ready(0.0, 0.0) == pytest.approx(0.25)
    clock.wait(0.1)
    assert clock.ready(0.0, 0.0) == pytest.approx(0.25)
