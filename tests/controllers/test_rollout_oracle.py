"""The compiled lanes against the float64 oracle: the same text, flown on numpy rows, on courses
drawn at random."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from oracle import SAME, decision_distance, fly_rows, to_lanes

from quadsim.controllers.costs import evaluate
from quadsim.controllers.costs.race import RaceWeights, race_cost
from quadsim.controllers.lanes.lanes import Rollout
from quadsim.controllers.lanes.layout import LANES
from quadsim.controllers.lanes.planner_loops import module_source
from quadsim.controllers.schedule import Schedule, step_lengths
from quadsim.course import Course, Cylinder, Gate, Start
from quadsim.dynamics.quadrotor import Delivered, LearnedModel, ModelParams, State, quadrotor

M, T = 500, 120  # M is no multiple of a block
RADIUS = 0.1
NOMINAL = ModelParams((0.1, 0.12, 0.2), 0.04, 0.3, (8.0, 8.0, 4.0), 36.0)
# every term counts
WEIGHTS = RaceWeights(1.0, 2.0, 0.5, 0.1, 1.0, 100.0, 3.0, 0.7, 20.0, margin=0.2, opening=0.6)
# A vehicle whose rotors were learned in flight, as the preset `race` flies: its loop has all lines.
LEARNED = Delivered(1.01, 0.0005, 0.0005, 0.002, -0.005, 0.005, 0.02)
SYSTEM = quadrotor(LearnedModel.of_model(NOMINAL, LEARNED), 0.01)
SEEDS = range(4)
# float32 rounds 20 m to 1e-6 m; after 120 steps that has grown to some 1e-5 m, and a decision
# closer than ten times that may fall either way. It costs about one sample in a hundred.
GRAZE = 1e-4  # [m]


# With an obstacle the loops test lines against all kinds of them. This one stands out of bounds.
BEYOND = Cylinder((6.0, 9.0, 0.0), 0.3, 8.0)


def random_course(seed, loop=False, obstacles=(BEYOND,)):
    """Six gates some 2 m apart, turned, pitched and rolled, along a winding line."""
    rng = np.random.default_rng(seed)
    position, heading, gates = np.array([0.0, 0.0, 3.0]), 0.0, []
    for _ in range(6):
        heading += rng.uniform(-0.15, 0.15)
        position = position + 2 * np.array(
            [np.cos(heading), np.sin(heading), rng.uniform(-0.1, 0.1)]
        )
        yaw, pitch, roll = (
            heading + rng.uniform(-0.4, 0.4),
            rng.uniform(-0.4, 0.4),
            rng.uniform(-0.8, 0.8),
        )
        gates.append(
            Gate(
                tuple(position.tolist()),
                yaw,
                pitch,
                roll,
                tuple(rng.uniform(1.8, 2.8, 2).tolist()),
                0.1,
            )
        )
    bounds = ((-3.0, 25.0), (-8.0, 8.0), (0.0, 8.0))
    start = Start((0.0, 0.0, 3.0), 0.0)
    return Course("random", "", tuple(gates), start, bounds, loop, 1, (), "", obstacles)


def launch(p=(0.0, 0.0, 3.0), v=(10.0, 0.0, 1.0)):
    at = dict(zip(State._fields, (*p, *v, 1.0), strict=False)) | {"thrust": 9.81}
    return np.array([at.get(name, 0.0) for name in State._fields])


def controls(seed, spread=0.8):
    """A plan near hover, and perturbations of it that are slow in part, rounded to float32.  (T,
    n_u), (M, n_u, T)"""
    rng = np.random.default_rng(seed + 100)
    slow = rng.normal(size=(M, 4, 1)) * np.array([2.0, 2.0, 2.0, 6.0])[:, None]
    z = spread * (slow + rng.normal(0, 2, (M, 4, T)))
    return np.tile(SYSTEM.rest, (T, 1)) + rng.normal(0, 0.3, (T, 4)), z.astype(np.float32)


@cache
def scene(seed):
    """A random course's cost, and its oracle."""
    cost = race_cost(random_course(seed), RADIUS, WEIGHTS, laps=1)
    return cost, fly_rows(SYSTEM, cost, launch(), *controls(seed), clearance=decision_distance)


def fly_lanes(cost, x0, U, z, target=0, dtype=np.float32, halves=1, schedule=SAME):
    J = np.empty((-(-len(z) // LANES), LANES), dtype)
    Rollout(SYSTEM, cost, dtype, schedule)(x0, U, to_lanes(z, halves, dtype), target, J)
    return J.ravel()[: len(z)]


def out_of_reach(cost):
    """The cost with all frames and obstacles out of reach, which compiles nothing anew."""
    obstacles = replace(cost.obstacles, near=lambda x, seconds: cost.obstacles.rows[:0])
    return replace(cost, obstacles=obstacles)


def assert_agree(J, oracle, rtol=3e-5, graze=GRAZE):
    clear = oracle.clearance > graze
    assert clear.mean() > 0.95
    np.testing.assert_allclose(J[clear], oracle.J[clear], rtol=rtol, atol=10 * rtol)


@pytest.mark.compiled  # It takes its time for the scenes that the lanes fly.
def test_scenes_are_lively():
    """Several gates within one horizon, crashes and clean flights, and no term idle."""
    gates = np.concatenate([scene(seed)[1].reached for seed in SEEDS])
    crashed = np.concatenate([scene(seed)[1].crashed for seed in SEEDS])
    assert np.all([np.mean(gates == n) > 0.01 for n in (1, 2, 3, 4)])
    assert 0.2 < crashed.mean() < 0.8
    assert 0.1 < crashed[gates >= 2].mean() < 0.8
    terms = np.concatenate([scene(seed)[1].terms for seed in SEEDS])
    assert np.all(np.mean(terms != 0.0, axis=0) > 0.2)


@pytest.mark.compiled
@pytest.mark.parametrize("seed", SEEDS)
def test_float32_lanes_agree_with_the_oracle(seed):
    cost, oracle = scene(seed)
    assert_agree(fly_lanes(cost, launch(), *controls(seed)), oracle)


# In make test, test_race_value holds another loop in float64 to its oracle.
@pytest.mark.regression
@pytest.mark.parametrize("seed", SEEDS)
def test_float64_lanes_are_the_oracle_to_rounding(seed):
    cost, oracle = scene(seed)
    assert_agree(
        fly_lanes(cost, launch(), *controls(seed), dtype=np.float64),
        oracle,
        rtol=1e-12,
        graze=1e-10,
    )


@pytest.mark.compiled
def test_perturbations_and_cost_are_weighted_along_the_horizon():
    cost, even = scene(0)
    rising = Schedule(first_noise=0.3, cost_rise=2.0)
    oracle = fly_rows(
        SYSTEM, cost, launch(), *controls(0), clearance=decision_distance, schedule=rising
    )
    assert_agree(fly_lanes(cost, launch(), *controls(0), schedule=rising), oracle)
    assert np.mean(abs(oracle.J - even.J) > 1e-2) > 0.9
    assert rising.cost(T).mean() == pytest.approx(1.0)
    assert rising.noise(T)[:, [0, -1]].tolist() == [[0.3, 1.0], [1.0, 1.0]]


@pytest.mark.compiled
def test_lanes_with_longer_steps_agree_with_the_oracle():
    cost, _ = scene(0)
    lengths = step_lengths(T, 0.01, doubling=0.4)
    U, z = controls(0)
    U = U[: len(lengths)]
    longer = Schedule(first_noise=0.3, cost_rise=2.0, lengths=lengths)
    z = z[:, :, : len(lengths)]
    oracle = fly_rows(SYSTEM, cost, launch(), U, z, clearance=decision_distance, schedule=longer)
    assert_agree(fly_lanes(cost, launch(), U, z, schedule=longer), oracle)
    assert 0.1 < oracle.crashed.mean() < 0.9


@pytest.mark.compiled
def test_lanes_leave_out_the_terms_without_weight_and_no_others():
    # The terms of the preset `race` on a course without obstacles, whose loops are its flights' own
    cost = race_cost(random_course(0, obstacles=()), RADIUS, RaceWeights(margin=0.2), laps=1)
    # adds up all terms
    oracle = fly_rows(SYSTEM, cost, launch(), *controls(0), clearance=decision_distance)
    source = module_source(SYSTEM, cost, np.float32)
    names = {name for name in cost.term_names if f"# term: {name}" in source}
    assert names == {"progress", "crash", "clearance"}
    assert "weight_speed" not in source
    assert_agree(fly_lanes(cost, launch(), *controls(0)), oracle)
    for name in ("progress", "crash", "clearance"):
        weighed = oracle.terms[:, cost.term_names.index(name)]
        assert np.mean(abs(weighed) > 1e-2) > 0.1, f"leaving {name} out would be seen"


@pytest.mark.compiled
def test_model_that_is_one_per_cent_off_is_caught():
    cost, oracle = scene(0)
    J = fly_lanes(cost, launch(), *controls(0))
    other = quadrotor(replace(NOMINAL, drag=1.01 * NOMINAL.drag), 0.01)
    wrong = fly_rows(other, cost, launch(), *controls(0))
    assert np.mean(abs(J - wrong.J) > 10 * abs(J - oracle.J)) > 0.9


@pytest.mark.compiled
def test_gate_that_is_not_advanced_changes_the_samples_that_passed_it_alone():
    cost, oracle = scene(1)
    first_only = replace(cost, targets=cost.targets[:1])
    J, stuck = (fly_lanes(c, launch(), *controls(1)) for c in (cost, first_only))
    np.testing.assert_array_equal(stuck != J, oracle.reached > 0)
    assert_agree(
        stuck, fly_rows(SYSTEM, first_only, launch(), *controls(1), clearance=decision_distance)
    )


@pytest.mark.compiled
def test_lanes_start_in_mid_course_and_run_into_the_next_lap():
    course = random_course(2, loop=True)
    cost, gate = race_cost(course, RADIUS, WEIGHTS, laps=2), course.gates[4]
    x0 = launch(np.array(gate.position) - 2 * gate.rotation[:, 0], 10 * gate.rotation[:, 0])
    oracle = fly_rows(SYSTEM, cost, x0, *controls(2), target=4, clearance=decision_distance)
    assert np.mean(oracle.reached == 2) > 0.05  # on the way to the first gate again
    assert_agree(fly_lanes(cost, x0, *controls(2), target=4), oracle)


@pytest.mark.compiled
def test_lanes_that_start_within_the_frame_of_a_gate_just_passed_mind_it():
    """Slowly, behind its plane, near its left bar, drifting left."""
    cost, gate = scene(2)[0], random_course(2).gates[0]
    at = np.array((0.03, gate.opening[0] / 2 - RADIUS - 0.1, 0.0))
    x0 = launch(gate.position + gate.rotation @ at, gate.rotation @ np.array((0.5, 0.3, 0.0)))
    crashes = []
    for c in (cost, out_of_reach(replace(cost, still_in_gate=None))):
        oracle = fly_rows(SYSTEM, c, x0, *controls(2), target=1, clearance=decision_distance)
        # The path drifts along the bar, so a wider bound would leave out too many samples.
        assert_agree(fly_lanes(c, x0, *controls(2), target=1), oracle, graze=3e-5)
        crashes.append(oracle.crashed.mean())
    assert crashes[1] + 0.2 < crashes[0] < 0.8


@pytest.mark.compiled
def test_target_beyond_the_last_row_is_the_last_row():
    cost, _ = scene(0)
    last, beyond = (
        fly_lanes(cost, launch(), *controls(0), target=t) for t in (len(cost.targets) - 1, 99)
    )
    np.testing.assert_array_equal(last, beyond)


@pytest.mark.compiled
def test_controls_are_clipped_at_their_limits():
    cost, _ = scene(3)
    U, z = controls(3, spread=20.0)
    J, oracle = (
        fly_lanes(cost, launch(), U, z),
        fly_rows(SYSTEM, cost, launch(), U, z, clearance=decision_distance),
    )
    assert_agree(J, oracle)
    free = replace(SYSTEM, low=(-np.inf,) * 4, high=(np.inf,) * 4)
    assert np.mean(abs(J - fly_rows(free, cost, launch(), U, z).J) > 1e-2) > 0.9


@pytest.mark.compiled
def test_cost_of_a_sample_depends_on_neither_its_place_nor_the_threads(on_threads):
    cost, _ = scene(0)
    U, z = controls(0)
    J = on_threads(1, lambda: fly_lanes(cost, launch(), U, z))
    np.testing.assert_array_equal(on_threads(2, lambda: fly_lanes(cost, launch(), U, z)), J)
    np.testing.assert_array_equal(fly_lanes(cost, launch(), U, z, halves=2), J)
    np.testing.assert_array_equal(fly_lanes(cost, launch(), U, z[::-1])[::-1], J)


@pytest.mark.slow
def test_terms_on_floats_are_those_on_numpy_rows():
    """At steps of some 0.3 m around the first gate's centre."""
    cost, _ = scene(0)
    rng, target, u = np.random.default_rng(0), cost.targets[0], (0.0,) * 4
    x = launch(target[:3])[:, None] + rng.normal(0, 0.3, (len(State._fields), 200))
    x_next = x + rng.normal(0, 0.3, x.shape)

    def everything(found):
        return [*found.terms.values(), found.reached, found.crashed]

    rows = everything(evaluate(cost, State(*x), State(*x_next), u, target, np.zeros(200)))
    pairs = zip(x.T.tolist(), x_next.T.tolist(), strict=True)
    floats = np.array(
        [everything(evaluate(cost, State(*a), State(*b), u, target)) for a, b in pairs], float
    )
    assert floats[:, -2:].any(axis=0).all()  # some reach, some crash
    np.testing.assert_allclose(np.array(np.broadcast_arrays(*rows), float), floats.T, rtol=1e-13)
