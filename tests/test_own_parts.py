"""Objects of the user's own in every role: sampler, cost, plant, controller, referee."""

import importlib
import json
import os
import re
import subprocess
import sys
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest

import quadsim
from quadsim.campaign.run.variants import make_variants, parse_variants
from quadsim.cli.cli import race
from quadsim.cli.flags import settings_as_flags
from quadsim.config.build import planner_of
from quadsim.config.build_cost import cost_on
from quadsim.config.build_plant import start_of, system_of
from quadsim.config.own import OwnController, OwnPlant, OwnReferee, made
from quadsim.console import UsageError
from quadsim.controllers.costs import Term
from quadsim.controllers.lanes.planner_loops import module_source
from quadsim.controllers.plan import PlanStats
from quadsim.controllers.samplers import build_lanes
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.quadrotor import State, quadrotor
from quadsim.physics.plant import PlantState
from quadsim.racing.events import Event
from tests.small import SHORT, flags

FLIGHT = {**SHORT, "first_iterations": 10}
SPEC = quadsim.Spec.of("figure8", **FLIGHT)
HOVER = (0.0, 0.0, 0.0, 9.81)
SIGMA = (0.8, 0.8, 0.5, 4.0)


class Timed:
    """A referee that ends a flight as finished after `duration` seconds."""

    lap = 1
    next_gate = 0

    def __init__(self, duration):
        self.outcome = None
        self.passed = 0
        self.duration = duration

    def observe(self, t0, p0, t1, p1, contacts=()):
        if t1 < self.duration - 1e-9:
            return []
        self.outcome = "finished"
        self.passed = 1
        return [Event(t1, "pass", 1, 1, (0.0, 0.0), 0.0, p1)]


@dataclass(frozen=True)
class Held:
    """A sampler: each control keeps one random value for some steps."""

    sigma: tuple[float, ...] = SIGMA
    steps: int = 10

    def sample(self, rng, samples, horizon, controls):
        pieces = rng.standard_normal((samples, -(-horizon // self.steps), controls))
        return np.array(self.sigma) * pieces.repeat(self.steps, axis=1)[:, :horizon]


def dearer(cost):
    """The default cost, its weights doubled."""
    return replace(cost, terms=tuple(term.but(weight=2 * term.weight) for term in cost.terms))


class Free:
    """A plant: the planner's model without drag as the world."""

    def __init__(self, spec):
        self.dt = spec.plant_dt
        self.system = quadrotor(replace(spec.model, drag=0.0), self.dt)
        self.state = PlantState(0.0, start_of(spec), ())

    def step(self, u):
        x = self.system.next(self.state.x, u)
        self.state = PlantState(self.state.t + self.dt, x, ())
        return self.state

    def close(self):
        pass


class Hover:
    """A controller: one thrust, whatever the state."""

    def __init__(self, thrust):
        self.thrust, self.rest = thrust, np.array([0.0, 0.0, 0.0, thrust])

    def control(self, estimate):
        return self.rest, PlanStats(cost=0.0, ess=1.0, temperature=1.0)


class Climb:
    """A controller that is a plain law of the state."""

    def control(self, x):
        return [0.0, 0.0, 0.0, 9.81 + 4.0 * (2.0 - x[2]) - 3.0 * x[5]]


OWN = {  # role -> the part, what a run says of it
    "sampler": (Held(steps=5), "Held", {"sigma": list(SIGMA), "steps": 5}),
    "cost": (dearer, "dearer", {}),
    "plant": (Free, "Free", {}),
    "controller": (Hover(10.5), "Hover", {"thrust": 10.5, "rest": [0.0, 0.0, 0.0, 10.5]}),
    "referee": (
        Timed(0.1),
        "Timed",
        {"outcome": None, "passed": 0, "duration": 0.1},
    ),
}


@pytest.fixture(scope="module")
def default():
    return quadsim.fly(SPEC)


@pytest.mark.compiled
@pytest.mark.parametrize("role", OWN)
def test_a_part_of_ones_own_flies_is_recorded_and_kept(role, default, tmp_path):
    part, name, parameters = OWN[role]
    run = quadsim.fly("figure8", **FLIGHT, **{role: part})
    own = run.spec["own"]
    assert list(own) == [role]
    assert own[role]["class"].endswith(f".{name}")
    assert own[role]["parameters"] == parameters
    changed = [
        k
        for k, x in run.telemetry.items()
        if k != "plan_ms" and not np.array_equal(x, default.telemetry[k])
    ]
    assert changed, "the part made a difference"
    folder = quadsim.save_run(run, tmp_path)
    assert quadsim.load_run(folder).digest() == run.digest()
    assert json.loads((folder / "run.json").read_text())["repeatable_from_spec"] is False


class FreeByName(Free):
    """The same plant, whose states are records."""

    def step(self, u):
        after = super().step(u)
        self.state = PlantState(after.t, State(*after.x), ())
        return self.state


@pytest.mark.slow
@pytest.mark.parametrize("sensing", ["perfect", "vio"])
def test_a_plant_of_ones_own_may_give_its_states_as_plain_tuples(sensing):
    """Sensors and records read states by name, whichever of both a plant gives."""
    plain, named = (
        quadsim.fly("figure8", **FLIGHT, sensing=sensing, plant=plant, controller=Climb())
        for plant in (Free, FreeByName)
    )
    assert len(plain.telemetry["t"]) > 20
    for column in plain.telemetry.keys() - {"plan_ms", "estimate_ms"}:
        np.testing.assert_array_equal(
            plain.telemetry[column], named.telemetry[column], err_msg=column
        )


def one_line(role, act, *arguments):
    """Return the text of the one line with which a part of one's own is refused."""
    with pytest.raises(quadsim.SettingError) as error:
        act(*arguments)
    assert error.value.name == role
    assert "\n" not in str(error.value)
    return str(error.value)


def refused(role, **parts):
    """Return the text of the one line with which a flight refuses a part of one's own."""
    return one_line(role, lambda: quadsim.fly("figure8", **FLIGHT | parts))


NAN = float("nan")


def with_state(broken):
    """Return a plant whose states after each step are broken."""

    class Mine(Free):
        def step(self, u):
            return broken(super().step(u))

    return Mine(SPEC)


BROKEN_STATES = {
    "backwards": (lambda s: replace(s, t=-s.t), "a state 0.0025 s after t = 0, got t = -0.0025"),
    "still": (lambda s: replace(s, t=0.0), "a state 0.0025 s after t = 0, got t = 0.0"),
    "slow": (lambda s: replace(s, t=1e-9 * s.t), "a state 0.0025 s after t = 0, got t = 2.5"),
    "no time": (lambda s: replace(s, t=NAN), "a finite time t [s], got nan"),
    "not finite": (lambda s: replace(s, x=(NAN,) * 17), "17 finite numbers, got px = nan"),
    "too short": (lambda s: replace(s, x=s.x[:3]), "a state of 17 finite numbers, got 3"),
    "no numbers": (lambda s: replace(s, x="x" * 17), "a state of 17 finite numbers, got px = 'x'"),
    "no state": (lambda s: None, "a quadsim.physics.plant.PlantState, got None"),
    "contacts": (lambda s: replace(s, contacts=None), "contacts of texts, got None"),
}


@pytest.mark.parametrize("fault", BROKEN_STATES)
def test_a_plant_with_a_broken_state_is_named(fault):
    broken, problem = BROKEN_STATES[fault]
    text = one_line("plant", OwnPlant(with_state(broken)).step, HOVER)
    assert text.startswith("plant: Mine.step: expected ")
    assert problem in text


IN_FLIGHT = {  # what -> the part of a flight that breaks, the text of its error
    "a plant whose time does not go on": (
        {"plant": lambda spec: with_state(lambda s: replace(s, t=0.0))},
        "plant: Mine.step: expected a state 0.0025 s after t = 0, got t = 0.0",
    ),
    **{
        f"a plant that touches {what}": (
            {"plant": lambda spec, what=what: with_state(lambda s: replace(s, contacts=(what,)))},
            f"got '{what}'",
        )
        for what in ("gate 99", "gate x", "obstacle 1")  # which the course does not have
    },
    "a law": (
        {"controller": lambda spec: Law(np.zeros(3))},
        "controller: Law.control: expected a control of 4 numbers",
    ),
    "a controller": (
        {"controller": lambda spec: Answers((np.zeros(3), STATS))},
        "controller: Answers.control: expected a control of 4 numbers",
    ),
    "a control at rest": (
        {"controller": lambda spec: Answers(None, rest=np.zeros(3))},
        "controller: Answers.rest: expected a control of 4 numbers",
    ),
    "events": (
        {"referee": lambda spec: observing(lambda *step: None)},
        "referee: Timed.observe: expected a list of events, got None",
    ),
    "an outcome": (
        {"referee": lambda spec: observing(lambda *step: [], outcome="won")},
        "referee: Timed.outcome: expected None or one of finished",
    ),
}


@pytest.mark.parametrize("what", IN_FLIGHT)
def test_a_flight_checks_what_its_parts_return(what):
    part, problem = IN_FLIGHT[what]
    assert problem in refused(*part, **{"controller": Hover(10.5)} | part)


def test_a_plants_step_has_a_range():
    plant = Free(SPEC)
    for dt in (0, -1, NAN, None, "x", 1e-9, 10, True, 10**400):
        plant.dt = dt
        text = one_line("plant", OwnPlant, plant)
        assert "plant: Free.dt: expected a number [s] >= 1e-06 and <= 1" in text, dt


@pytest.mark.parametrize("member", ["dt", "state", "step", "close"])
def test_a_plant_without_a_member_is_refused(member):
    class Mine:
        def __init__(self):
            members = {"dt": 0.0025, "state": Free(SPEC).state, "step": print, "close": print}
            vars(self).update({name: x for name, x in members.items() if name != member})

    assert f"plant: Mine: expected a member '{member}'" in one_line("plant", OwnPlant, Mine())


class Law:
    """A plain law, which answers the same to any state."""

    def __init__(self, answer):
        self.answer = answer

    def control(self, x):
        return self.answer


class Answers(Law):
    """A controller that answers the same to any estimate."""

    def __init__(self, answer, rest=HOVER):
        super().__init__(answer)
        self.rest = rest


STATS = PlanStats(cost=0.0, ess=1.0, temperature=1.0)
AT_START = Estimate(0.0, np.zeros(17))
NO_CONTROLS = (None, np.zeros(3), np.zeros(5), np.zeros((4, 1)), "abcd", [NAN] * 4, [[1, 2], [3]])
NO_CONTROLS = (*NO_CONTROLS, np.ones(4) * 1j, [True] * 4, 3, {}, np.full(4, 1e300))


def test_a_controller_that_returns_no_control_is_named():
    for answer in NO_CONTROLS:
        for inner in (Law(answer), Answers((answer, STATS))):
            text = one_line("controller", OwnController(inner, HOVER).control, AT_START)
            name = type(inner).__name__
            assert f"controller: {name}.control: expected a control of 4 numbers" in text, answer
        text = one_line("controller", OwnController, Answers(None, rest=answer), HOVER)
        assert "controller: Answers.rest: expected a control of 4 numbers" in text, answer


def test_a_controller_returns_its_statistics():
    for stats in (None, 3, PlanStats(None, None, None)):
        controller = OwnController(Answers((np.array(HOVER), stats)), HOVER)
        text = one_line("controller", controller.control, AT_START)
        assert "controller: Answers.control: expected a control and its PlanStats" in text, stats


def test_a_state_that_is_taken_for_an_estimate_is_explained():
    class Mine:
        def control(self, estimate):
            return estimate.x

    with pytest.raises(AttributeError) as caught:
        OwnController(Mine(), HOVER).control(AT_START)
    (note,) = caught.value.__notes__
    assert "is given the state x" in note


def observing(observe, **after):
    """Return a referee with this answer to a step, and with these attributes after it."""
    referee = Timed(0.1)

    def answer(*step):
        vars(referee).update(after)
        return observe(*step)

    referee.observe = answer
    return referee


OBSERVED = (0.0, (0.0, 0.0, 0.0), 0.0025, (0.0, 0.0, 0.0))


def test_a_referee_returns_a_list_of_events():
    for answer in (None, (), [1], 3, Event(0, "pass", 1, 1, (0, 0), 0, (0, 0, 0))):
        referee = OwnReferee(observing(lambda *step, answer=answer: answer))
        text = one_line("referee", referee.observe, *OBSERVED)
        assert "referee: Timed.observe: expected a list of events, got" in text, answer


@pytest.mark.parametrize(
    ("name", "values", "problem"),
    [
        ("outcome", ("won", "", 3, True, np.zeros(2)), "expected None or one of finished"),
        ("passed", (None, -1, 1.5, "1"), "expected a whole number"),
        ("lap", (None, -1, 1.5, "1"), "expected a whole number"),
        ("next_gate", (None, -1, 1.5, "1"), "expected a whole number"),
    ],
)
def test_a_referee_has_a_known_outcome_and_counts_gates_and_laps(name, values, problem):
    for value in values:
        referee = Timed(0.1)
        setattr(referee, name, value)
        assert f"Timed.{name}: {problem}" in one_line("referee", OwnReferee, referee), value
        later = OwnReferee(observing(lambda *step: [], **{name: value}))
        assert f"Timed.{name}: {problem}" in one_line("referee", later.observe, *OBSERVED), value


NO_SAMPLES = {
    "None": lambda shape: None,
    "another shape": lambda shape: np.zeros(3),
    "other axes": lambda shape: np.zeros(shape[::-1]),
    "not finite": lambda shape: np.full(shape, NAN),
    "text": lambda shape: np.full(shape, "1"),
    "complex": lambda shape: np.zeros(shape, complex),
    "objects": lambda shape: np.zeros(shape, object),
    "ragged": lambda shape: [[1], [1, 2]],
}


@pytest.mark.parametrize("fault", NO_SAMPLES)
@pytest.mark.filterwarnings("error")
def test_a_sampler_that_returns_no_samples_is_named(fault, key):
    class Mine:
        def sample(self, rng, samples, horizon, controls):
            return NO_SAMPLES[fault]((samples, horizon, controls))

    text = one_line("sampler", build_lanes(Mine(), 4, 128, (1,) * 40, key, 0.01).sample, 1)
    assert "sampler: Mine.sample: expected finite numbers of shape (128, 40, 4)" in text


def test_a_referee_that_never_ends_a_flight_has_the_time_limit_of_the_flight():
    referee = Timed(1e9)
    run = quadsim.fly("figure8", **FLIGHT, controller=Hover(10.5), referee=referee)
    assert run.outcome == "timeout"
    assert run.telemetry["t"][-1] == pytest.approx(FLIGHT["timeout"])


class Maker:
    """Makes parts by a call or by a method."""

    def __init__(self, make):
        self.make = make

    def __call__(self, spec):
        return self.make(spec)

    def bound(self, spec):
        return self.make(spec)


@pytest.mark.parametrize("role", ["plant", "controller", "referee"])
def test_whatever_can_be_called_and_is_no_part_makes_one(role):
    kind = {"plant": Free, "controller": Hover, "referee": Timed}[role]
    make = kind if role == "plant" else lambda spec: kind(10.5)
    for part in (make, partial(make), Maker(make), Maker(make).bound):
        found = made(role, getattr(quadsim.Spec.of("figure8", **{role: part}), role), SPEC)
        assert isinstance(found, kind), part


@pytest.mark.parametrize("role", ["plant", "controller", "referee"])
def test_a_maker_that_makes_no_part_is_refused(role):
    for found in (None, 3, Hover, np):
        text = one_line(role, made, role, lambda spec, found=found: found, SPEC)
        assert f"{role}: expected " in text, found
        assert "to return an object with" in text, found


def beside(role):
    """Return the other parts of a flight without a planner, which would be compiled."""
    return {"controller": Hover(10.5)} if role in ("plant", "referee") else {}


@pytest.mark.parametrize("role", ["plant", "controller", "referee", "cost"])
def test_a_maker_takes_one_argument(role):
    for function in (lambda spec, more: None, len):
        text = refused(role, **beside(role), **{role: function})
        assert f"{role}: expected a function of the " in text


class Tuned(Climb):
    """A controller whose class has numbers with defaults, which a Spec is none of."""

    def __init__(self, gain=4.0):
        self.gain = gain


def test_a_maker_without_a_parameter_for_the_spec_is_called_without_it():
    assert made("controller", Tuned, SPEC).gain == 4.0
    assert isinstance(made("controller", lambda: Climb(), SPEC), Climb)
    for maker in (Tuned, partial(Tuned, 5.0), partial(Tuned, gain=5.0)):
        assert isinstance(made("controller", maker, SPEC).gain, float)
    for maker in (lambda spec: Tuned(spec), lambda spec=None: Tuned(spec), lambda *a: Tuned(*a)):
        assert made("controller", maker, SPEC).gain is SPEC


@pytest.mark.parametrize("role", ["plant", "controller", "referee", "cost"])
def test_an_error_in_ones_own_lines_is_that_error(role):
    def fails(argument):
        raise TypeError("mine")

    with pytest.raises(TypeError, match="mine") as error:
        quadsim.fly("figure8", **FLIGHT, **beside(role), **{role: fails})
    assert type(error.value) is TypeError


def test_a_sampler_is_an_object():
    for part in (Held, lambda *arguments: 0, partial(Held), 3, np):
        text = one_line("sampler", lambda part=part: quadsim.Spec.of("figure8", sampler=part))
        assert "sampler: expected a sampler: an object with sample(" in text


def calm(x, x_next, u, gate, p):
    return u.wx * u.wx


BROKEN_COSTS = {
    "None": (lambda cost: None, "to return a Cost, got None: is a return missing?"),
    "a number": (lambda cost: 3, "to return a Cost, got 3"),
    "terms alone": (lambda cost: cost.terms, "to return a Cost, got (Term("),
    "reached and crash after the terms": (
        lambda cost: replace(cost, terms=(*cost.terms, cost.reached, cost.crash)),
        "terms: expected a tuple of Term objects, got quadsim.controllers.costs.race.reached",
    ),
    "a function": (
        lambda cost: replace(cost, terms=(*cost.terms, calm)),
        "got test_own_parts.calm",
    ),
    "a list": (lambda cost: replace(cost, terms=list(cost.terms)), "terms: expected a tuple"),
    "no terms": (lambda cost: replace(cost, terms=()), "a term of quadsim.controllers.costs.crash"),
    "terms twice": (lambda cost: replace(cost, terms=cost.terms * 2), "got two named 'progress'"),
    "reached": (lambda cost: replace(cost, reached=3), "reached: expected a function or None"),
    "targets": (lambda cost: replace(cost, targets=cost.targets[:, :3]), "targets: expected an"),
    "no targets": (lambda cost: replace(cost, targets=cost.targets[:0]), "at least one row"),
    "not finite": (lambda cost: replace(cost, targets=NAN * cost.targets), "finite targets"),
    "params": (lambda cost: replace(cost, params=()), "params: expected a NamedTuple"),
    "row": (lambda cost: replace(cost, row=tuple), "row: expected a NamedTuple"),
    "obstacles": (lambda cost: replace(cost, obstacles=3), "obstacles: expected Obstacles or None"),
    "guide": (lambda cost: replace(cost, guide=lambda *a: None), "guide: expected finite controls"),
    "row_ahead": (
        lambda cost: replace(cost, row_ahead=lambda *a: 10**9),
        "row_ahead: expected the",
    ),
    "a weight": (
        lambda cost: replace(cost, terms=(*cost.terms, Term(calm, np.ones(7)))),
        "weight_calm: expected one number or one for each of 35 steps, got shape (7,)",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("fault", BROKEN_COSTS)
def test_a_cost_function_that_returns_no_whole_cost_is_refused(fault):
    change, problem = BROKEN_COSTS[fault]
    assert problem in refused("cost", cost=change)


NO_TERMS = [
    {"a": 1},
    calm,
    [calm],
    [None],
    [(calm, NAN)],
    [(calm, "1")],
    [(calm, True)],
    [(calm, 1.0, 2.0)],
    [(calm, np.ones(7))],
    [(calm, np.ones((40, 2)))],
    [(calm, 1.0), (calm, 2.0)],
    [(Hover, 1.0)],
    [(max, 1.0)],
    [(lambda x, x_next, u, gate, p: None, 1.0)],
    [(lambda x, x_next, u, gate, p: NAN, 1.0)],
    [(lambda x, u: 1.0, 1.0)],
]


@pytest.mark.slow
def test_terms_that_are_none_are_refused():
    for terms in NO_TERMS:
        assert refused("terms", terms=terms), terms


def test_a_term_of_ones_own_follows_those_of_the_planners_cost():
    spec = quadsim.Spec.of("figure8", **FLIGHT, overshoot=0.0, terms=[(calm, 0.5)])
    *race, own = planner_of(spec).cost.terms
    assert [term.name for term in race] == [term.name for term in cost_on(SPEC, SPEC.course).terms]
    assert (own.function, own.weight) == (calm, 0.5)


class Weighted:
    """A term that is an object with a number, compared by its number and without a hash."""

    def __init__(self, factor):
        self.factor = factor

    def __call__(self, x, x_next, u, gate, p):
        return self.factor * calm(x, x_next, u, gate, p)

    def __eq__(self, other):
        return isinstance(other, Weighted) and self.factor == other.factor

    __hash__ = None

    def method(self, *scalars):
        return self(*scalars)


def scaled(x, x_next, u, gate, p, factor):
    return factor * calm(x, x_next, u, gate, p)


CALLABLES = {
    "scaled": (partial(scaled, factor=2.0), partial(scaled, factor=3.0)),
    "Weighted": (Weighted(2.0), Weighted(3.0)),
    "method": (Weighted(2.0).method, Weighted(3.0).method),
    "lambda": tuple(
        (lambda *scalars, factor=factor: scaled(*scalars, factor)) for factor in (2.0, 3.0)
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CALLABLES)
def test_whatever_can_be_called_is_a_term_and_its_numbers_count(name):
    specs = [quadsim.Spec.of("figure8", terms=[(term, 1.0)]) for term in CALLABLES[name]]
    costs = [cost_on(spec, spec.course) for spec in specs]
    texts = [module_source(system_of(specs[0]), cost, np.float32) for cost in costs]
    assert texts[0] != texts[1]
    one, other = (spec.record()["own"]["terms"][0] for spec in specs)
    assert one["name"] == name
    assert one["sha256"] != other["sha256"]
    assert one["function"].startswith(f"{__name__}.")


@pytest.mark.compiled
def test_a_deadline_is_refused_beside_a_controller_that_cannot_keep_it():
    text = refused("deadline_ms", controller=Hover(10.5), deadline_ms=5.0)
    assert "expected none for Hover, as only MPPI keeps it by its samples, got 5" in text
    run = quadsim.fly("figure8", **FLIGHT, controller=planner_of, deadline_ms=50.0)
    assert run.outcome == "timeout"


def test_ones_own_controller_and_referee_have_the_say():
    run = quadsim.fly("figure8", **FLIGHT, controller=Hover(10.5), referee=lambda spec: Timed(0.1))
    assert (run.telemetry["a_cmd"] == 10.5).all()
    assert run.telemetry["t"][-1] == pytest.approx(0.1)
    assert run.outcome == "finished"


@pytest.mark.process
def test_a_sampler_of_ones_own_on_the_command_line_lies_in_the_current_folder(tmp_path):
    """One that breaks in its flight ends the command in one line; it was a traceback."""
    (tmp_path / "mine.py").write_text(
        "class Broken:\n    def sample(self, rng, samples, horizon, controls):\n"
        "        return None\n"
    )
    # -P: Python itself does not look for modules in the current folder, as for an installed `race`
    code = "from quadsim.cli.cli import main; main()"
    words = ["fly", "figure8", *flags(FLIGHT), "--sampler", "mine:Broken"]
    root = os.path.dirname(os.path.dirname(quadsim.__file__))
    done = subprocess.run(
        [sys.executable, "-P", "-c", code, *words],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": root},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2, done.stderr
    assert "sampler: Broken.sample: expected finite numbers of shape (128, 40, 4)" in done.stderr
    assert "got None" in done.stderr
    assert done.stderr.count("\n") == 1


def test_the_library_looks_for_a_sampler_where_python_does(tmp_path, monkeypatch):
    (tmp_path / "elsewhere.py").write_text("class Still:\n    def sample(self, *shape): ...\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [place for place in sys.path if place not in ("", ".")])
    with pytest.raises(
        quadsim.SettingError,
        match=r"sampler: expected package.module:Class .* got 'elsewhere:Still'",
    ):
        quadsim.Spec.of("figure8", sampler="elsewhere:Still")
    monkeypatch.syspath_prepend(tmp_path)
    assert quadsim.Spec.of("figure8", sampler="elsewhere:Still").sampler == "Still"


def test_samplers_of_ones_own_are_variants_of_the_command_line(tmp_path, monkeypatch):
    """A class is made without arguments; an object of the module may have any."""
    (tmp_path / "own_samplers.py").write_text(
        "from tests.test_own_parts import Held\n\nslow = Held(steps=20)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    text = "colored,held=race+sampler=own_samplers:Held,slow=race+sampler=own_samplers:slow"
    colored, held, slow = make_variants(["figure8"], parse_variants(text), FLIGHT)
    assert [variant.name for variant in (colored, held, slow)] == ["colored", "held", "slow"]
    assert [variant.spec.planner.sampling.steps for variant in (held, slow)] == [10, 20]


@pytest.mark.compiled
def test_compare_with_a_sampler_of_ones_own_gives_pairs_tables_and_a_picture(tmp_path):
    variants = {"gaussian": {}, "held": {"sampler": Held()}}
    comparison = quadsim.compare("figure8", variants, attempts=2, **FLIGHT)
    (pair,) = comparison.pairs
    assert ({pair.a, pair.b}, pair.seeds) == ({"gaussian", "held"}, 2)
    assert [(v.name, v.attempts) for v in comparison.variants] == [("gaussian", 2), ("held", 2)]
    assert "held - gaussian" in str(comparison)
    figure = comparison.plot(tmp_path / "both.png")
    assert (tmp_path / "both.png").read_bytes().startswith(b"\x89PNG")
    labels = [
        text.get_text() for text in figure.findobj(lambda artist: hasattr(artist, "get_text"))
    ]
    assert {"gaussian", "held"} <= set(labels)


def test_a_part_with_numbers_that_json_does_not_know_is_recorded():
    class Bounded(Hover):
        def __init__(self):
            super().__init__(10.5)
            self.bounds = np.array([-np.inf, np.nan])
            self.most = float("inf")

    run = quadsim.fly("figure8", **FLIGHT, controller=Bounded())
    parameters = run.spec["own"]["controller"]["parameters"]
    assert parameters["bounds"] == ["-inf", "nan"]
    assert parameters["most"] == "inf"


FAULTS_OF_USERS = {
    "raises": ("1 / 0", "ZeroDivisionError: division by zero (own_that_fails.py, line 5)"),
    "raises ValueError": ("int('x')", "ValueError: invalid literal for int() with base 10: 'x' "),
    "raises KeyError": ("{}['a']", "KeyError: 'a' (own_that_fails.py, line 5)"),
    "an error of two lines": ("raise OverflowError('a\\nb')", "OverflowError: a b (own_that"),
}


@pytest.mark.compiled
@pytest.mark.parametrize("what", FAULTS_OF_USERS)
def test_what_ones_own_code_raises_is_one_line_with_its_place(what, tmp_path, monkeypatch, capsys):
    line, text = FAULTS_OF_USERS[what]
    (tmp_path / "own_that_fails.py").write_text(
        "class Fails:\n    calls = 0\n    def sample(self, rng, samples, horizon, controls):\n"
        "        self.calls += 1\n"
        f"        if self.calls == 2: {line}\n"
        "        return rng.standard_normal((samples, horizon, controls))\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "own_that_fails", raising=False)
    settings = flags({**SHORT, "sampler": "own_that_fails:Fails", "runs_dir": str(tmp_path)})
    assert race(["fly", "figure8", *settings]) == 2
    (said,) = (row for row in capsys.readouterr().err.splitlines() if "race fly" in row)
    assert said.startswith(f"race fly: {text}")


@pytest.mark.parametrize("kind", [ValueError, FloatingPointError])
def test_a_term_that_makes_every_cost_nan_is_one_line(kind):
    """As MPPI raises it, without a compiled loop."""
    with pytest.raises(UsageError) as error, settings_as_flags():
        raise kind("MPPI: cost: expected a finite J,\ngot NaN")
    place = r"\(test_own_parts\.py, line \d+\)"
    text = rf"{kind.__name__}: MPPI: cost: expected a finite J, got NaN {place}"
    assert re.fullmatch(text, str(error.value))


COUNTING = """
class Counting:
    plans = 0
    def __init__(self): self.plans = 0
    def sample(self, rng, samples, horizon, controls):
        self.plans += 1
        return 0.1 * self.plans * rng.standard_normal((samples, horizon, controls))
"""


@pytest.fixture
def counting(tmp_path, monkeypatch):
    """Return the class of a sampler whose noise grows with each plan, in a module of its own."""
    (tmp_path / "own_counting.py").write_text(COUNTING)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "own_counting", raising=False)
    return importlib.import_module("own_counting").Counting


@pytest.mark.compiled
def test_a_sampler_that_changes_in_flight_is_recorded_as_it_was_before(counting, tmp_path, capsys):
    runs_dir = str(tmp_path / "runs")
    own = {"sampler": "own_counting:Counting", "runs_dir": runs_dir}
    assert race(["fly", "figure8", *flags({**SHORT, **own})]) == 1
    stored = quadsim.load_run("last", runs_dir)
    assert stored.spec["own"]["sampler"]["parameters"] == {"plans": 0}
    assert race(["fly", "--from", "last", *flags(own)]) == 1
    assert "the same flight as the stored run, to the last bit" in capsys.readouterr().err
    again = quadsim.fly("figure8", **SHORT, sampler=counting())
    assert again.digest() == stored.digest()


@pytest.mark.compiled
def test_a_race_records_a_sampler_that_changes_as_it_was_before(counting, tmp_path):
    heat = quadsim.race(
        {"mine": {"sampler": counting()}, "other": {}}, "figure8", **SHORT, expect="nothing"
    )
    stored = quadsim.load_heat(heat.save(tmp_path))
    assert stored["mine"].spec["own"]["sampler"]["parameters"] == {"plans": 0}
    again = quadsim.race(stored.spec, parts={"mine": {"sampler": counting()}})
    assert again.digest() == heat.digest()


def test_a_maker_may_make_a_maker():
    """A function that returns a PolicyController is a controller, as a PolicyController is."""
    policy = quadsim.PolicyController(lambda observation: np.zeros(4))
    found = made("controller", lambda spec: policy, SPEC)
    assert type(found) is type(made("controller", policy, SPEC))


def test_an_error_of_a_maker_says_what_it_was_called_for():
    with pytest.raises(TypeError) as caught:
        made("controller", lambda x: x[2], SPEC)
    (note,) = caught.value.__notes__
    assert "was called with a Spec" in note
    assert "quadsim.PolicyController(policy)" in note
