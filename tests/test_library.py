"""The public interface: what `import quadsim` promises."""

import inspect
import json
import subprocess
import sys

import numpy as np
import pytest

import quadsim
from quadsim.cli.cli import race
from quadsim.paper.integrator import double_integrator, quadratic_cost

SMALL = {"samples": 256, "horizon": 50, "iterations": 1, "laps": 1, "timeout": 0.3}
FLAGS = [word for name, number in SMALL.items() for word in (f"--{name}", str(number))]


@pytest.fixture(scope="module")
def default():
    return quadsim.fly("figure8", **SMALL)


@pytest.mark.parametrize("name", quadsim.__all__)
def test_every_public_name_is_there_and_says_what_it_is(name):
    thing = getattr(quadsim, name)
    assert name in dir(quadsim)
    if inspect.isclass(thing) or inspect.isfunction(thing):
        doc = inspect.getdoc(thing)
        assert doc
        assert not doc.startswith(f"{name}("), "its own words, not a signature"


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'flie'"):
        _ = quadsim.flie


def test_importing_quadsim_loads_nothing_slow():
    code = "import quadsim, sys; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    slow = {"numba", "scipy", "matplotlib", "pybullet", "numpy", "viser", "msgspec", "yaml"}
    assert not slow & set(loaded)
    assert "quadsim" in loaded


def test_fly_gives_the_run_that_the_command_stores(default, tmp_path, capsys):
    assert race(["fly", "figure8", *FLAGS, "--runs-dir", str(tmp_path), "--json"]) == 1
    capsys.readouterr()
    stored = quadsim.load_run("last", str(tmp_path))
    assert (
        stored.digest()
        == default.digest()
        == quadsim.fly(quadsim.Spec.of("figure8", **SMALL)).digest()
    )
    record = json.loads(next(tmp_path.glob("*/run.json")).read_text())
    assert record["repeatable_from_spec"]


def test_frames_are_the_steps_of_the_run(default):
    steps = list(quadsim.frames("figure8", **SMALL))
    assert [f.t for f in steps] == default.telemetry["t"].tolist()
    assert [f.outcome for f in steps if f.outcome] == [default.outcome]


WRONG = {  # setting -> value, what the message must say
    "samples": (1, "samples: expected a whole number >= 2 and <= 1e+06, got 1"),
    "horizon": (20.5, "horizon: expected a whole number [steps], got '20.5'"),
    "sigma": ((1, 1, 1), "sigma: expected 4 numbers [rad/s, rad/s, rad/s, m/s^2], got 3"),
    "gamma": ((1, 1, 1, -1), "gamma: expected 4 numbers >= 0 and <= 10, got 1 1 1 -1"),
    "seed": (-1, "seed: expected a whole number >= 0 and <= 1e+09, got -1"),
    "randomize": ("much", "randomize: expected a number, got 'much'"),
    "temperature": (float("nan"), "temperature: expected a number, got 'nan'"),
    "dt": (0.0033, "dt: expected a whole multiple of the plant's step 0.0025 [s], got 0.0033"),
    "target_ess": (1e9, "target_ess: expected less than samples"),
    "smooth": ("maybe", "smooth: expected true or false, got 'maybe'"),
    "law": ("exat", "law: expected 'exact' or 'library' or 'paper', got 'exat'"),
    "clock": (3, "clock: expected 'simulated' or 'wall', got '3'"),
    "vehicle": (3, "vehicle: expected text, got 3"),
    "threads": (10**6, "threads: expected 1 to "),
    "model.drag": (-1, "model.drag: expected a number [1/s] >= 0"),
    "model.dragg": (1, "model.dragg: no such setting, did you mean 'model.drag'?"),
    "sampels": (3, "sampels: no such setting, did you mean 'samples'?"),
    "sampler": ("colred", "sampler: no sampler 'colred': did you mean 'colored'?"),
    "plant": ("bulet", "plant: expected 'bullet' or 'rigid' or 'rotorpy', got 'bulet'"),
    "cost": (3, "cost: expected an object with 'terms', or a function that makes one, got 3"),
    "terms": (
        5,
        "terms: expected terms=[(function, weight), ...] or controllers.costs.Term objects, got 5",
    ),
    "controller": (
        3,
        "controller: expected an object with 'control', or a function that makes one, got 3",
    ),
    "referee": (
        3,
        "referee: expected an object with 'observe', or a function that makes one, got 3",
    ),
    "course": (3, "course: expected a name, a FILE.yaml or a Course, got 3"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_setting_is_an_error_of_one_line_that_names_it(name):
    given, said = WRONG[name]
    with pytest.raises(quadsim.SettingError) as caught:
        quadsim.fly(**{name: given})
    assert said in str(caught.value)
    assert caught.value.name == name
    assert "\n" not in str(caught.value)
    assert isinstance(caught.value, ValueError)


def test_a_course_or_vehicle_that_does_not_exist_is_a_value_error_with_a_proposal():
    for wrong in ({"course": "figure9"}, {"vehicle": "swft"}, {"preset": "rac"}):
        with pytest.raises(quadsim.FileError, match="did you mean") as caught:
            quadsim.fly(**wrong)
        assert isinstance(caught.value, ValueError)


def test_the_number_of_threads_is_used(on_threads):
    from controllers.lanes.threads import threads

    def fly():
        quadsim.fly("figure8", **SMALL | {"timeout": 0.05}, threads=1)
        return threads()

    assert on_threads(2, fly) == 1


def test_mppi_alone_in_a_loop_brings_the_double_integrator_to_its_goal():
    dt = 0.05
    system = double_integrator(dt)
    config = quadsim.MPPIConfig(samples=256, horizon=40, dt=dt)
    mppi = quadsim.MPPI(
        system, quadratic_cost(goal=(1.0, 0.0)), quadsim.Gaussian((1.0, 1.0)), config
    )
    x = np.array([2.0, -1.0, 0.0, 0.0])
    for _ in range(150):
        u, stats = mppi.control(x)
        assert 1 <= stats.ess <= 256
        x = np.array(system.next(x, u))
    assert x == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=0.2)
