"""The PyBullet world obeys Newton, keeps frames, and has contacts where the geometry says."""

import subprocess
import sys
from contextlib import closing
from math import cos, pi, sin

import numpy as np
import pytest
from plant_cases import NO_BULLET

from quadsim.course import Course, Gate, Start
from quadsim.vehicle import GRAVITY, Vehicle

bullet = pytest.importorskip("pybullet", reason=NO_BULLET)
from quadsim.physics.world import BulletWorld  # noqa: E402

DT, DEPTH, RADIUS = 1 / 400, 0.1, 0.1
LEVEL, REST = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
MASS, INERTIA = 0.75, (0.0025, 0.0021, 0.0043)
WEIGHT = (0.0, 0.0, MASS * GRAVITY)
SPHERE = Vehicle(
    name="sphere",
    mass=MASS,
    inertia=INERTIA,
    radius=RADIUS,
    rate_tau=(0.1,) * 3,
    omega_max=(9.0,) * 3,
    thrust_max=36.0,
)
GATES = (
    Gate((5.0, 0.0, 2.0), 0.0, 0.0, 0.0, (2.4, 1.6), 0.3),
    Gate((-3.0, 4.0, 3.0), 2.2, 0.0, 0.0, (1.5, 1.5), 0.275),
    Gate((1.0, -6.0, 4.0), -0.7, 0.5, 0.3, (1.4, 1.0), 0.2),
)
COURSE = Course(
    "three", "test", GATES, Start((0.0, 0.0, 1.0), 0.0), ((-9, 9),) * 3, False, 1, (), ""
)


@pytest.fixture
def world():
    with closing(BulletWorld(COURSE, SPHERE, DT)) as world:
        yield world


def coast(world, seconds, force=REST, torque=REST):
    """Fly with one constant body wrench."""
    for _ in range(round(seconds / DT)):
        world.apply(force, torque)
        world.step()
    return world.read()


def touches(world, number, local):
    """Return the contacts of the vehicle at a point of the frame of gate `number`."""
    gate = GATES[number - 1]
    # far off first: a jump through a bar drags
    for p in ((0.0, 0.0, 90.0), gate.position + gate.rotation @ local):
        world.place(tuple(p), LEVEL)  # the old contact along
        world.step()
    return world.contacts()


def test_free_fall_is_half_g_t_squared(world):
    world.place((0.0, 0.0, 50.0), LEVEL)
    p, v, *_ = coast(world, 2.0)
    assert v[2] == pytest.approx(-GRAVITY * 2.0, rel=1e-12)
    assert p[2] - 50.0 == pytest.approx(-GRAVITY * 2.0**2 / 2, abs=1.01 * GRAVITY * 2.0 * DT / 2)


def speed_after_a_second(world):
    world.place((0.0, 0.0, 50.0), LEVEL, v=(12.0, 0.0, 0.0))
    level = GRAVITY * MASS
    return coast(world, 1.0, (0.0, 0.0, level))[1][0]


def test_nothing_brakes_a_coasting_vehicle(world):
    assert speed_after_a_second(world) == pytest.approx(12.0, abs=1e-9)


def test_bullets_default_damping_would_have_been_seen(world):
    bullet.changeDynamics(world.number, -1, linearDamping=0.04, **world._at)
    assert speed_after_a_second(world) < 9.0


def test_a_wrench_lives_one_step(world):
    world.place((0.0, 0.0, 50.0), LEVEL)
    world.apply((0.0, 0.0, 5.0), (0.01, 0.0, 0.0))
    world.step()
    first = world.read()
    world.step()
    second = world.read()
    assert second[1][2] - first[1][2] == pytest.approx(-GRAVITY * DT, rel=1e-9)
    assert second[3] == pytest.approx(first[3], abs=1e-12)


def test_force_and_torque_act_in_the_body_frame_and_quaternions_are_wxyz(world):
    yaw = pi / 2
    world.place((0.0, 0.0, 50.0), (cos(yaw / 2), 0.0, 0.0, sin(yaw / 2)))
    world.apply((3.0, 0.0, MASS * GRAVITY), (0.01, 0.02, 0.03))
    world.step()
    _, v, q, omega = world.read()
    # body x looks along world y
    np.testing.assert_allclose(v, (0.0, 3.0 / MASS * DT, 0.0), atol=1e-12)
    np.testing.assert_allclose(omega, np.array((0.01, 0.02, 0.03)) / INERTIA * DT, rtol=1e-12)
    np.testing.assert_allclose(q, (cos(yaw / 2), 0.0, 0.0, sin(yaw / 2)), atol=1e-3)


def energy_gained(dt):
    """Relative change of the rotational energy in a 6 rad/s tumble of 2 s without torque."""
    with closing(BulletWorld(COURSE, SPHERE, dt)) as world:
        world.place((0.0, 0.0, 90.0), LEVEL, omega=(12**0.5,) * 3)
        energy = [np.dot(INERTIA, np.square(world.read()[3]))]
        for _ in range(round(2.0 / dt)):
            world.step()
        return np.dot(INERTIA, np.square(world.read()[3])) / energy[0] - 1


def test_a_torque_free_tumble_gains_at_most_3_percent_energy_and_less_with_smaller_steps():
    coarse, fine = energy_gained(1 / 400), energy_gained(1 / 1600)
    assert 0 < fine < coarse < 0.03
    # the gyroscopic term is explicit: first order
    assert coarse / fine == pytest.approx(4.0, rel=0.1)


def test_worlds_do_not_disturb_each_other(world):
    def fall(world):
        world.place((0.0, 0.0, 50.0), LEVEL)
        return coast(world, 0.5, (0.1, 0.0, 3.0), (0.001, 0.002, 0.0))

    alone = fall(world)
    with closing(BulletWorld(COURSE, SPHERE, DT)) as other:
        other.place((3.0, 0.0, 5.0), LEVEL, v=(30.0, 0.0, 0.0))
        other.step()
        assert fall(world) == alone
        assert other.read()[0][0] == pytest.approx(3.0 + 30.0 * DT)


@pytest.mark.parametrize("number", [1, 2, 3])
def test_flying_through_the_opening_touches_nothing(world, number):
    half_y, half_z = (side / 2 - RADIUS - 1e-3 for side in GATES[number - 1].opening)
    for x in np.linspace(-0.4, 0.4, 17):
        assert touches(world, number, (x, 0.0, 0.0)) == ()
        assert touches(world, number, (x, half_y, -half_z)) == ()


@pytest.mark.parametrize("side", [(1, 0), (-1, 0), (0, 1), (0, -1)])
@pytest.mark.parametrize("number", [1, 2, 3])
def test_bars_stand_where_their_geometry_puts_them_to_a_millimetre(world, number, side):
    gate, mm = GATES[number - 1], 1e-3
    along, name = np.array((0.0, *side)), (f"gate {number}",)
    inner = np.abs(along[1:]) @ gate.opening / 2
    outer = inner + gate.frame_width
    for edge, inward in ((inner - RADIUS, 1), (outer + RADIUS, -1)):
        assert touches(world, number, along * (edge - inward * mm)) == ()
        assert touches(world, number, along * (edge + inward * mm)) == name
    middle, passage, face = (
        along * (inner + outer) / 2,
        np.array((1.0, 0.0, 0.0)),
        DEPTH / 2 + RADIUS,
    )
    for sign in (-1, 1):
        assert touches(world, number, middle + sign * (face + mm) * passage) == ()
        assert touches(world, number, middle + sign * (face - mm) * passage) == name


@pytest.mark.parametrize("number", [1, 2, 3])
def test_frames_have_corners(world, number):
    gate = GATES[number - 1]
    y, z = ((side + gate.frame_width) / 2 for side in gate.opening)
    for corner in ((y, z), (y, -z), (-y, z), (-y, -z)):
        assert touches(world, number, (0.0, *corner)) == (f"gate {number}",)


def test_a_contact_is_reported_in_the_step_that_makes_it(world):
    gate = GATES[0]
    bar = gate.opening[0] / 2 + gate.frame_width / 2
    front = gate.position[0] - DEPTH / 2 - RADIUS
    world.place((front - 0.5, bar, gate.position[2]), LEVEL, v=(10.0, 0.0, 0.0))
    while not world.contacts():
        world.step()
    p, v, *_ = world.read()
    assert 0.0 <= p[0] - front <= 10.0 * DT + 1e-9
    assert v[0] == pytest.approx(10.0)  # the state that touches, not the one thrown back


def test_of_many_gates_only_those_around_the_vehicle_stand_and_keep_their_numbers():
    gates = tuple(
        Gate((4.0 * k, 0.0, 2.0), 0.0, 0.0, 0.0, (1.5, 1.5), 0.275) for k in range(1, 201)
    )
    course = Course(
        "line", "", gates * 2, Start((0.0, 0.0, 2.0), 0.0), ((-1e4, 1e4),) * 3, False, 1, (), ""
    )
    with closing(BulletWorld(course, SPHERE, DT)) as world:
        for number in (1, 150, 200, 3):
            world.place((4.0 * number, 0.8, 2.0), LEVEL)
            world.step()
            assert world.contacts() == (f"gate {number}",)
            assert len(world._arena._standing) < 10


def test_gates_are_put_up_on_the_way():
    gates = tuple(Gate((4.0 * k, 0.0, 2.0), 0.0, 0.0, 0.0, (1.5, 1.5), 0.275) for k in range(1, 41))
    course = Course(
        "line", "", gates, Start((0.0, 0.0, 2.0), 0.0), ((-1e4, 1e4),) * 3, False, 1, (), ""
    )
    with closing(BulletWorld(course, SPHERE, DT)) as world:
        world.place((4.0, 0.0, 2.0), LEVEL, (90.0, 0.0, 0.0))
        for _ in range(600):
            world.step()
            p = world.read()[0]
            stand = {name for name in world._arena.names.values() if name != "ground"}
            assert stand >= {f"gate {k}" for k in range(1, 41) if abs(4.0 * k - p[0]) < 4.0}
    assert p[0] > 100.0


def test_resting_on_the_ground_is_a_contact_and_a_millimetre_above_is_none(world):
    world.place((0.0, 0.0, RADIUS + 1e-3), LEVEL)
    world.step()
    assert world.contacts() == ()
    coast(world, 0.5)
    assert world.contacts() == ("ground",)


def test_a_vehicle_that_stood_still_wakes_up(world):
    world.place((0.0, 0.0, 5.0), LEVEL)
    coast(world, 5.0, WEIGHT)
    assert coast(world, 1.0)[1][2] == pytest.approx(-GRAVITY, rel=1e-9)


def test_closing_twice_is_harmless():
    world = BulletWorld(COURSE, SPHERE, DT)
    world.close()
    world.close()
    assert not bullet.isConnected(**world._at)


@pytest.mark.process
def test_loading_the_world_prints_nothing():
    code = "import sys, quadsim.physics.world; print('out'); print('err', file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert (done.stdout, done.stderr) == (b"out\n", b"err\n")
