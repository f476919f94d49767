"""Algorithm 1 against a naive version, and every option by its claim."""

from dataclasses import replace

import numpy as np
import pytest
from point import (
    GOAL,
    PLAIN,
    POINT,
    REST,
    SAMPLING,
    START,
    T,
    White,
    drawn,
    make,
    naive,
    naive_cost,
    perturbed,
)
from scipy.signal import savgol_coeffs

from quadsim.controllers.costs import Term
from quadsim.controllers.lanes.lanes import compiled_module
from quadsim.controllers.mppi import MPPI
from quadsim.controllers.samplers import SAMPLERS, Gaussian
from quadsim.controllers.update import SAVITZKY_GOLAY, savitzky_golay, weights
from quadsim.course import load_course
from quadsim.dynamics.estimate import Estimate

EVERY = [*SAMPLERS, White((0.8, 0.5))]
NAMES = [*SAMPLERS, "own"]


@pytest.mark.compiled
@pytest.mark.parametrize("sampler", EVERY, ids=NAMES)
@pytest.mark.parametrize(("samples", "step_size"), [(2, 1.0), (64, 1.0), (65, 0.4)])
def test_plan_is_that_of_a_naive_version_given_the_same_noise(sampler, samples, step_size):
    mppi = make(sampler=sampler, samples=samples, step_size=step_size)
    z = drawn(mppi)
    rest = int(0.1 * samples)
    z[0] = 0
    # else the last samples perturb the plan without its momentum, here none yet
    if not mppi.sampler.momentum:
        z[samples - rest :] += (REST - mppi.plan).T
    expected, ess = naive(mppi.plan, z, 0.1, step_size)
    colder, _ = naive(mppi.plan, z, 0.09, step_size)
    stats = mppi.iterate(START, 0)
    np.testing.assert_allclose(mppi.plan, expected, atol=1e-5)
    assert stats.ess == pytest.approx(ess, rel=1e-3)
    # one of two samples may have all the weight
    assert abs(mppi.plan - colder).max() > 3e-5 or ess < 1.001


class Wall:
    """A term with a number of its own."""

    def __init__(self, place):
        self.place = place

    def __call__(self, x, x_next, u, goal, p):
        return abs(x_next.px - self.place)


def test_a_number_that_a_term_holds_counts_as_it_is_when_the_planner_is_made():
    """A planner that was made later flew with the number of the first one."""
    wall = Wall(0.0)
    cost = replace(GOAL, terms=(*GOAL.terms, Term(wall, 5.0)))

    def loops(cost):
        """Return the loops, which are not compiled here, of a planner that is made now."""
        mppi = MPPI(POINT, cost, Gaussian(SAMPLING["sigma"]), PLAIN, seed=3)
        return compiled_module(mppi.rollout.system, mppi.rollout.cost, np.float32)

    before = loops(cost)
    wall.place = 3.0
    assert loops(cost) is loops(replace(cost, terms=(*GOAL.terms, Term(Wall(3.0), 5.0))))
    assert loops(cost) is not before


WILD = (5.0, 5.0)
FIRST, SECOND = load_course("lsy_track"), load_course("figure8")


@pytest.mark.compiled
def test_iterations_go_on_from_each_others_plans():
    mppi, other = make(iterations=3), make()
    u, _ = mppi.control(START)
    for _ in range(3):
        other.iterate(START, 0)
    np.testing.assert_array_equal(mppi.plan, other.plan)
    np.testing.assert_array_equal(u, mppi.plan[0])


@pytest.mark.compiled
def test_first_plan_has_iterations_of_its_own():
    mppi, other = make(first_iterations=5, iterations=2), make()
    for iterations in (5, 2):
        mppi.control(Estimate(0.0, START))
        for _ in range(iterations):
            other.iterate(START, 0)
        np.testing.assert_array_equal(mppi.plan, other.plan)


@pytest.mark.compiled
def test_a_plan_whose_course_has_changed_has_iterations_of_its_own():
    mppi, other = make(news_iterations=5, iterations=2), make()
    cost, places = mppi.cost, iter((FIRST, FIRST, SECOND, SECOND))
    mppi.cost_of = lambda course: cost
    for t, iterations in enumerate((5, 2, 5, 2)):
        mppi.control(Estimate(0.0, START, course=next(places)))
        for _ in range(iterations):
            other.iterate(START, 0)
        np.testing.assert_array_equal(mppi.plan, other.plan, err_msg=str(t))


@pytest.mark.compiled
@pytest.mark.parametrize("overshoot", [0.0, 0.3])
def test_plan_exceeds_the_limits_by_the_overshoot_and_the_control_does_not(overshoot):
    """A point far from its goal asks for all it can have."""
    mppi, limit = (
        make(sampler=Gaussian(WILD), samples=200, overshoot=overshoot),
        np.array(POINT.high),
    )
    for _ in range(40):
        u, _ = mppi.control(np.array([50.0, -50.0, 0.0, 0.0]))
    beyond = (abs(mppi.plan) - limit) / WILD
    assert beyond.max() == pytest.approx(overshoot, rel=0.1) if overshoot else beyond.max() <= 0
    assert (abs(u) <= limit + 1e-12).all()


@pytest.mark.compiled
def test_cost_of_the_nominal_plan_is_that_of_sample_zero():
    mppi = make()
    expected = naive_cost(mppi.plan)
    assert mppi.iterate(START, 0).cost == pytest.approx(expected, rel=1e-5)
    assert not perturbed(mppi)[0].any()


@pytest.mark.compiled
@pytest.mark.parametrize("horizon", [10, 40])
def test_temperature_meets_the_mean_over_the_horizon(horizon):
    """A constant cost c per step is J = c however long the horizon: here a point that stays 2 m
    off."""
    still = replace(POINT, low=(0.0, 0.0), high=(0.0, 0.0), rest=(0.0, 0.0))
    mppi = make(horizon=horizon, system=still)
    assert mppi.iterate(np.array([2.0, 0.0, 0.0, 0.0]), 0).cost == pytest.approx(4.0)


@pytest.mark.compiled
def test_last_samples_perturb_the_rest_control():
    mppi = make()
    raw, z = drawn(mppi), perturbed(mppi)
    np.testing.assert_array_equal(z[1:180], raw[1:180])
    np.testing.assert_allclose(
        mppi.plan + z[180:].swapaxes(1, 2), REST + raw[180:].swapaxes(1, 2), atol=1e-6
    )


@pytest.mark.compiled
@pytest.mark.parametrize("sampler", SAMPLERS)
def test_frozen_first_control_is_the_same_in_every_sample_and_stays(sampler):
    mppi = make(sampler=sampler, freeze_first=True)
    before = mppi.plan.copy()
    mppi.iterate(START, 0)
    np.testing.assert_array_equal(mppi.plan[0], before[0])
    assert (abs(mppi.plan - before)[1:] > 0).all()
    assert not perturbed(mppi)[:, :, 0].any()


def test_filter_is_savitzky_golay_of_five_points_and_order_two():
    np.testing.assert_allclose(SAVITZKY_GOLAY, savgol_coeffs(5, 2))
    t = np.arange(-2.0, 30.0)
    parabola = np.column_stack([t**2 - 3 * t, 2 - t])
    np.testing.assert_allclose(
        savitzky_golay(parabola[2:], parabola[:2])[:-2], parabola[2:-2], atol=1e-9
    )
    constant = np.full((6, 1), 3.0)
    np.testing.assert_allclose(savitzky_golay(constant, constant[:2]), constant)


@pytest.mark.compiled
def test_smooth_filters_the_plan_after_the_update():
    mppi, plain = make(smooth=True), make()
    mppi.iterate(START, 0)
    plain.iterate(START, 0)
    np.testing.assert_allclose(mppi.plan, savitzky_golay(plain.plan, np.tile(REST, (2, 1))))


@pytest.mark.parametrize("steps", [1, 3, T, T + 5])
def test_shift_drops_the_past_and_appends_rest(steps):
    mppi = make()
    before = mppi.plan.copy()
    mppi.shift(steps)
    np.testing.assert_array_equal(
        mppi.plan[: T - steps or None][: max(T - steps, 0)], before[steps:]
    )
    np.testing.assert_array_equal(mppi.plan[max(T - steps, 0) :], np.tile(REST, (min(steps, T), 1)))


@pytest.mark.compiled
def test_executed_controls_are_those_of_the_periods_that_passed():
    mppi = make()
    mppi.control(Estimate(1.0, START))
    first = mppi.plan.copy()
    mppi.control(Estimate(1.0 + 3 * POINT.dt, START))
    np.testing.assert_array_equal(mppi.executed, first[1:3])


@pytest.mark.compiled
def test_a_state_alone_is_one_control_period_after_the_last():
    told, plain = make(iterations=2), make(iterations=2)
    for k in range(4):
        expected, _ = told.control(Estimate(7.0 + k * POINT.dt, START))
        u, _ = plain.control(START)
        np.testing.assert_array_equal(u, expected)
    plain.control(START)
    told.control(Estimate(7.0 + 5 * POINT.dt, START))
    assert abs(told.plan - plain.plan).max() > 1e-3, (
        "the control: two periods later is another plan"
    )


@pytest.mark.compiled
def test_the_estimated_model_is_planned_with_from_then_on():
    """And an estimate without one leaves the model as it is."""
    heavy = replace(POINT, params=POINT.params._replace(**{POINT.params._fields[0]: 3.0}))
    told, given = make(), make(system=heavy)
    for estimate in (Estimate(0.0, START, model=heavy), Estimate(POINT.dt, START)):
        told.control(estimate)
        given.control(START)
        np.testing.assert_array_equal(told.plan, given.plan)
    other = make()
    other.control(START)
    assert abs(other.rollout.system.params[0] - told.rollout.system.params[0]) == pytest.approx(2.9)


@pytest.mark.compiled
def test_a_new_course_is_planned_on_with_its_own_cost_and_the_same_one_only_once():
    """Courses are the caller's own here: cost_of alone looks into them."""
    asked = []

    def cost_of(goal):
        asked.append(goal)
        return replace(GOAL, targets=np.array([goal]))

    mppi, plain = make(), make()
    mppi.cost_of, (near, far) = cost_of, ((1.0, 0.0), (5.0, 0.0))
    for k, goal in enumerate((near, near, far, None)):
        mppi.control(Estimate(k * POINT.dt, START, course=goal))
        plain.control(Estimate(k * POINT.dt, START, course=goal))
    assert asked == [near, far]
    assert mppi.cost.targets[0, 0] == 5.0
    assert plain.cost is GOAL, "without cost_of the cost stays as it is"


@pytest.mark.compiled
def test_first_call_does_not_shift():
    mppi, other = make(), make()
    mppi.control(Estimate(5.0, START))
    other.iterate(START, 0)
    np.testing.assert_array_equal(mppi.plan, other.plan)


@pytest.mark.compiled
def test_plan_stays_within_the_limits():
    mppi = make(sigma=(50.0, 50.0), temperature=1e-3, smooth=True)
    for _ in range(5):
        mppi.iterate(START, 0)
        assert np.all((mppi.plan >= POINT.low) & (mppi.plan <= POINT.high))
    assert np.any((mppi.plan == POINT.low) | (mppi.plan == POINT.high))


@pytest.mark.compiled
def test_iterations_lower_the_cost_of_the_plan():
    mppi = make(temperature=0.02)
    costs = [mppi.iterate(START, 0).cost for _ in range(30)]
    assert costs[-1] < 0.4 * costs[0]


@pytest.mark.compiled
@pytest.mark.parametrize("sampler", EVERY, ids=NAMES)
def test_plan_is_a_function_of_the_seed_for_any_number_of_threads(sampler, on_threads):
    def plan(seed=1):
        mppi = make(seed, sampler, iterations=2, samples=333)
        for _ in range(3):
            mppi.control(START)
        return mppi.plan

    one = on_threads(1, plan)
    np.testing.assert_array_equal(on_threads(2, plan), one)
    np.testing.assert_array_equal(plan(), one)
    assert (abs(plan(2) - one) > 0).all()


@pytest.mark.parametrize(
    ("x", "found"),
    [
        ((0.0, np.nan, 0.0, np.inf), "got py = nan, vy = inf;"),
        ((0.0, 1.0), "expected 4 numbers: px, py, vx, vy, got an array of shape "),
    ],
)
def test_state_that_is_no_state_is_refused_by_name(x, found):
    with pytest.raises(ValueError, match=found):
        make().control(np.array(x))


@pytest.mark.compiled
def test_tightened_limits_keep_a_share_of_the_way_from_rest_for_corrections():
    free, tight = make(sigma=WILD), make(sigma=WILD, tighten=0.25)
    np.testing.assert_allclose(tight.low - REST, 0.75 * (free.low - REST))
    np.testing.assert_allclose(tight.high - REST, 0.75 * (free.high - REST))
    for mppi in (free, tight):
        mppi.iterate(START, 0)
    assert ((tight.low <= tight.plan) & (tight.plan <= tight.high)).all()
    assert (free.plan < tight.low).any()


@pytest.mark.compiled
@pytest.mark.parametrize("tighten", [0.0, 0.25])
def test_a_system_may_have_no_limits(tighten):
    """Infinite limits are those that no sample reaches."""
    plans = []
    for limit in (np.inf, 1e6):
        free = replace(POINT, low=(-limit, -limit), high=(limit, limit))
        mppi = make(system=free, tighten=tighten)
        for _ in range(3):
            mppi.control(START)
        plans.append(mppi.plan)
    np.testing.assert_array_equal(*plans)
    assert np.isfinite(plans[0]).all()


@pytest.mark.compiled
@pytest.mark.parametrize("sampler", EVERY, ids=NAMES)
def test_a_planner_that_was_reset_plans_as_a_new_one(sampler):
    mppi, new = make(sampler=sampler, target_ess=30.0), make(sampler=sampler, target_ess=30.0)
    for _ in range(3):
        mppi.control(START)
    new.plan = np.tile(new.rest, (T, 1))
    there = START + 1.0
    mppi.reset()
    for _ in range(2):
        u, _ = mppi.control(there)
        expected, _ = new.control(there)
        np.testing.assert_array_equal(u, expected)
    np.testing.assert_array_equal(mppi.plan, new.plan)


def test_numbers_that_do_not_go_together_are_refused():
    with pytest.raises(ValueError, match=r"dt: expected the system's 0.1 s, got 0.01"):
        MPPI(POINT, GOAL, Gaussian((1.0, 1.0)))
    with pytest.raises(ValueError, match="sigma: expected 2 numbers, one per control, got 3"):
        MPPI(POINT, GOAL, Gaussian((1.0, 1.0, 1.0)), PLAIN)


def test_arguments_of_the_wrong_kind_are_named():
    cost = np.array([[1.0, 2.0]])
    with pytest.raises(ValueError, match="MPPI: cost: expected a Cost, got ndarray"):
        make().set_cost(cost)
    with pytest.raises(ValueError, match="MPPI: system: expected a System, got Cost"):
        MPPI(GOAL, POINT, Gaussian(sigma=(1.0, 1.0)))


def test_a_cost_that_is_not_a_number_is_named_as_such():
    with pytest.raises(FloatingPointError, match="3 times NaN"):
        weights(np.array([np.nan, np.nan, np.nan, np.inf]), 1.0)
    with pytest.raises(FloatingPointError, match="none: lower the weights"):
        weights(np.full(4, np.inf), 1.0)
