"""Commands that the vehicle can follow, where its flight controller does not give up thrust to roll
and pitch."""

from dataclasses import replace

import numpy as np
import pytest

from quadsim.config.build import planner_of
from quadsim.config.spec import Spec
from quadsim.course import load_course
from quadsim.dynamics.quadrotor import Control, ModelParams, quadrotor
from quadsim.physics.plant import start_state
from quadsim.vehicle import load_vehicle
from tests.small import SMALL

DT = 0.01
NOMINAL = ModelParams.of(load_vehicle("swift"))


def test_a_planner_that_has_to_gives_up_thrust_to_roll_and_pitch():
    x, u = launch_state(), Control(4.0, -3.0, 1.0, NOMINAL.thrust_max)
    system = quadrotor(replace(NOMINAL, tilt_first=False), DT)
    assert quadrotor(NOMINAL, DT).attainable is None
    given = system.attainable(x, u, system.params)
    assert given.body_rates == u.body_rates
    assert system.next(x, given) == pytest.approx(system.next(x, u)), "the model gives up the same"
    assert given.thrust < 0.97 * NOMINAL.thrust_max
    level = Control(0.0, 0.0, 1.0, NOMINAL.thrust_max)
    assert system.attainable(x, level, system.params) == level


@pytest.mark.compiled
def test_what_is_commanded_is_what_the_vehicle_can_follow():
    spec = Spec.of("paper_flat", vehicle="swift", preset="race", **SMALL)
    mppi, x = planner_of(spec, spec.streams.planner), np.array(launch_state())
    mppi.plan[0] = 4.0, -3.0, 0.0, NOMINAL.thrust_max
    asked = mppi.command(x)
    assert asked == pytest.approx(mppi.clipped(mppi.plan[0]))
    mppi.set_model(quadrotor(replace(NOMINAL, tilt_first=False), DT))
    assert mppi.command(x)[3] < asked[3] - 1.0


def launch_state():
    return start_state(load_course("figure8").start, 0.1)
