"""Objects of the user's own in every role: sampler, cost, plant, controller, referee."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest

import quadsim
from controllers.costs import Term
from controllers.lanes.planner_loops import module_source
from controllers.plan import PlanStats
from quadsim.cli.cli import race
from quadsim.dynamics.quadrotor import State, quadrotor
from quadsim.physics.plant import PlantState
from quadsim.racing.events import Event
from quadsim.spec.build import cost_on, planner_of, start_of, system_of

SMALL = {"samples": 256, "horizon": 50, "iterations": 1, "laps": 1, "timeout": 0.3}
FLAGS = [word for name, number in SMALL.items() for word in (f"--{name}", str(number))]
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
    return quadsim.fly("figure8", **SMALL)


@pytest.mark.parametrize("role", OWN)
def test_a_part_of_ones_own_flies_is_recorded_and_kept(role, default, tmp_path):
    part, name, parameters = OWN[role]
    run = quadsim.fly("figure8", **SMALL, **{role: part})
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


class Short(Free):
    """A plant that forgets what its rotors deliver."""

    def step(self, u):
        after = super().step(u)
        return PlantState(after.t, tuple(after.x)[:13], ())


@pytest.mark.parametrize("sensing", ["perfect", "vio"])
def test_a_plant_of_ones_own_may_give_its_states_as_plain_tuples(sensing):
    """Sensors and records read states by name, whichever of both a plant gives."""
    plain, named = (
        quadsim.fly("figure8", **SMALL, sensing=sensing, plant=plant)
        for plant in (Free, FreeByName)
    )
    assert len(plain.telemetry["t"]) > 20
    for column in plain.telemetry.keys() - {"plan_ms", "estimate_ms"}:
        np.testing.assert_array_equal(
            plain.telemetry[column], named.telemetry[column], err_msg=column
        )


def test_a_plant_whose_state_has_too_few_numbers_ends_in_one_line():
    with pytest.raises(ValueError, match=r"plant: Short\.step: .* 17 finite numbers, got 13"):
        quadsim.fly("figure8", **SMALL, plant=Short)


def refused(role, **parts):
    """Return the text of the one line with which a flight refuses a part of one's own."""
    with pytest.raises(quadsim.SettingError) as error:
        quadsim.fly("figure8", **SMALL | parts)
    assert error.value.name == role
    assert "\n" not in str(error.value)
    return str(error.value)


NAN = float("nan")
BROKEN_STATES = {
    "backwards": (lambda s: replace(s, t=-s.t), "a state 0.0025 s after t = 0, got t = -0.0025"),
    "still": (lambda s: replace(s, t=0.0), "a state 0.0025 s after t = 0, got t = 0.0"),
    "slow": (lambda s: replace(s, t=1e-9 * s.t), "a state 0.0025 s after t = 0, got t = 2.5"),
    "no time": (lambda s: replace(s, t=NAN), "a finite time t [s], got nan"),
    "not finite": (
        lambda s: replace(s, x=(NAN,) * 17),
        "a state of 17 finite numbers, got px = nan",
    ),
    "too short": (lambda s: replace(s, x=s.x[:3]), "a state of 17 finite numbers, got 3"),
    "no numbers": (lambda s: replace(s, x="x" * 17), "a state of 17 finite numbers, got px = 'x'"),
    "no state": (lambda s: None, "a quadsim.physics.plant.PlantState, got None"),
    "contacts": (lambda s: replace(s, contacts=None), "contacts of texts, got None"),
}


@pytest.mark.parametrize("fault", BROKEN_STATES)
def test_a_plant_with_a_broken_state_is_named_and_no_flight_hangs(fault):
    """A plant whose time did not go on kept a flight going for ever."""
    broken, problem = BROKEN_STATES[fault]

    class Mine(Free):
        def step(self, u):
            self.state = broken(super().step(u))
            return self.state

    assert f"plant: Mine.step: expected {problem}" in refused("plant", plant=Mine)


@pytest.mark.parametrize("contact", ["gate 99", "gate x", "obstacle 1"])
def test_a_plant_touches_only_what_the_course_has(contact):
    class Mine(Free):
        def step(self, u):
            return replace(super().step(u), contacts=(contact,))

    assert f"got '{contact}'" in refused("plant", plant=Mine)


@pytest.mark.parametrize("dt", [0, -1, NAN, None, "x", 1e-9, 10, True, 10**400])
def test_a_plants_step_has_a_range(dt):
    class Mine(Free):
        def __init__(self, spec):
            super().__init__(spec)
            self.dt = dt

    assert "plant: Mine.dt: expected a number [s] >= 1e-06 and <= 1" in refused("plant", plant=Mine)


@pytest.mark.parametrize("member", ["dt", "state", "close"])
def test_a_plant_without_a_member_is_refused(member):
    class Mine:
        step = Free.step

        def __init__(self, spec):
            Free.__init__(self, spec)
            members = {"dt": self.dt, "state": self.state, "close": print}
            vars(self).clear()
            vars(self).update({name: x for name, x in members.items() if name != member})

    assert f"plant: Mine: expected a member '{member}'" in refused("plant", plant=Mine)


NO_CONTROLS = (None, np.zeros(3), np.zeros(5), np.zeros((4, 1)), "abcd", [NAN] * 4, [[1, 2], [3]])
NO_CONTROLS = (*NO_CONTROLS, np.ones(4) * 1j, [True] * 4, 3, {}, np.full(4, 1e300))


@pytest.mark.parametrize("answer", NO_CONTROLS, ids=str)
def test_a_controller_that_returns_no_control_is_named(answer):
    class Law:
        def control(self, x):
            return answer

    class Mine(Hover):
        def control(self, estimate):
            return answer, PlanStats(cost=0.0, ess=1.0, temperature=1.0)

    for controller in (Law(), Mine(10.0)):
        name = type(controller).__name__
        problem = f"controller: {name}.control: expected a control of 4 numbers"
        assert problem in refused("controller", controller=controller)


@pytest.mark.parametrize("stats", [None, 3, PlanStats(None, None, None)], ids=str)
def test_a_controller_returns_its_statistics(stats):
    class Mine(Hover):
        def control(self, estimate):
            return self.rest, stats

    text = refused("controller", controller=Mine(10.0))
    assert "controller: Mine.control: expected a control and its PlanStats" in text


@pytest.mark.parametrize("rest", [None, np.zeros(3), np.full(4, NAN), "abcd", 3], ids=str)
def test_a_controllers_rest_is_a_control(rest):
    controller = Hover(10.0)
    controller.rest = rest
    text = refused("controller", controller=controller)
    assert "controller: Hover.rest: expected a control of 4 numbers" in text


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
def test_a_sampler_that_returns_no_samples_is_named(fault):
    class Mine:
        def sample(self, rng, samples, horizon, controls):
            return NO_SAMPLES[fault]((samples, horizon, controls))

    text = refused("sampler", sampler=Mine())
    assert "sampler: Mine.sample: expected finite numbers of shape (256, 50, 4)" in text


@pytest.mark.parametrize("answer", [None, (), [1], 3, Event(0, "pass", 1, 1, (0, 0), 0, (0, 0, 0))])
def test_a_referee_returns_a_list_of_events(answer):
    class Mine(Timed):
        def observe(self, *arguments):
            return answer

    text = refused("referee", referee=Mine(0.1))
    assert "referee: Mine.observe: expected a list of events, got" in text


@pytest.mark.parametrize("outcome", ["won", "", 3, True])
def test_a_referee_gives_a_known_outcome(outcome):
    referee = Timed(0.1)
    referee.observe = lambda *arguments: setattr(referee, "outcome", outcome) or []
    assert "Timed.outcome: expected None or one of finished" in refused("referee", referee=referee)


@pytest.mark.parametrize("count", ["passed", "lap", "next_gate"])
@pytest.mark.parametrize("number", [None, -1, 1.5, "1"])
def test_a_referee_counts_gates_and_laps(count, number):
    referee = Timed(0.1)
    setattr(referee, count, number)
    text = refused("referee", referee=referee)
    assert f"referee: Timed.{count}: expected a whole number" in text


def test_a_referee_that_never_ends_a_flight_has_the_time_limit_of_the_flight():
    referee = Timed(1e9)
    run = quadsim.fly("figure8", **SMALL, controller=Hover(10.5), referee=referee)
    assert run.outcome == "timeout"
    assert run.telemetry["t"][-1] == pytest.approx(SMALL["timeout"])


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
    make = {
        "plant": Free,
        "controller": lambda spec: Hover(10.5),
        "referee": lambda spec: Timed(0.1),
    }[role]
    flown = {
        quadsim.fly("figure8", **SMALL, **{role: part}).telemetry["px"].tobytes()
        for part in (make, partial(make), Maker(make), Maker(make).bound)
    }
    assert len(flown) == 1


@pytest.mark.parametrize("role", ["plant", "controller", "referee"])
@pytest.mark.parametrize("found", [None, 3, Hover, np])
def test_a_maker_that_makes_no_part_is_refused(role, found):
    text = refused(role, **{role: lambda spec: found})
    assert f"{role}: expected " in text
    assert "to return an object with" in text


@pytest.mark.parametrize("role", ["plant", "controller", "referee", "cost"])
def test_a_maker_takes_one_argument(role):
    for function in (lambda: None, lambda spec, more: None, len):
        text = refused(role, **{role: function})
        assert f"{role}: expected a function of the " in text


@pytest.mark.parametrize("role", ["plant", "controller", "referee", "cost"])
def test_an_error_in_ones_own_lines_is_that_error(role):
    def fails(argument):
        raise TypeError("mine")

    with pytest.raises(TypeError, match="mine") as error:
        quadsim.fly("figure8", **SMALL, **{role: fails})
    assert type(error.value) is TypeError


@pytest.mark.parametrize("part", [Held, lambda *arguments: 0, partial(Held), 3, np])
def test_a_sampler_is_an_object(part):
    assert "sampler: expected a sampler: an object with sample(" in refused("sampler", sampler=part)


def calm(x, x_next, u, gate, p):
    return u.wx * u.wx


BROKEN_COSTS = {
    "None": (lambda cost: None, "to return a Cost, got None: is a return missing?"),
    "a number": (lambda cost: 3, "to return a Cost, got 3"),
    "terms alone": (lambda cost: cost.terms, "to return a Cost, got (Term("),
    "reached and crash after the terms": (
        lambda cost: replace(cost, terms=(*cost.terms, cost.reached, cost.crash)),
        "terms: expected a tuple of Term objects, got controllers.costs.race.reached",
    ),
    "a function": (
        lambda cost: replace(cost, terms=(*cost.terms, calm)),
        "got test_own_parts.calm",
    ),
    "a list": (lambda cost: replace(cost, terms=list(cost.terms)), "terms: expected a tuple"),
    "no terms": (lambda cost: replace(cost, terms=()), "a term of controllers.costs.crash"),
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
        "weight_calm: expected one number or one for each of 50 steps, got shape (7,)",
    ),
}


@pytest.mark.parametrize("fault", BROKEN_COSTS)
def test_a_cost_function_that_returns_no_whole_cost_is_refused(fault):
    change, problem = BROKEN_COSTS[fault]
    assert problem in refused("cost", cost=change)


@pytest.mark.parametrize(
    "terms",
    [
        {"a": 1},
        calm,
        [calm],
        [None],
        [(calm, NAN)],
        [(calm, "1")],
        [(calm, True)],
        [(calm, 1.0, 2.0)],
        [(calm, np.ones(7))],
        [(calm, np.ones((50, 2)))],
        [(calm, 1.0), (calm, 2.0)],
        [(Hover, 1.0)],
        [(max, 1.0)],
        [(lambda x, x_next, u, gate, p: None, 1.0)],
        [(lambda x, x_next, u, gate, p: NAN, 1.0)],
        [(lambda x, u: 1.0, 1.0)],
    ],
)
def test_terms_that_are_none_are_refused(terms):
    assert refused("terms", terms=terms)


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


def test_a_deadline_is_refused_beside_a_controller_that_cannot_keep_it():
    text = refused("deadline_ms", controller=Hover(10.5), deadline_ms=5.0)
    assert "expected none for Hover, as only MPPI keeps it by its samples, got 5" in text
    run = quadsim.fly("figure8", **SMALL, controller=planner_of, deadline_ms=50.0)
    assert run.outcome == "timeout"


def test_ones_own_controller_and_referee_have_the_say():
    run = quadsim.fly("figure8", **SMALL, controller=Hover(10.5), referee=lambda spec: Timed(0.1))
    assert (run.telemetry["a_cmd"] == 10.5).all()
    assert run.telemetry["t"][-1] == pytest.approx(0.1)
    assert run.outcome == "finished"


def test_a_sampler_of_ones_own_on_the_command_line_lies_in_the_current_folder(tmp_path, capsys):
    (tmp_path / "mine.py").write_text(
        "class Still:\n    def sample(self, rng, samples, horizon, controls):\n"
        "        return rng.standard_normal((samples, horizon, controls))\n"
    )
    # -P: Python itself does not look for modules in the current folder, as for an installed `race`
    code = "from quadsim.cli.cli import main; main()"
    command = [
        sys.executable,
        "-P",
        "-c",
        code,
        "fly",
        "figure8",
        *FLAGS,
        "--sampler",
        "mine:Still",
        "--json",
    ]
    root = os.path.dirname(os.path.dirname(quadsim.__file__))
    done = subprocess.run(
        command, cwd=tmp_path, env=os.environ | {"PYTHONPATH": root}, capture_output=True, text=True
    )
    assert done.returncode == 1, done.stderr
    run = quadsim.load_run("last", str(tmp_path / "runs"))
    assert run.spec["sampler"] == "Still"
    own = run.spec["own"]["sampler"]
    assert (own["class"], own["parameters"]) == ("mine.Still", {})
    assert len(own["sha256"]) == 64
    monkeypatched = "mine" in sys.modules or "" in sys.path
    with pytest.raises(
        quadsim.SettingError, match=r"sampler: expected package.module:Class .* got 'mine:Still'"
    ):
        quadsim.fly("figure8", sampler="mine:Still")
    assert not monkeypatched, "the library itself looks where Python does"


def test_compare_with_a_sampler_of_ones_own_gives_pairs_tables_and_a_picture(tmp_path):
    variants = {"gaussian": {}, "held": {"sampler": Held()}}
    comparison = quadsim.compare("figure8", variants, attempts=2, **SMALL)
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


def test_samplers_of_ones_own_are_variants_of_the_command_line(tmp_path, monkeypatch, capsys):
    """A class is made without arguments; an object of the module may have any."""
    (tmp_path / "own_samplers.py").write_text(
        "from tests.test_own_parts import Held\n\nslow = Held(steps=20)\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    variants = "colored,held=race+sampler=own_samplers:Held,slow=race+sampler=own_samplers:slow"
    race(["compare", "figure8", *FLAGS, "--attempts", "1", "--variants", variants, "--json"])
    output, progress = capsys.readouterr()
    found = json.loads(output)
    assert [variant["name"] for variant in found["variants"]] == ["colored", "held", "slow"]
    # An attempt that is equal to another one is flown once
    assert "3/3 figure8" in progress


def test_a_sampler_that_breaks_in_a_flight_of_the_command_line_is_one_line(
    tmp_path, monkeypatch, capsys
):
    """It was a traceback."""
    (tmp_path / "broken_sampler.py").write_text(
        "class Broken:\n    def sample(self, rng, samples, horizon, controls):\n"
        "        return None\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    assert race(["fly", "figure8", *FLAGS, "--sampler", "broken_sampler:Broken"]) == 2
    err = capsys.readouterr().err
    assert "sampler: Broken.sample: expected finite numbers of shape (256, 50, 4)" in err
    assert "got None" in err
    assert err.count("\n") == 1


def test_a_part_with_numbers_that_json_does_not_know_is_recorded():
    class Bounded(Hover):
        def __init__(self):
            super().__init__(10.5)
            self.bounds = np.array([-np.inf, np.nan])
            self.most = float("inf")

    run = quadsim.fly("figure8", **SMALL, controller=Bounded())
    parameters = run.spec["own"]["controller"]["parameters"]
    assert parameters["bounds"] == ["-inf", "nan"]
    assert parameters["most"] == "inf"
