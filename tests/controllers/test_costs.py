"""Costs as tuples of terms: names, weights and parameters, also ones that depend on the step of the
horizon."""

import ast
import keyword
import pickle
import re
from collections import Counter
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numpy import maximum, minimum
from oracle import fly_rows, to_lanes
from point import POINT

from quadsim.controllers.config import MPPIConfig
from quadsim.controllers.costs import Cost, Term, crash, evaluate
from quadsim.controllers.lanes.lanes import Rollout, compiled_module
from quadsim.controllers.lanes.layout import LANES
from quadsim.controllers.lanes.planner_loops import module_source
from quadsim.controllers.lanes.trace import TraceError
from quadsim.controllers.mppi import MPPI
from quadsim.controllers.sampled_trajectories import terms_of
from quadsim.controllers.samplers import Gaussian
from quadsim.dynamics.estimate import Estimate
from quadsim.paper.integrator import (
    Goal,
    PointControl,
    PointState,
    double_integrator,
    speed,
)

SYSTEM = double_integrator(0.05)
START = np.array([-1.0, 0.5, 0.4, 0.2])
M, T = 150, 30


def near(x, x_next, u, target, p):
    """Return the square of the distance to a point that may move [m^2]."""
    dx = x_next.px - p.x
    dy = x_next.py - p.y
    return dx * dx + dy * dy


def push(x, x_next, u, target, p):
    return u.ax_cmd * u.ax_cmd + u.ay_cmd * u.ay_cmd


def outside(x, x_next, u, target, p):
    """Return by how much the velocity is outside a band [m/s]."""
    return maximum(p.low - x_next.vx, 0.0) + maximum(x_next.vx - p.high, 0.0)


class Point(NamedTuple):
    x: float
    y: float


TERMS = (Term(near, 2.0), Term(push, 0.1), Term(outside, 3.0, name="band", low=0.2, high=1.5))
COST = Cost("moving", TERMS, Goal, np.zeros((1, 2)), params=Point(x=1.0, y=-0.5))


def along(x0, y0, vx, vy, steps=T):
    """Return a point that moves, at the end of each step."""
    t = SYSTEM.dt * np.arange(1, steps + 1)
    return Point(x=x0 + vx * t, y=y0 + vy * t)


def controls(seed=0, n_u=2, spread=2.0):
    rng = np.random.default_rng(seed)
    return rng.normal(0, 1, (T, n_u)), rng.normal(0, spread, (M, n_u, T)).astype(np.float32)


def fly_lanes(cost, U, z, system=SYSTEM, x0=START):
    J = np.empty((-(-len(z) // LANES), LANES), np.float32)
    Rollout(system, cost)(x0, U, to_lanes(z), 0, J)
    return J.ravel()[: len(z)]


def test_two_terms_of_one_name_are_refused_and_one_function_may_serve_two_terms():
    with pytest.raises(
        ValueError, match="cost moving: expected terms of different names, got two named 'push'"
    ):
        replace(COST, terms=(*TERMS, Term(push, 3.0)))
    assert replace(COST, terms=(*TERMS, Term(push, 3.0, name="again"))).term_names[-1] == "again"


def test_two_numbers_of_one_name_are_refused():
    """The parameter `low` of the term `band`, and a parameter `band_low` of the cost."""

    class Low(NamedTuple):
        band_low: float

    with pytest.raises(ValueError, match="got two named 'p_band_low'"):
        replace(COST, params=Low(0.0))


@pytest.mark.parametrize("name", ["fast yaw", "2nd", "a-b"])
def test_a_name_that_is_no_name_of_a_variable_is_refused(name):
    with pytest.raises(ValueError, match=f"term: expected a name as of a variable, .*got '{name}'"):
        Term(push, name=name)
    assert Term(partial(push), 1.0).name == "push"
    assert Term(partial(push), 1.0, name="pushed").name == "pushed"


def test_weights_and_parameters_are_one_row_of_numbers_by_their_names():
    (row,) = COST.numbers(T)
    assert dict(zip(COST.number_names, row.tolist(), strict=True)) == {
        "weight_near": 2.0,
        "weight_push": 0.1,
        "weight_band": 3.0,
        "p_x": 1.0,
        "p_y": -0.5,
        "p_band_low": 0.2,
        "p_band_high": 1.5,
    }


VARYING = {  # what varies along the horizon -> the cost with it
    "p_x": lambda values: replace(COST, params=Point(x=values, y=1.0)),
    "weight_push": lambda values: replace(
        COST, terms=(TERMS[0], TERMS[1].but(weight=values), TERMS[2])
    ),
    "p_band_high": lambda values: replace(COST, terms=(*TERMS[:2], TERMS[2].but(high=values))),
}


@pytest.mark.parametrize("name", VARYING)
def test_a_number_of_each_step_makes_a_row_of_each_step(name):
    values = np.linspace(0.0, 3.0, T)
    for given in (values, values.tolist()):
        rows = VARYING[name](given).numbers(T)
        k = COST.number_names.index(name)
        np.testing.assert_array_equal(rows[:, k], values)
        assert rows.shape == (T, len(COST.number_names))
        assert (np.ptp(np.delete(rows, k, axis=1), axis=0) == 0.0).all()


@pytest.mark.parametrize("name", VARYING)
def test_numbers_of_another_length_than_the_horizon_are_a_line_that_names_them(name):
    for shape in ((T - 1,), (T + 1,), (1,), (T, 2)):
        with pytest.raises(
            ValueError, match=rf"^cost moving: {name}: expected .* each of {T} steps, got shape"
        ) as caught:
            VARYING[name](np.ones(shape)).numbers(T)
        assert "\n" not in str(caught.value)
        assert str(caught.value).endswith(str(shape))


@pytest.mark.compiled
def test_a_planner_refuses_numbers_of_another_length_than_its_horizon():
    config = MPPIConfig(samples=64, horizon=T, dt=SYSTEM.dt)
    mppi = MPPI(SYSTEM, VARYING["p_x"](np.ones(T - 1)), Gaussian((1.0, 1.0)), config)
    with pytest.raises(ValueError, match=rf"p_x: expected .* each of {T} steps, got shape"):
        mppi.control(START)


SMALLEST = MPPIConfig(samples=64, horizon=T, dt=SYSTEM.dt)


def planner(cost):
    return MPPI(SYSTEM, cost, Gaussian((1.0, 1.0)), SMALLEST)


@pytest.mark.compiled
def test_a_planner_that_is_given_numbers_of_a_term_plans_as_with_that_term():
    high = np.linspace(0.5, 2.0, T)
    band = TERMS[2].but(weight=5.0, high=high)
    wanted = planner(replace(COST, terms=(*TERMS[:2], band))).control(START)

    given = planner(COST)
    given.set_numbers("band", weight=5.0, high=high)
    high[:] = 0.0  # the planner has a copy
    successor = planner(COST)
    successor.continue_from(given)
    for mppi in (given, successor):
        u, stats = mppi.control(START)
        np.testing.assert_array_equal(u, wanted[0])
        assert stats == wanted[1]
    assert COST.terms == TERMS
    assert TERMS[2].parameters.high == 1.5


@pytest.mark.compiled
def test_numbers_that_a_term_does_not_have_are_refused():
    mppi = planner(COST)
    for term, name in (("band", "hihg"), ("bnad", "high"), ("near", "x")):
        with pytest.raises(ValueError, match=f"cost moving: no number '{name}' of a term '{term}'"):
            mppi.set_numbers(term, **{name: 1.0})
    with pytest.raises(ValueError, match=r"term band: high: expected a finite number, .*got nan"):
        mppi.set_numbers("band", high=np.nan)


def test_a_term_with_other_numbers_keeps_all_else():
    band = TERMS[2]
    wider = band.but(high=2.0)
    heavier = band.but(weight=7.0)
    assert (wider.weight, wider.parameters._asdict()) == (3.0, {"low": 0.2, "high": 2.0})
    assert (heavier.weight, heavier.parameters) == (7.0, band.parameters)
    assert {wider.name, heavier.name} == {"band"}
    assert band.parameters._asdict() == {"low": 0.2, "high": 1.5}, "it is another term"
    assert band.but(weight=0.0).weight == 0.0
    with pytest.raises(ValueError, match=r"term band: no parameter 'hihg': did you mean 'high'\?"):
        band.but(hihg=2.0)


def test_a_parameter_that_a_term_does_not_read_is_refused():
    misspelt = Term(outside, weigth=50.0, low=0.2, high=1.5)
    problem = r"outside: .*'weigth', which it does not read: did you mean 'weight'\?"
    with pytest.raises(TraceError, match=problem):
        module_source(SYSTEM, replace(COST, terms=(misspelt,)), np.float32)


def test_terms_go_to_other_processes():
    cost = pickle.loads(pickle.dumps(VARYING["p_band_high"](np.ones(T))))
    assert cost.term_names == COST.term_names
    np.testing.assert_array_equal(cost.numbers(T), VARYING["p_band_high"](np.ones(T)).numbers(T))


def test_evaluate_takes_the_numbers_of_its_step():
    moving = replace(COST, params=along(1.0, 0.0, 2.0, -1.0))
    x, u = PointState(0.0, 0.0, 0.0, 0.0), PointControl(0.0, 0.0)
    for t in (0, 7, T - 1):
        frozen = replace(COST, params=Point(*(float(value[t]) for value in moving.params)))
        assert (
            evaluate(moving, x, x, u, (0.0, 0.0), t=t).terms
            == evaluate(frozen, x, x, u, (0.0, 0.0)).terms
        )


def fast(x, x_next, u, target, p):
    """Return a condition, which counts as 0 or 1."""
    return x_next.vx > 1.0


def always(x, x_next, u, target, p):
    """Return a plain number."""
    return 2.0


RADIUS = 0.6


def keep_off(x, x_next, u, target, p):
    """Return by how much the point is within a disc that may move [m]."""
    dx = x_next.px - p.x
    dy = x_next.py - p.y
    return maximum(RADIUS * RADIUS - (dx * dx + dy * dy), 0.0)


# All costs that are flown have these terms, so that their loops are compiled once.
FLOWN = replace(
    COST,
    terms=(
        *TERMS,
        Term(fast, 3.0),
        Term(always, 0.5),
        Term(speed, 0.2),
        Term(keep_off, 10.0, x=-0.5, y=0.6),
    ),
)


def steps(cost):
    """Return the cost with weights and parameters of which each depends on the step."""
    wave = np.sin(0.4 * np.arange(T))
    near_, push_, band, *others = cost.terms
    return replace(
        cost,
        params=along(1.0, 0.0, 2.0, -1.0),
        terms=(
            near_.but(weight=2.0 + wave),
            push_,
            band.but(weight=1.0 - 0.5 * wave, low=wave),
            *others,
        ),
    )


@pytest.mark.compiled
@pytest.mark.parametrize("of", [lambda cost: cost, steps], ids=["constant", "one for each step"])
def test_lanes_agree_with_the_oracle(of):
    cost = of(FLOWN)
    U, z = controls()
    oracle = fly_rows(SYSTEM, cost, START, U, z)
    np.testing.assert_allclose(fly_lanes(cost, U, z), oracle.J, rtol=2e-5)
    assert (oracle.terms != 0.0).any(axis=0).all()


@pytest.mark.compiled
def test_numbers_that_come_a_step_late_are_another_cost():
    cost = steps(FLOWN)
    late = replace(cost, params=Point(*(np.append(value[0], value[:-1]) for value in cost.params)))
    U, z = controls()
    oracle = fly_rows(SYSTEM, late, START, U, z)
    assert np.mean(abs(fly_lanes(cost, U, z) / oracle.J - 1) > 2e-4) > 0.9


def terms_of_each(rollout, x0, z):
    """Return the terms of samples as they are displayed.  (samples, n_terms)"""
    found = rollout.trajectories(x0, z, 0)
    samples = [terms_of(rollout, x0, z[m], 0, found.sample(m)) for m in range(len(z))]
    return np.array([list(terms.values()) for terms in samples])


@pytest.mark.compiled
def test_each_term_of_the_trajectories_agrees_with_the_oracle():
    """Terms that return a condition or a number are among them."""
    cost = steps(FLOWN)
    U, z = controls()
    oracle = fly_rows(SYSTEM, cost, START, 0 * U, z[:LANES])
    terms = terms_of_each(Rollout(SYSTEM, cost), START, z[:LANES])
    np.testing.assert_allclose(terms, oracle.terms, rtol=2e-5, atol=1e-6)


def test_other_numbers_compile_nothing_anew_and_another_term_does():
    module = compiled_module(SYSTEM, COST, np.float32)
    faster = double_integrator(SYSTEM.dt).params._replace(gain=1.3)
    same = (
        replace(COST, params=Point(7.0, 8.0)),
        replace(COST, terms=tuple(term.but(weight=4.0) for term in TERMS)),
        replace(COST, terms=(*TERMS[:2], TERMS[2].but(low=-1.0))),
        replace(COST, targets=np.ones((3, 2))),
        steps(COST),
    )
    assert {id(compiled_module(SYSTEM, cost, np.float32)) for cost in same} == {id(module)}
    assert compiled_module(replace(SYSTEM, params=faster, dt=0.01), COST, np.float32) is module
    for other in (
        replace(COST, terms=TERMS[:2]),
        replace(COST, terms=(*TERMS[:2], TERMS[2].but(weight=0.0))),
    ):
        assert compiled_module(SYSTEM, other, np.float32) is not module
    assert compiled_module(SYSTEM, COST, np.float64) is not module


def test_a_term_without_weight_leaves_no_line():
    weighted = module_source(SYSTEM, COST, np.float32)
    without = module_source(
        SYSTEM, replace(COST, terms=(*TERMS[:2], TERMS[2].but(weight=0.0))), np.float32
    )
    absent = module_source(SYSTEM, replace(COST, terms=TERMS[:2]), np.float32)
    assert "# term: band" in weighted
    assert "band" not in without
    assert without.replace("cost_numbers[k_t, 3]", "cost_numbers[k_t, 2]") != weighted

    def lines(source):
        return [line for line in source.splitlines() if "cost_numbers[" not in line]

    assert lines(without) == lines(absent), "but for the places of the numbers that are read"


def travelled(x_next):
    return x_next.vx * SYSTEM.dt


def squared(x, x_next, u, target, p):
    return x_next.px * x_next.px / 3.0


def of_a_helper(x, x_next, u, target, p):
    return travelled(x_next) * x_next.py


def of_a_variable(x, x_next, u, target, p):
    area = x_next.px * x_next.py
    return area


@pytest.mark.parametrize(
    ("term", "expected"),
    [
        (squared, "cost_of_squared = weight_squared * px * px / F(3.0)"),
        (of_a_helper, "cost_of_of_a_helper = weight_of_a_helper * (vx * F(0.05)) * py"),
        (of_a_variable, "cost_of_of_a_variable = weight_of_a_variable * area"),
    ],
)
def test_a_weight_is_the_first_factor_and_what_the_source_computes_apart_stays_whole(
    term, expected
):
    """So that a sum of terms is rounded as its formula is read: w (v dt) d, where v dt is a
    quantity of its own."""
    source = module_source(
        SYSTEM, Cost("one", (Term(term, 2.0),), Goal, np.zeros((1, 2))), np.float32
    )
    assert expected in [line.strip() for line in source.splitlines()]


def on_this_thread(loop, blocks, *arguments):
    """Run a loop here and now, see quadsim.controllers.lanes.sharing."""
    loop(0, 0, blocks, *arguments)


@pytest.fixture
def plain_python(monkeypatch):
    """Let the text of the loops run as Python, which compiles nothing."""

    def interpreted(system, cost, dtype):
        with monkeypatch.context() as patch:
            patch.setattr(numba, "njit", lambda *_, **options: lambda function: function)
            patch.setattr("quadsim.controllers.lanes.compiled.kept", lambda function: function)
            names = {}
            exec(module_source(system, cost, dtype), names)
        return SimpleNamespace(**names)

    monkeypatch.setattr("quadsim.controllers.lanes.lanes.compiled_module", interpreted)
    monkeypatch.setattr("quadsim.controllers.lanes.lanes.on_threads", on_this_thread)


LOOPS = ("rollout",)
FEW = 6  # steps of a flight in plain Python


def test_a_cost_whose_terms_have_no_weight_costs_nothing(plain_python):
    nothing = replace(COST, terms=tuple(term.but(weight=0.0) for term in TERMS))
    U, z = controls()
    assert (fly_lanes(nothing, U[:FEW], z[:, :, :FEW]) == 0.0).all()
    assert (fly_lanes(COST, U[:FEW], z[:, :, :FEW]) != 0.0).all()


def test_a_step_that_returns_no_state_is_a_line_that_names_it():
    def plain(x, u, p, dt):
        return x.px, x.py, x.vx, x.vy

    with pytest.raises(
        TraceError, match=r"plain: .*test_costs.py:\d+: expected it to return a PointState, got tup"
    ):
        module_source(replace(SYSTEM, step=plain), COST, np.float32)


def test_a_crash_that_returns_nothing_is_a_line_that_names_it():
    def crashes(x, x_next, u, target, p):
        x_next.px > 3.0  # noqa: B015

    with pytest.raises(
        TraceError, match=r"crashes: .*test_costs.py:\d+: expected it to return a number, got None"
    ):
        module_source(SYSTEM, replace(COST, crash=crashes), np.float32)


# Names: of the loops, and of the numbers that they read.


class Unlucky(NamedTuple):
    """Parameters named as arguments and variables of the loops."""

    cost: float
    system: float
    numbers: float
    t: float


def shared(x, x_next, u, target, p):
    return p.cost * x_next.px * x_next.px + p.system * x_next.py * x_next.py + p.numbers * p.t


def own(x, x_next, u, target, p):
    return p.factor * x_next.vx * x_next.vx + p.row


UNLUCKY = Cost(
    "unlucky",
    (
        Term(shared, 2.0),
        Term(own, 1.0, name="noise", factor=0.3, row=0.1),
        Term(own, 1.5, name="cost", factor=0.7, row=0.2),
        Term(own, 0.5, name="last", factor=0.9, row=0.3),
        Term(crash, 4.0),
    ),
    Goal,
    np.zeros((1, 2)),
    params=Unlucky(cost=0.5, system=0.25, numbers=0.1, t=2.0),
    crash=lambda x, x_next, u, target, p: x_next.px > -0.4,
)


def unlucky_step(x, u, p, dt):
    """Return the point's next state, by variables named as those of the loops."""
    state = x.vx * dt
    cost = x.vy * dt
    t = (u.ax - p.drag * x.vx) * dt
    low_ax = (u.ay - p.drag * x.vy) * dt
    model_drag = t + x.vx
    return type(x)(x.px + state, x.py + cost, model_drag, x.vy + low_ax)


UNLUCKY_MODEL = replace(POINT, step=unlucky_step)


def greedy_term(names):
    """Return a term that has a local variable of each of these names, of which each counts."""
    lines = ["def greedy(x, x_next, u, target, p):", "    found = x_next.px * 0.01"]
    before = "found"
    for k, name in enumerate(names):
        lines.append(f"    {name} = {before} * 0.9 + x_next.vx * {0.01 * (k % 7 + 1):g}")
        before = name
    scope = {}
    exec("\n".join([*lines, f"    return {before} + {names[0]}"]), scope)
    return scope["greedy"]


def bindings(source):
    """Return how often the loops give a value to each name that they use."""
    loops = [node for node in ast.parse(source).body if getattr(node, "name", "") in LOOPS]
    assert len(loops) == len(LOOPS)
    found = Counter()
    for node in (node for loop in loops for part in loop.body for node in ast.walk(part)):
        if isinstance(node, ast.Name):
            found[node.id] += isinstance(node.ctx, ast.Store)
    return found


def test_names_of_the_source_never_collide_with_those_of_the_loops(plain_python):
    """A term whose variables have every name that occurs in the generated text, beside parameters
    and a model that have some: they fly as they do on floats."""
    source = module_source(UNLUCKY_MODEL, UNLUCKY, np.float32)
    words = set(re.findall(r"[A-Za-z_]\w*", source)) - {
        *keyword.kwlist,
        "x",
        "x_next",
        "u",
        "target",
        "p",
        "found",
    }
    assert {
        "cost",
        "state",
        "t",
        "l",
        "select",
        "F",
        "L",
        "np",
        "range",
        "noise_factor",
        "last_row",
        "x_px",
    } < words
    assert {
        "p_cost",
        "p_t",
        "p_noise_factor",
        "weight_shared",
        "model_drag",
        "plan_ax",
        "low_ax",
    } < words
    cost = replace(UNLUCKY, terms=(*UNLUCKY.terms, Term(greedy_term(sorted(words)), 3.0)))
    # No name that the loops use is given a value more often.
    before, after = (bindings(module_source(UNLUCKY_MODEL, c, np.float32)) for c in (UNLUCKY, cost))
    assert {"l", "t", "state", "select", "p_cost"} < before.keys()
    assert {name: after[name] for name in before} == before
    assert len(after) >= len(before) + len(words)

    U, z = controls(spread=6.0)
    U, z = U[:FEW], z[:LANES, :, :FEW]
    x0 = np.array([-0.65, 0.5, 0.4, 0.2])  # A crash is a few steps ahead.
    oracle = fly_rows(POINT, cost, x0, U, z)
    np.testing.assert_allclose(fly_lanes(cost, U, z, UNLUCKY_MODEL, x0), oracle.J, rtol=5e-5)
    assert 0.1 < oracle.crashed.mean() < 0.9
    assert (oracle.terms != 0.0).any(axis=0).all()
    terms = terms_of_each(Rollout(UNLUCKY_MODEL, cost), x0, z)
    expected = fly_rows(POINT, cost, x0, 0 * U, z).terms
    np.testing.assert_allclose(terms, expected, rtol=5e-5, atol=1e-6)


# Moving targets: the parameters of each step are where something will be then.

LIMITED = replace(SYSTEM, low=(-2.0, -2.0), high=(2.0, 2.0))
CONFIG = MPPIConfig(samples=512, horizon=45, iterations=2, dt=SYSTEM.dt, temperature=0.02)


def going_to(place, disc, weight, effort):
    """Return the cost of the way to a place, clear of a disc; both may move.

    The other terms of FLOWN weigh next to nothing, or the same whatever is done.
    """
    weights = {
        "near": weight,
        "push": effort,
        "speed": 0.1 * weight,
        "keep_off": 1000.0,
        "always": 1.0,
    }
    terms = [term.but(weight=weights.get(term.name, 1e-9)) for term in FLOWN.terms]
    terms[-1] = terms[-1].but(**disc._asdict())
    return replace(FLOWN, terms=tuple(terms), params=place)


def pursued(predicts, seconds=5.0):
    """Return the distances to a point that moves at 1.5 m/s, which the planner sees ahead or takes
    to stand still."""
    far = Point(1e3, 0.0)
    mppi = MPPI(LIMITED, going_to(Point(0.0, 0.0), far, 5.0, 0.01), Gaussian((1.5, 1.5)), CONFIG, 1)
    x = PointState(-1.0, -1.0, 0.0, 0.0)
    apart = []
    for k in range(round(seconds / SYSTEM.dt)):
        here = along(0.0, 1.5 * k * SYSTEM.dt, 0.0, 1.5, CONFIG.horizon)
        if not predicts:
            here = Point(here.x[0], here.y[0])
        mppi.set_cost(replace(mppi.cost, params=here))
        u, _ = mppi.control(np.array(x))
        x = LIMITED.next(x, u)
        apart.append(np.hypot(x.px, x.py - 1.5 * (k + 1) * SYSTEM.dt))
    return np.array(apart)


@pytest.mark.compiled
def test_a_target_that_moves_is_met_where_it_will_be_and_trailed_where_it_was():
    ahead, behind = pursued(predicts=True)[-20:], pursued(predicts=False)[-20:]
    assert ahead.mean() < 0.1
    assert behind.mean() > 3 * ahead.mean()


def room_left(disc):
    """Return how far the plan keeps off a disc that crosses its way, where the planner takes it to
    be at `disc`."""
    cost = going_to(Point(1.5, 0.0), disc, 1.0, 0.001)
    mppi = MPPI(LIMITED, cost, Gaussian((1.5, 1.5)), CONFIG, seed=2)
    start = np.array([-1.5, 0.0, 1.5, 0.0])
    for _ in range(30):
        mppi.control(Estimate(0.0, start))
    x, apart = start, []
    for u, disc_x, disc_y in zip(mppi.plan, *CROSSING, strict=True):
        x = LIMITED.next(x, np.clip(u, LIMITED.low, LIMITED.high))
        apart.append(np.hypot(x.px - disc_x, x.py - disc_y))
    assert x.px > 0.0, "it flies on"
    return minimum.reduce(apart)


# The disc is in the middle of the way when the point would be there.
CROSSING = along(0.0, -2.4, 0.0, 3.0, CONFIG.horizon)


@pytest.mark.compiled
def test_a_plan_keeps_clear_of_a_disc_only_where_its_crossing_is_predicted():
    assert room_left(CROSSING) > RADIUS - 0.05
    assert room_left(Point(*(float(value[0]) for value in CROSSING))) < 0.5 * RADIUS
