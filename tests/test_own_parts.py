"""Objects of the user's own in every role: sampler, cost, plant, controller, referee."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass, replace

import numpy as np
import pytest

import quadsim
from controllers.plan import PlanStats
from quadsim.dynamics.quadrotor import State, quadrotor
from quadsim.physics.plant import PlantState
from quadsim.race.events import Event
from quadsim.spec.build import start_of

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
    with pytest.raises(ValueError, match="plant: expected a state of 17 numbers, got 13"):
        quadsim.fly("figure8", **SMALL, plant=Short)


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
