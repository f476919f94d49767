"""Our rigid body: free flights as PyBullet's to rounding, contacts by the swept test, a ground that
holds."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from plant_cases import DT, GATE, HOVER, SKY, needs_bullet

from quadsim.course import FRAME_DEPTH, Start
from quadsim.dynamics.quadrotor import STATE
from quadsim.physics import plant
from quadsim.physics.domain_randomization import gusts
from quadsim.physics.plant import PLANTS, BulletPlant, RigidPlant, default_plant
from quadsim.physics.plant_state import CLEARANCE
from quadsim.physics.rigid_body import RigidBody
from quadsim.rotation import turned_at
from quadsim.vehicle import GRAVITY, load_vehicle

SWIFT = load_vehicle("swift")
TUMBLE = (6 / 3**0.5,) * 3  # [rad/s]: 6 rad/s about an axis between the body's
COMMANDS = {"hover": HOVER, "tumble": (*TUMBLE, 20.0), "full thrust": (0.0, 0.0, 0.0, 99.0)}
Q = slice(STATE.index("qw"), STATE.index("wx"))


def flight(plant, vehicle, u, gust=0.0, body=None):
    """States over 2 s of one command, quaternions with the sign that makes their largest number
    positive.  (800, 17)"""
    wind = gusts(np.random.SeedSequence(1), gust, DT)
    flown = plant(SKY, vehicle, DT, body=body, gusts=wind)
    x = np.array([flown.step(u).x for _ in range(round(2.0 / DT))])
    flown.close()
    largest = np.take_along_axis(x[:, Q], np.abs(x[:, Q]).argmax(axis=1)[:, None], axis=1)
    x[:, Q] *= np.sign(largest)  # q and -q are the same attitude, and Bullet changes between them
    return x


@pytest.mark.slow
@needs_bullet
@pytest.mark.parametrize("gust", [0.0, 0.5])
@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("vehicle", ["swift", "paper"])
def test_free_flights_agree_with_pybullet_to_rounding(vehicle, name, gust):
    """Both take the same steps in the same order, so only rounding differs.

    800 steps with an error of 1e-16 of numbers up to 100 each, if all added up, make 1e-11;
    measured are 4e-13.
    """
    given = load_vehicle(vehicle), COMMANDS[name], gust
    np.testing.assert_allclose(
        flight(RigidPlant, *given), flight(BulletPlant, *given), rtol=0, atol=1e-11
    )


@needs_bullet
@pytest.mark.parametrize("name", COMMANDS)
def test_a_body_one_percent_heavier_does_not_agree(name):
    heavy = replace(SWIFT, mass=1.01 * SWIFT.mass)
    flown = flight(RigidPlant, SWIFT, COMMANDS[name], 0.5, body=heavy)
    assert np.abs(flown - flight(BulletPlant, SWIFT, COMMANDS[name], 0.5)).max() > 0.1


def test_a_turn_of_half_a_second_at_pi_is_a_quarter_turn():
    q = (1.0, 0.0, 0.0, 0.0)
    for _ in range(200):
        q = turned_at(q, (0.0, 0.0, pi), DT)
    np.testing.assert_allclose(q, (0.5**0.5, 0.0, 0.0, 0.5**0.5), atol=1e-12)
    assert turned_at(q, (0.0, 0.0, 0.0), DT) == pytest.approx(q, abs=1e-15)


def test_a_torque_free_tumble_gains_at_most_3_percent_energy_as_bullets_does():
    """omega x J omega is taken at the old rates: the energy grows by less than 3 % in 2 s at 6
    rad/s."""
    body = RigidBody(SKY, SWIFT, DT)
    body.place((0.0, 0.0, 90.0), (1.0, 0.0, 0.0, 0.0), omega=TUMBLE)
    energy = [np.dot(SWIFT.inertia, np.square(body.read()[3]))]
    for _ in range(800):
        body.step()
        energy.append(np.dot(SWIFT.inertia, np.square(body.read()[3])))
    assert 0.0 < energy[-1] / energy[0] - 1.0 < 0.03
    assert np.ptp(np.array(body.read()[3])) > 0.1, "the axis of the tumble moves in the body"


# from the middle of the opening to that of a post [m]
BAR = GATE.opening[0] / 2 + GATE.frame_width / 2
FACE = GATE.position[0] - FRAME_DEPTH / 2 - SWIFT.radius  # x at which the sphere touches the frame


@pytest.mark.parametrize(("left", "expected"), [(BAR, ("gate 1",)), (0.0, ())])
def test_a_frame_between_two_steps_is_a_contact_and_an_opening_is_none(left, expected):
    """1 m before the gate, 1 m behind it a step later: neither end touches anything."""
    body = RigidBody(SKY, SWIFT, DT)
    x, y, z = GATE.position
    body.place((x - 1.0, y + left, z), (1.0, 0.0, 0.0, 0.0), v=(2.0 / DT, 0.0, 0.0))
    body.step()
    assert body.contacts() == expected
    body.step()
    assert body.contacts() == (), "it has left the gate behind"


def test_a_contact_is_reported_in_the_step_that_makes_it():
    body = RigidBody(SKY, SWIFT, DT)
    _, y, z = GATE.position
    body.place((FACE - 0.01, y + BAR, z), (1.0, 0.0, 0.0, 0.0), v=(5.0, 0.0, 0.0))
    while not body.contacts():
        body.step()
    assert 0.0 <= body.read()[0][0] - FACE <= 5.0 * DT


def test_the_ground_stops_a_fall_and_holds_the_vehicle_without_bounce():
    flown = RigidPlant(SKY, SWIFT, DT, start=Start((0.0, 0.0, 1.0), 0.0))
    states = [flown.step((0.0, 0.0, 0.0, 0.0)) for _ in range(800)]
    assert min(s.position[2] for s in states) == states[-1].position[2] == SWIFT.radius
    assert states[-1].contacts == ("ground",)
    lifted = [flown.step((0.0, 0.0, 0.0, 2 * GRAVITY)) for _ in range(200)][-1]
    assert lifted.position[2] > SWIFT.radius + CLEARANCE
    assert lifted.contacts == ()


def test_default_plant_is_bullet_where_it_is_installed_and_rigid_elsewhere(monkeypatch):
    found = {}
    for installed in (True, False):
        monkeypatch.setattr(plant, "has_bullet", lambda installed=installed: installed)
        found[installed] = PLANTS[default_plant()]
    assert found == {True: BulletPlant, False: RigidPlant}


def test_bullet_without_pybullet_is_refused_in_one_line(monkeypatch):
    monkeypatch.setattr(plant, "has_bullet", lambda: False)
    with pytest.raises(
        ValueError, match=r"^plant: 'bullet' needs PyBullet, which is not installed: .*'rigid'$"
    ):
        BulletPlant(SKY, SWIFT)
