"""RotorPy's multirotor as a plant: the same vehicle, other aerodynamics, flown by the same
planner."""

import sys
from contextlib import closing
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from plant_cases import HOVER, SKY
from race_cases import course, gate

import quadsim
from quadsim.cli.cli import race
from quadsim.dynamics.quadrotor import STATE
from quadsim.limit.limits import limit_of
from quadsim.physics.plant import RigidPlant
from quadsim.physics.rotorpy_plant import LIFT, PARASITIC, RotorpyPlant
from quadsim.report.run_text import flown_with
from quadsim.vehicle import GRAVITY, load_vehicle
from tests.small import SMALL, flags

SWIFT = load_vehicle("swift")
needs_rotorpy = pytest.mark.skipif(
    not find_spec("rotorpy"), reason="RotorPy is not installed: extra rotorpy"
)


def fly(plant, seconds, u=HOVER):
    with closing(plant):
        for _ in range(round(seconds / plant.dt)):
            plant.step(u)
        return np.array(plant.state.x)


def at_speed(plant, v):
    """The same plant, level, at the velocity v in the world [m/s]."""
    plant._now["v"] = np.array(v)
    return plant


@needs_rotorpy
def test_hover_stays_where_it_is():
    x = fly(RotorpyPlant(SKY, SWIFT), 1.0)
    np.testing.assert_allclose(x[:3], SKY.start.position, atol=1e-6)
    np.testing.assert_allclose(x[13], GRAVITY, rtol=1e-6)


@needs_rotorpy
@pytest.mark.parametrize("u", [(2.0, 0.0, 0.0, 12.0), (0.0, 2.0, 0.0, 12.0), (0.0, 0.0, 1.0, 12.0)])
def test_body_rates_turn_it_as_they_turn_the_other_plants(u):
    ours, theirs = fly(RigidPlant(SKY, SWIFT), 0.1, u), fly(RotorpyPlant(SKY, SWIFT), 0.1, u)
    np.testing.assert_allclose(theirs[6:], ours[6:], atol=0.05 * np.abs(ours[6:]).max())
    assert np.abs(ours[10:13]).max() > 0.3


@needs_rotorpy
@pytest.mark.parametrize("axis", [0, 1])
def test_drag_and_lift_are_those_of_the_docstring(axis):
    v = [0.0, 0.0, 0.0]
    v[axis] = 10.0
    plant = at_speed(RotorpyPlant(SKY, SWIFT), v)
    speed_share = np.sqrt(GRAVITY / SWIFT.thrust_max)  # of hover, of the full rotor speed
    after = fly(plant, plant.dt)[3:6]
    slower = SWIFT.drag[axis] * speed_share * 10.0 + PARASITIC[axis] * 10.0**2
    assert (10.0 - after[axis]) / plant.dt == pytest.approx(slower, rel=0.01)
    assert after[2] / plant.dt == pytest.approx(LIFT * 10.0**2, rel=0.01)


@needs_rotorpy
def test_command_latency_delays_the_rotors():
    late = replace(SWIFT, latency=0.04)
    u = (3.0, 0.0, 0.0, GRAVITY)
    assert fly(RotorpyPlant(SKY, late), 0.04, u)[10] == 0.0
    assert fly(RotorpyPlant(SKY, late), 0.1, u)[10] == pytest.approx(
        fly(RotorpyPlant(SKY, SWIFT), 0.06, u)[10]
    )


@needs_rotorpy
def test_gusts_push_and_a_heavier_body_sinks():
    pushed = fly(RotorpyPlant(SKY, SWIFT, gusts=iter([(1.0, 0.0, 0.0)] * 40)), 0.1)
    assert pushed[3] == pytest.approx(0.1, rel=0.05)
    heavy = fly(RotorpyPlant(SKY, SWIFT, body=replace(SWIFT, mass=1.1 * SWIFT.mass)), 0.1)
    assert heavy[5] == pytest.approx(-0.1 * GRAVITY * (1 - 1 / 1.1), rel=0.05)


@needs_rotorpy
def test_a_vehicle_without_rotors_is_one_line():
    with pytest.raises(
        ValueError, match=r"^plant: 'rotorpy' needs a vehicle with rotors, got 'paper'"
    ):
        RotorpyPlant(SKY, load_vehicle("paper"))


@pytest.mark.compiled
@needs_rotorpy
def test_a_flight_finishes_records_its_plant_and_repeats_to_the_last_bit():
    # Gates so wide that a small planner flies through them
    gates = course(gate(4.0, opening=(4.0, 4.0)), gate(8.0, opening=(4.0, 4.0)))
    settings = {**SMALL, "plant": "rotorpy", "seed": 3, "randomize": 1.0, "threads": 1}
    run = quadsim.fly(gates, **settings)
    assert (run.outcome, run.spec["plant"]) == ("finished", "rotorpy")
    assert ", plant rotorpy" in flown_with(run.spec)
    flight = quadsim.frames(gates, **settings)
    again = [frame.x for frame, _ in zip(flight, range(20), strict=False)]
    assert again[19] == tuple(float(run.telemetry[name][19]) for name in STATE)


def test_a_limit_is_not_that_of_a_run_with_other_dynamics():
    record = quadsim.Spec.of("figure8").record()
    assert limit_of(record) is not None
    assert limit_of(record | {"plant": "rotorpy"}) is None


@pytest.mark.compiled
def test_without_the_extra_one_line_says_what_installs_it(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    for name in [name for name in sys.modules if name.split(".")[0] == "rotorpy"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "rotorpy", None)
    assert race(["fly", "figure8", "--plant", "rotorpy", *flags(SMALL)]) == 2
    error = capsys.readouterr().err
    assert error.startswith("race fly: plant: 'rotorpy': rotorpy is not installed: ")
    assert "rotorpy" in error.partition(" -m pip install ")[2]
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
