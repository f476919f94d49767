"""A planner that plans the others' flights sees how they move, and expects them well."""

import numpy as np
import pytest

from quadsim.dynamics.quadrotor import Control, ModelParams, State, quadrotor
from quadsim.heat.expectations import ConstantVelocity, OwnPlans, Perceived, straight
from quadsim.heat.launch import heat_frames
from quadsim.heat.line_up import line_up
from quadsim.heat.result import HeatRecorder
from quadsim.heat.spec import HeatSpec
from quadsim.heat.traffic import Sighting
from quadsim.vehicle import load_vehicle
from tests.small import SMALL

DT = 0.01
MODEL = ModelParams.of(load_vehicle("swift"))
PLANNED = Control(0.0, 0.0, 0.0, 9.81)


def two_sightings(body_rates, thrust):
    """A vehicle at steady body rates and thrust, seen one control period apart."""
    x = State.of(
        position=(0.0, 0.0, 5.0),
        velocity=(6.0, -2.0, 1.0),
        attitude=(0.9238795, 0.3826834, 0.0, 0.0),
        body_rates=body_rates,
        thrust=thrust,
        angular_acceleration=(0.0, 0.0, 0.0),
    )
    after = State(*quadrotor(MODEL, DT).next(np.array(x), Control(*body_rates, thrust)))
    return [
        Sighting(t, one.position, one.velocity, one.attitude, 0)
        for t, one in ((0.0, x), (DT, after))
    ]


def act(body_rates, thrust, velocity_noise=0.0):
    """Return what is found of the control that acts."""
    before, now = two_sightings(body_rates, thrust)
    expectation = OwnPlans(0, lambda m: None, velocity_noise)
    expectation._before = {1: before}
    return expectation._seen_to_act(1, now, PLANNED, MODEL)


@pytest.mark.parametrize("thrust", [12.0, 30.0])
@pytest.mark.parametrize("body_rates", [(2.0, 0.0, 0.0), (-1.0, 3.0, 0.5)])
def test_body_rates_and_thrust_are_seen_in_how_a_vehicle_moves(body_rates, thrust):
    found = act(body_rates, thrust)
    assert found.body_rates == pytest.approx(body_rates, abs=0.02)
    assert found.thrust == pytest.approx(thrust, abs=0.3)
    assert abs(found.thrust - PLANNED.thrust) > 1.0  # which the plan would have been off by


def test_the_thrust_of_the_plan_counts_where_velocities_are_seen_with_noise():
    noisy = act((2.0, 0.0, 0.0), 30.0, velocity_noise=5.0)
    assert noisy.thrust == pytest.approx(PLANNED.thrust, abs=0.2)


def test_constant_velocity_is_a_straight_line():
    seen = Sighting(1.0, (1.0, 2.0, 3.0), (4.0, 0.0, -1.0), (1.0, 0.0, 0.0, 0.0), 0)
    path = ConstantVelocity().paths(Perceived({3: seen}, frozenset(), lambda: None))[3]
    assert path.at(np.array([1.5])) == pytest.approx(np.array([[3.0, 2.0, 2.5]]))
    assert straight(seen).at(np.array([1.0])) == pytest.approx(np.array([[1.0, 2.0, 3.0]]))


class Noted(OwnPlans):
    """Plans straight lines, and notes of whom each vehicle is expected to keep clear."""

    def __init__(self):
        super().__init__(0, lambda m: pytest.fail("nothing is planned here"))
        self.keeps_clear_of = {}

    def _plan(self, m, seen, around):
        self.keeps_clear_of[m] = set(around)
        return straight(seen)


def test_a_vehicle_behind_is_expected_to_make_way_and_one_ahead_is_not():
    seen = {
        m: Sighting(1.0, (m, 0.0, 3.0), (4.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), 0) for m in (1, 2, 3)
    }
    own = straight(seen[2])
    expectation = Noted()
    for _ in range(4):  # each in its turn
        expectation.paths(Perceived(seen, frozenset({3}), lambda: own))
    assert expectation.keeps_clear_of == {1: {1, 2, 3}, 2: {1, 2, 3}, 3: {0, 1, 2, 3}}


def errors(expect):
    """Return how far the other one was from where it was expected .2 s before [m]."""
    ahead = 0.2
    small = {**SMALL, "laps": 1, "timeout": 0.8}
    entrants, settings = line_up("split_s_swift", ["colored"] * 2, small | {"expect": expect})
    heat = HeatSpec(entrants, settings)
    recorder = HeatRecorder(heat)
    expected = []
    for frame in heat_frames(heat):
        recorder.add(frame)
        t = frame.t + ahead
        expected += [(m, t, path.at(np.array([t]))[0]) for m, path in frame.others]
    runs = recorder.runs()
    found = []
    for m, t, place in expected:
        columns = runs[m].telemetry
        if 0.3 < t < columns["t"][-1]:
            there = [np.interp(t, columns["t"], columns[axis]) for axis in ("px", "py", "pz")]
            found.append(np.linalg.norm(place - there))
    return np.array(found)


@pytest.mark.compiled
def test_plans_of_ones_own_are_nearer_the_truth_than_constant_velocity():
    own = errors("own")
    velocity = errors("velocity")
    assert len(own) > 50
    assert np.median(own) < 0.7 * np.median(velocity)
