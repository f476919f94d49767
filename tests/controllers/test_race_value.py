"""The term `time_to_go`: the least of its definition, without steps, the same in the lanes."""

import pickle
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from oracle import decision_distance, fly_rows
from race_cases import course, gate
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import minimize
from test_rollout_oracle import RADIUS, SYSTEM, controls, fly_lanes, launch, random_course

from quadsim.config.build_cost import cost_on, value_of
from quadsim.config.build_plant import system_of
from quadsim.config.spec import Spec
from quadsim.controllers.costs import StateTerm
from quadsim.controllers.costs.race import RaceWeights, map_value, margin_of, race_cost
from quadsim.controllers.costs.race_targets import RUN_OUT
from quadsim.controllers.costs.race_value import OUTSIDE, Behind, time_to_go
from quadsim.controllers.lanes.lanes import Rollout
from quadsim.controllers.lanes.layout import LANES
from quadsim.controllers.lanes.planner_loops import module_source
from quadsim.controllers.sampled_trajectories import terms_of
from quadsim.controllers.schedule import Schedule
from quadsim.dynamics.quadrotor import State
from quadsim.value import PointMass
from quadsim.value.leg import THRUST_SHARE, States, mean_square

SPEC = Spec.of("split_s_swift", laps=1, time_to_go=2.0)
COST = cost_on(SPEC, SPEC.course)
VALUE = value_of(SPEC, SPEC.planner.cost)
TERM = COST.terms[-1]
K = len(VALUE.passages) - 1  # gates; the last passage lies behind the finish


def to_go(position, velocity, k):
    """The term, unweighted, at states on the way to gate k.  (n,)"""
    columns = np.column_stack([np.atleast_2d(position), np.atleast_2d(velocity)]).T
    rest = np.zeros((len(State._fields) - 6, columns.shape[1]))
    return time_to_go(State(*columns, *rest), COST.row._make(COST.targets[k]), TERM.parameters)


def by_definition(position, velocity, k):
    """The least over times and crossings within the opening, by a general optimiser."""
    row = COST.row._make(COST.targets[k])
    slope, curve = np.array(row[-10:]).reshape(2, 5)
    start = States(position, velocity)
    half = VALUE.passages.half[k]

    def cost(numbers):
        z, T = numbers[:5], numbers[5]
        thrust = mean_square(start, VALUE.passages.states(z, k), VALUE.mass.drag, T)
        price = (1.0 - THRUST_SHARE + THRUST_SHARE * thrust / VALUE.mass.thrust**2) * T
        return price + row.later + (slope * z + 0.5 * curve * z * z).sum()

    bounds = [(-half[0], half[0]), (-half[1], half[1]), *[(-60.0, 60.0)] * 3, (0.01, 3.0)]
    starts = (np.append(VALUE.crossings[k], T) for T in (0.1, 0.3, 0.6))
    found = [minimize(cost, start, method="L-BFGS-B", bounds=bounds).fun for start in starts]
    return min(found)


def on_the_way(n):
    """States around the best way, with the gate that they are on the way to."""
    rng = np.random.default_rng(0)
    at = VALUE.passages.states(VALUE.crossings)
    for _ in range(n):
        k = int(rng.integers(1, K))
        T = VALUE.to_go[k - 1] - VALUE.to_go[k]
        ends = np.stack([at.position[k - 1], at.position[k]])
        leg = CubicHermiteSpline((0.0, T), ends, np.stack([at.velocity[k - 1], at.velocity[k]]))
        t = rng.uniform(0.0, 0.8) * T
        yield leg(t) + rng.normal(0, 0.3, 3), leg(t, 1) + rng.normal(0, 2.0, 3), k


@pytest.mark.slow
def test_it_is_the_least_of_its_definition():
    off = [float(to_go(p, v, k)[0]) - by_definition(p, v, k) for p, v, k in on_the_way(20)]
    assert np.median(np.abs(off)) < 0.5e-3  # [s]
    assert np.quantile(np.abs(off), 0.9) < 10e-3


def test_on_the_best_way_it_is_the_time_to_go():
    at = VALUE.passages.states(VALUE.crossings)
    for k in range(K - 1):
        found = to_go(at.position[k], at.velocity[k], k + 1)
        assert found == pytest.approx(VALUE.to_go[k], abs=2e-3)
    start = np.array(SPEC.course.start.position)
    assert to_go(start, np.zeros(3), 0) == pytest.approx(VALUE.time, abs=2e-3)


@pytest.mark.parametrize(
    "away",
    [gate(5.0, z=23.0), gate(14.0, z=24.0, pitch=90.0), gate(5.0, y=5.0, yaw=180.0)],
    ids=["above the last one", "straight down", "back"],
)
def test_gates_that_face_away_are_turned_to(away):
    """The last gate is left behind the plane of the next one, which is still crossed forward."""
    course_ = course(gate(5.0), away, gate(25.0, z=21.0))
    weights = RaceWeights(margin=0.2, time_to_go=2.0)
    value = map_value(course_, RADIUS, margin_of(weights), 1, PointMass(40.0, 0.3))
    cost = race_cost(course_, RADIUS, weights, 1, value=value)
    at = value.passages.states(value.crossings)
    rest = (1.0, *[0.0] * (len(State._fields) - 7))
    for k in range(2):
        x = State(*at.position[k], *at.velocity[k], *rest)
        row = cost.row._make(cost.targets[k + 1])
        found = time_to_go(x, row, cost.terms[-1].parameters)
        assert found == pytest.approx(value.to_go[k], abs=20e-3)


def test_it_has_no_step_at_a_gate():
    """Just before a gate it is what it is behind it, also beside the best crossing."""
    rng = np.random.default_rng(1)
    for k in range(K - 1):
        crossings = VALUE.crossings[k] + rng.normal(0, (0.3, 0.3, 1.0, 1.0, 1.0), (40, 5))
        half = VALUE.passages.half[k]
        crossings[:, :2] = np.clip(crossings[:, :2], -0.8 * half, 0.8 * half)
        at = VALUE.passages.states(crossings, k)
        before = 0.02 / crossings[:, 2]  # [s] two centimetres from the gate
        behind = to_go(at.position, at.velocity, k + 1)
        in_front = to_go(at.position - before[:, None] * at.velocity, at.velocity, k)
        step = in_front - before - behind
        assert np.median(np.abs(step)) < 6e-3
        assert np.quantile(np.abs(step), 0.9) < 30e-3  # at the double gate; 3 ms at the others
        assert np.ptp(behind) > 60e-3


def test_missed_gates_cost_and_the_finish_pays():
    passage = SPEC.course.gates[2].rotation[:, 0]
    exit_ = COST.targets[2][:3]
    velocity = 10.0 * passage
    missed = to_go(exit_ + 0.5 * passage, velocity, 2)
    assert missed > to_go(exit_ - 0.5 * passage, velocity, 2) + 0.3
    assert missed < to_go(exit_ + 2.0 * passage, velocity, 2)
    last = SPEC.course.gates[-1].rotation[:, 0]
    finish = COST.targets[-1][:3] - RUN_OUT * last
    before = to_go(finish - 0.1 * last, 10.0 * last, K - 1)
    nearer, farther, faster = (
        to_go(finish + d * last, v * last, K) for d, v in ((0.1, 10.0), (1.0, 10.0), (1.0, 12.0))
    )
    assert before > nearer > farther > faster
    assert before - nearer < 0.03


def test_crossings_beside_the_opening_cost():
    k = 2
    at = VALUE.passages.states(VALUE.crossings[k] * [0, 0, 1, 0, 0], k)
    left = VALUE.passages.rotation[k][:, 1]
    half = VALUE.passages.half[k][0]
    close = at.position - 0.02 * at.velocity
    within, beside = (to_go(close + y * left, at.velocity, k)[0] for y in (0.0, half + 1.0))
    assert beside > within + 0.5 * OUTSIDE


def test_displaced_gates_take_their_value_with_them():
    x, y, z = SPEC.course.gates[2].position
    gates = list(SPEC.course.gates)
    gates[2] = replace(gates[2], position=(x + 0.5, y, z + 0.3))
    cost = cost_on(SPEC, replace(SPEC.course, gates=tuple(gates)))
    changed = {COST.row._fields[k] for k in np.nonzero(cost.targets != COST.targets)[1]}
    assert {"x", "z"} <= changed
    assert not changed & set(Behind._fields)


def test_a_cost_without_it_has_the_loops_without_marks():
    without = Spec.of("split_s_swift", laps=1, time_to_go=0)
    plain = module_source(system_of(SPEC), cost_on(without, without.course), np.float32)
    assert "mark_factor" not in plain
    assert "mark_factor" in module_source(system_of(SPEC), COST, np.float32)


def test_it_is_copied_with_other_numbers_and_to_other_processes():
    for copy in (TERM.but(weight=3.0), pickle.loads(pickle.dumps(TERM)).but(weight=3.0)):
        assert isinstance(copy, StateTerm)
        assert copy.weight == 3.0
        assert copy.parameters == TERM.parameters


def test_marks_carry_the_weights_of_all_steps():
    schedule = Schedule(cost_rise=2.0)
    for horizon in (7, 40, 75):
        marks = schedule.marks(horizon, 10)
        assert marks.sum() == pytest.approx(horizon)
        assert np.flatnonzero(marks).tolist() == [*range(9, horizon - 1, 10), horizon - 1]


@cache
def scene():
    """Return the cost of a drawn course with the term, and the oracle's flights along it.

    The lanes of this cost are loops of their own, as no other test has this term.
    """
    drawn = random_course(0, obstacles=())
    weights = RaceWeights(margin=0.2, time_to_go=2.0)
    value = map_value(drawn, RADIUS, margin_of(weights), 1, PointMass(36.0, 0.3))
    cost = race_cost(drawn, RADIUS, weights, 1, value=value)
    return cost, fly_rows(SYSTEM, cost, launch(), *controls(0), clearance=decision_distance)


@pytest.mark.compiled
def test_lanes_agree_with_the_oracle():
    cost, oracle = scene()
    J = fly_lanes(cost, launch(), *controls(0), dtype=np.float64)
    clear = oracle.clearance > 1e-10
    np.testing.assert_allclose(J[clear], oracle.J[clear], rtol=1e-9)
    assert np.ptp(oracle.terms[clear, -1]) > 0.5  # the term differs from sample to sample


@pytest.mark.compiled
def test_the_terms_that_are_shown_sum_to_what_the_rollout_says():
    """In the loops of the test above, also with costs that rise along the horizon."""
    cost, oracle = scene()
    U, z = controls(0)
    v = np.clip(U.T + z[:LANES], np.array(SYSTEM.low)[:, None], np.array(SYSTEM.high)[:, None])
    rollout = Rollout(SYSTEM, cost, np.float64, Schedule(cost_rise=2.0))
    found = rollout.trajectories(launch(), v, 0)
    clear = np.flatnonzero(oracle.clearance[:LANES] > 1e-10)
    assert len(clear) > LANES / 2
    terms = [terms_of(rollout, launch(), v[m], 0, found.sample(m)) for m in clear]
    assert np.ptp([of_sample["time_to_go"] for of_sample in terms]) > 0.5
    sums = [sum(of_sample.values()) for of_sample in terms]
    np.testing.assert_allclose(sums, found.J[clear], rtol=1e-9)
