"""Crazyflow's quadrotor as a plant: the same vehicle in the simulator of a competition."""

import os
import sys
from contextlib import closing
from dataclasses import replace
from importlib.util import find_spec
from itertools import repeat

import numpy as np
import pytest
from plant_cases import SKY

import quadsim
from quadsim.cli.cli import race
from quadsim.limit.limits import limit_of
from quadsim.physics import crazyflow_plant
from quadsim.physics.crazyflow_plant import CrazyflowPlant
from quadsim.physics.link import CommandNoise
from quadsim.physics.plant import RigidPlant
from quadsim.streams import quadrotor_streams
from quadsim.vehicle import GRAVITY, load_vehicle
from tests.small import SMALL, flags

# The vehicle whose numbers are Crazyflow's own
CRAZYFLIE = load_vehicle("cf21b_500")
DT = 0.002
HOVER = (0.0, 0.0, 0.0, GRAVITY)
# SciPy, which other tests load as well, has to be loaded with this flag.
needs_crazyflow = pytest.mark.skipif(
    not (find_spec("crazyflow") and os.environ.get("SCIPY_ARRAY_API")),
    reason="Crazyflow is not installed, extra crazyflow, or SCIPY_ARRAY_API=1 is not set",
)
# JAX compiles one step, once for all of these tests, and its libraries start processes.
pytestmark = [pytest.mark.slow, pytest.mark.compiled, pytest.mark.process]


def fly(plant, seconds, u=HOVER):
    with closing(plant):
        for _ in range(round(seconds / plant.dt)):
            plant.step(u)
        return np.array(plant.state.x)


def theirs(vehicle=CRAZYFLIE, **settings):
    return CrazyflowPlant(SKY, vehicle, DT, **settings)


@needs_crazyflow
def test_hover_stays_where_it_is():
    x = fly(theirs(), 0.2)
    np.testing.assert_allclose(x[:3], SKY.start.position, atol=1e-4)
    np.testing.assert_allclose(x[13], GRAVITY, rtol=1e-4)


@needs_crazyflow
@pytest.mark.parametrize(
    ("u", "share"),
    [
        # Crazyflow clips the torque of such a step.
        ((2.0, 0.0, 0.0, 12.0), 0.08),
        ((0.0, 2.0, 0.0, 12.0), 0.08),
        # The propellers' inertia yaws it as well while their speeds change.
        ((0.0, 0.0, 1.0, 12.0), 0.5),
    ],
)
def test_body_rates_turn_it_as_they_turn_the_other_plants(u, share):
    """About the same axes in the same sense."""
    ours = fly(RigidPlant(SKY, CRAZYFLIE, DT), 0.1, u)
    found = fly(theirs(), 0.1, u)
    np.testing.assert_allclose(found[6:13], ours[6:13], atol=share * np.abs(ours[10:13]).max())
    np.testing.assert_allclose(found[3:6], ours[3:6], atol=0.04)
    assert np.abs(ours[10:13]).max() > 0.3


@needs_crazyflow
def test_the_numbers_of_its_own_vehicle_are_its_own():
    """All of them but drag and the terms that level the vehicle."""
    assert CRAZYFLIE.rotors
    data = crazyflow_plant._simulator(round(1 / DT)).data
    changed = crazyflow_plant._with_numbers(data, CRAZYFLIE, CRAZYFLIE.rotors, CRAZYFLIE)
    for name in ("mass", "L", "J", "J_inv", "rpm2thrust", "rotor_dyn_coef", "prop_inertia"):
        before = np.asarray(getattr(data.params, name))
        np.testing.assert_allclose(getattr(changed.params, name), before, rtol=1e-3, err_msg=name)
    for name in ("thrust_min", "thrust_max", "L", "rpm2thrust", "thrust2torque"):
        before = np.asarray(data.controls.force_torque.params[name])
        after = changed.controls.force_torque.params[name]
        np.testing.assert_allclose(after, before, rtol=1e-3, err_msg=name)
    # the lags of the file are rounded
    for name in ("kw", "kd_omega"):
        before = np.asarray(data.controls.body_rate.params[name])
        after = changed.controls.body_rate.params[name]
        np.testing.assert_allclose(after, before, rtol=0.01, err_msg=name)


@needs_crazyflow
def test_forces_push_a_heavier_body_sinks_and_latency_delays():
    pushed = fly(theirs(gusts=repeat((1.0, 0.0, 0.0))), 0.1)
    assert pushed[3] == pytest.approx(0.1, rel=0.05)
    heavy = fly(theirs(body=replace(CRAZYFLIE, mass=1.1 * CRAZYFLIE.mass)), 0.1)
    assert heavy[5] == pytest.approx(-0.1 * GRAVITY * (1 - 1 / 1.1), rel=0.05)
    turn = (3.0, 0.0, 0.0, GRAVITY)
    late = replace(CRAZYFLIE, latency=0.04)
    assert fly(theirs(late), 0.04, turn)[10] == 0.0
    assert fly(theirs(late), 0.1, turn)[10] == pytest.approx(fly(theirs(), 0.06, turn)[10])


@needs_crazyflow
def test_noise_on_commands_turns_it():
    noise = CommandNoise((1.0, 0.0, 0.0, 0.0), 10, quadrotor_streams(0).link)
    assert abs(fly(theirs(noise=noise), 0.1)[10]) > 0.01


def test_vehicles_and_steps_that_it_cannot_have_are_one_line():
    with pytest.raises(
        ValueError, match=r"^plant: 'crazyflow' needs a vehicle with rotors, got 'p"
    ):
        theirs(load_vehicle("paper"))
    with pytest.raises(ValueError, match=r"^plant_dt: expected a physics step of 1 s over a whole"):
        CrazyflowPlant(SKY, CRAZYFLIE, 0.0023)


@needs_crazyflow
def test_a_flight_records_its_plant_and_repeats_to_the_last_bit():
    settings = {**SMALL, "plant": "crazyflow", "vehicle": "cf21b_500", "timeout": 0.3}
    settings |= {"seed": 3, "randomize": 1.0, "threads": 1}
    run = quadsim.fly("figure8", **settings)
    assert run.spec["plant"] == "crazyflow"
    assert quadsim.fly(run.spec).digest() == run.digest()
    assert limit_of(run.spec) is None


def test_without_the_extra_one_line_says_what_installs_it(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    crazyflow_plant._simulator.cache_clear()
    for name in [name for name in sys.modules if name.split(".")[0] == "crazyflow"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "crazyflow", None)
    assert race(["fly", "figure8", "--plant", "crazyflow", *flags({**SMALL})]) == 2
    error = capsys.readouterr().err
    assert error.startswith("race fly: plant: 'crazyflow': crazyflow is not installed: ")
    assert "crazyflow" in error.partition(" -m pip install ")[2]
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
