"""A plan keeps its effect when another model of the vehicle is learned."""

import numpy as np
import pytest

from quadsim.config.build import planner_of
from quadsim.config.spec import Spec
from quadsim.course import load_course
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.quadrotor import (
    Control,
    Delivered,
    LearnedModel,
    ModelParams,
    State,
    quadrotor,
)
from quadsim.physics.plant import start_state
from quadsim.vehicle import load_vehicle
from tests.small import SMALL

DT = 0.01
NOMINAL = ModelParams.of(load_vehicle("swift"))
SOUND = quadrotor(LearnedModel.of_model(NOMINAL, Delivered()), DT)
# A rotor at 80 %, roughly, and a torque that is always there.
WEAK = quadrotor(LearnedModel.of_model(NOMINAL, Delivered(0.95, 0.9, -0.7, 0.1, 0.5, 0.2, 0.1)), DT)


def test_the_command_has_the_same_effect_with_weak_rotors():
    x, u = launch_state(), Control(1.0, -0.5, 0.2, 15.0)
    changed = WEAK.adapted(u, SOUND, WEAK)
    assert WEAK.next(x, changed) == pytest.approx(SOUND.next(x, u), abs=1e-9)
    assert WEAK.next(x, u) != pytest.approx(SOUND.next(x, u), abs=1e-3), "it would turn"
    assert SOUND.adapted(changed, WEAK, SOUND) == pytest.approx(u), "the rotors are sound again"


def test_no_more_thrust_is_asked_for_than_there_is():
    full = Control(0.0, 0.0, 0.0, SOUND.high.thrust)
    assert WEAK.adapted(full, SOUND, WEAK).thrust == full.thrust
    assert WEAK.high.thrust < full.thrust, "as yaw needs a reserve"


def test_a_model_with_the_same_rotors_leaves_the_command_to_the_last_bit():
    u = Control(0.3, 0.1, -0.7, 17.3)
    heavier = quadrotor(LearnedModel.of_model(NOMINAL, Delivered()), DT)
    assert heavier.adapted(u, SOUND, heavier) == u
    assert quadrotor(NOMINAL, DT).adapted is None


@pytest.mark.compiled
def test_the_plan_changes_when_a_model_is_learned():
    spec = Spec.of("paper_flat", vehicle="swift", preset="race", adapt=True, **SMALL)
    mppi, x = planner_of(spec, spec.streams.planner), np.array(launch_state())
    before = mppi.plan.copy()
    mppi.use_estimates(Estimate(0.0, x, model=WEAK))
    expected = [WEAK.adapted(Control(*u), SOUND, WEAK) for u in before]
    assert mppi.plan == pytest.approx(np.array(expected))
    assert mppi.plan == pytest.approx(np.tile(mppi.rest, (len(before), 1)), abs=1.0)


def launch_state() -> State:
    return start_state(load_course("figure8").start, 0.1)
