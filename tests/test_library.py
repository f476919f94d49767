"""The public interface: what `import quadsim` promises."""

import inspect
import json
import subprocess
import sys

import numpy as np
import pytest
from run_cases import frame

import quadsim
from quadsim.cli.cli import race
from quadsim.paper.integrator import double_integrator, quadratic_cost
from tests.small import SHORT, flags


@pytest.fixture(scope="module")
def default():
    return quadsim.fly("figure8", **SHORT)


def test_every_public_name_is_there_and_says_what_it_is():
    assert set(quadsim.__all__) <= set(dir(quadsim))
    for name in quadsim.__all__:
        thing = getattr(quadsim, name)
        if inspect.isclass(thing) or inspect.isfunction(thing):
            assert inspect.getdoc(thing), name
            assert not thing.__doc__.startswith(f"{name}("), "its own words, not a signature"


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'flie'"):
        _ = quadsim.flie


@pytest.mark.process
def test_importing_quadsim_loads_nothing_slow():
    code = "import quadsim, sys; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    slow = {"numba", "scipy", "matplotlib", "pybullet", "numpy", "viser", "msgspec", "yaml"}
    assert not slow & set(loaded)
    assert "quadsim" in loaded


@pytest.mark.compiled
def test_fly_gives_the_run_that_the_command_stores(default, tmp_path, capsys):
    assert race(["fly", "figure8", *flags(SHORT), "--runs-dir", str(tmp_path), "--json"]) == 1
    capsys.readouterr()
    stored = quadsim.load_run("last", str(tmp_path))
    assert stored.digest() == default.digest()
    record = json.loads(next(tmp_path.glob("*/run.json")).read_text())
    assert record["repeatable_from_spec"]


def test_what_a_user_prints_is_one_short_line():
    spec = quadsim.Spec.of("lsy_level2", sensing="mocap", **SHORT)
    for thing, said in (
        (spec, "lsy_level2: 1 lap, colored, preset race, vehicle swift, seed 0"),
        (spec.course, "lsy_level2: 4 gates, 4 obstacles, open"),
        (spec.vehicle, "swift: 0.87 kg"),
        (frame(0), "t=0.0"),
    ):
        assert said in repr(thing)
        assert "\n" not in repr(thing)
        assert len(repr(thing)) < 600


@pytest.mark.compiled
def test_frames_are_the_steps_of_the_run(default):
    steps = list(quadsim.frames(quadsim.Spec.of("figure8", **SHORT)))
    assert [f.t for f in steps] == default.telemetry["t"].tolist()
    assert [f.u[3] for f in steps] == default.telemetry["a_cmd"].tolist()
    assert [f.outcome for f in steps if f.outcome] == [default.outcome]


# Setting -> a value that does not fit, and a part of what the error says was expected.
WRONG = {
    "samples": (1, "a whole number >= 2"),
    "horizon": (20.5, "a whole number [steps]"),
    "sigma": ((1, 1, 1), "4 numbers [rad/s, rad/s, rad/s, m/s^2]"),
    "gamma": ((1, 1, 1, -1), "4 numbers >= 0"),
    "seed": (-1, "a whole number >= 0"),
    "randomize": ("much", "a number"),
    "temperature": (float("nan"), "a number"),
    "dt": (0.0033, "a whole multiple of the plant's step 0.0025 [s]"),
    "target_ess": (1e9, "effective sample size below samples"),
    "smooth": ("maybe", "true or false"),
    "law": ("exat", "'exact'"),
    "clock": (3, "'simulated'"),
    "vehicle": (3, "a name, a FILE.yaml or a Vehicle"),
    "threads": (10**6, "1 to "),
    "model_drag": (-1, "a number [1/s] >= 0"),
    "model_dragg": (1, "did you mean 'model_drag'?"),
    "sampels": (3, "did you mean 'samples'?"),
    "system": ("offroad", "no such setting"),
    "sampler": ("colred", "did you mean 'colored'?"),
    "plant": ("bulet", "'bullet'"),
    "cost": (3, "a Cost"),
    "terms": (5, "(function, weight)"),
    "controller": (3, "an object with 'control'"),
    "referee": (3, "an object with 'observe'"),
    "course": (3, "a name, a FILE.yaml or a Course"),
}


def test_a_wrong_setting_is_an_error_of_one_line_that_names_it():
    for name, (given, expected) in WRONG.items():
        with pytest.raises(quadsim.SettingError) as caught:
            quadsim.fly(**{name: given})
        assert expected in str(caught.value)
        assert caught.value.name == name
        assert "\n" not in str(caught.value)
        assert isinstance(caught.value, ValueError)


def test_a_course_or_vehicle_that_does_not_exist_is_a_value_error_with_a_proposal():
    for wrong in ({"course": "figure9"}, {"vehicle": "swft"}, {"preset": "rac"}):
        with pytest.raises(quadsim.FileError, match="did you mean") as caught:
            quadsim.fly(**wrong)
        assert isinstance(caught.value, ValueError)


# A flight for which nothing is compiled
PILOT = {"pilot": "split_s_swift", "laps": 1, "timeout": 0.05}


def test_the_number_of_threads_is_used(on_threads):
    from quadsim.controllers.lanes.threads import threads

    def fly():
        quadsim.fly("split_s_swift", **PILOT, threads=1)
        return threads()

    assert on_threads(2, fly) == 1


def test_the_number_of_threads_is_used_in_races_of_several(on_threads):
    from quadsim.controllers.lanes.threads import threads

    def race():
        quadsim.race({"one": PILOT, "other": PILOT}, threads=1)
        return threads()

    assert on_threads(2, race) == 1
    with pytest.raises(quadsim.SettingError, match="threads: expected a whole number"):
        quadsim.race({"one": PILOT, "other": PILOT}, threads=0)


@pytest.mark.compiled
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
