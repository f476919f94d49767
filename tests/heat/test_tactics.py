"""Patience is lost behind a vehicle that is closely ahead."""

from types import SimpleNamespace

import numpy as np
import pytest

import quadsim
from quadsim.controllers.costs.keep_clear import Clearance, KeepClear
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.quadrotor import State
from quadsim.heat.aware_planner import CLOSE, AwarePlanner, Perception, Tactics
from quadsim.heat.expectations import ConstantVelocity
from quadsim.heat.patience import Patience
from quadsim.heat.traffic import Sight, Sighting, Traffic
from quadsim.physics.plant import start_state

COURSE = quadsim.load_course("split_s_swift")
HERE = np.array(start_state(COURSE.start, 0.1))


def nearer_to_gate(meters):
    """Return the place that is nearer to the first gate than the start by some metres."""
    way = np.array(COURSE.gates[0].position) - HERE[:3]
    return tuple((HERE[:3] + meters * way / np.linalg.norm(way)).tolist())


def test_patience_is_lost_behind_a_vehicle_and_comes_back_when_that_is_past():
    patience = Patience(1.0)
    times = iter(np.arange(0.0, 10.0, 0.25))

    def shares(count, follows):
        return [patience.share(1, next(times), follows) for _ in range(count)]

    assert shares(6, follows=True) == [1.0, 0.875, 0.75, 0.625, 0.5, 0.5]
    assert patience.share(2, 1.25, follows=True) == 1.0  # it is lost behind one vehicle alone
    assert shares(5, follows=False) == [0.625, 0.75, 0.875, 1.0, 1.0]


@pytest.mark.parametrize(
    ("ahead", "passed", "follows"),
    [(1.0, 0, True), (-1.0, 0, False), (CLOSE + 0.1, 0, False), (-1.0, 1, True)],
)
def test_a_vehicle_is_followed_that_is_near_and_has_come_farther(ahead, passed, follows):
    seen = Sighting(0.0, nearer_to_gate(ahead), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), passed)
    perception = Perception(0, SimpleNamespace(), 0.0, COURSE)
    assert perception.follows(seen, Estimate(0.0, HERE, 0)) is follows


class Numbers:
    """A planner that plans nothing, and keeps the numbers of its term."""

    def __init__(self, term):
        self.numbers = term.scaled()

    def set_numbers(self, name, **numbers):
        self.numbers = numbers


def kept(tactics):
    """Return the numbers of the term that keeps clear of a vehicle in five plans, a second apart.

    The vehicle is a metre ahead in the first three plans, and a metre behind in the others.
    """
    traffic = Traffic(2, Sight(), [np.random.SeedSequence(k) for k in range(2)])
    term = KeepClear(1, "clear_of_1", Clearance(200.0, 0.6, 0.8, 0.4), horizon=4)
    mppi = Numbers(term)
    planner = AwarePlanner(
        SimpleNamespace(set_numbers=mppi.set_numbers, control=lambda estimate: None),
        Perception(0, traffic, 0.0, COURSE),
        ConstantVelocity(),
        {1: term},
        tactics=tactics,
    )
    found = []
    for t, ahead in enumerate([1.0, 1.0, 1.0, -1.0, -1.0]):
        x, y, z = nearer_to_gate(ahead)
        traffic.note(1, float(t), State(*HERE)._replace(px=x, py=y, pz=z), 0)
        planner.control(Estimate(float(t), HERE, 0))
        found.append(mppi.numbers)
    return found


def test_a_planner_keeps_less_distance_from_a_vehicle_that_is_ahead_for_long():
    numbers = kept(Tactics(patience=Patience(2.0)))
    assert [one["keep"] for one in numbers] == pytest.approx([0.6, 0.45, 0.3, 0.45, 0.6])
    assert all(one["per_square"] == 1.0 / one["keep"] ** 2 for one in numbers)
    assert {one["weight"] for one in numbers} == {200.0}


def test_without_patience_the_distance_is_always_the_same():
    assert [one["keep"] for one in kept(None)] == [0.6] * 5


def test_a_vehicle_that_is_behind_weighs_by_the_share_of_those_ahead():
    numbers = kept(Tactics(ahead_share=0.25))
    assert [one["weight"] for one in numbers] == [200.0, 200.0, 200.0, 50.0, 50.0]
    assert {one["keep"] for one in numbers} == {0.6}
