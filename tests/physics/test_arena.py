"""Several vehicles in one world: each moves as it would alone, and collisions keep momentum."""

from contextlib import closing

import numpy as np
import pytest
from plant_cases import NO_BULLET

from quadsim.course import Course, Gate, Start
from quadsim.course.swept import first_within
from quadsim.physics.plant import has_bullet, new_arena
from quadsim.vehicle import GRAVITY, Vehicle

DT = 1 / 400
LEVEL = (1.0, 0.0, 0.0, 0.0)
GATE = Gate((40.0, 0.0, 50.0), 0.0, 0.0, 0.0, (2.0, 2.0), 0.3)
SKY = Course(
    "sky", "test", (GATE,), Start((0.0, 0.0, 50.0), 0.0), ((-99, 99),) * 3, False, 1, (), ""
)
BULLET = pytest.param("bullet", marks=pytest.mark.skipif(not has_bullet(), reason=NO_BULLET))
WORLDS = pytest.mark.parametrize("world", ["rigid", BULLET])


def ball(mass=1.0, radius=0.1):
    return Vehicle(
        name="ball",
        mass=mass,
        inertia=(0.004,) * 3,
        radius=radius,
        rate_tau=(0.1,) * 3,
        omega_max=(9.0,) * 3,
        thrust_max=36.0,
    )


def thrown(arena, vehicle, p, v):
    """Return a body at the position p with the velocity v."""
    body = arena.add(vehicle)
    body.place(p, LEVEL, v)
    return body


def float_on(arena, bodies, vehicles, seconds):
    """Let bodies move without weight. Return all contacts of each."""
    contacts = [set() for _ in bodies]
    for _ in range(round(seconds / DT)):
        for body, vehicle in zip(bodies, vehicles, strict=True):
            body.apply((0.0, 0.0, vehicle.mass * GRAVITY), (0.0, 0.0, 0.0))
        arena.step()
        for found, body in zip(contacts, bodies, strict=True):
            found.update(body.contacts())
    return contacts


@WORLDS
def test_vehicles_far_apart_move_as_each_does_alone(world):
    places = [((0.0, 0.0, 50.0), (3.0, 1.0, 0.0)), ((5.0, 5.0, 60.0), (0.0, -2.0, 1.0))]

    def after(chosen):
        with closing(new_arena(world, SKY, DT, collide=True)) as arena:
            bodies = [thrown(arena, ball(), *place) for place in chosen]
            float_on(arena, bodies, [ball()] * len(bodies), 0.5)
            return [body.read() for body in bodies]

    assert after(places) == after(places[:1]) + after(places[1:])


@WORLDS
def test_a_collision_keeps_momentum_and_takes_the_approach_away(world):
    heavy, light = ball(2.0), ball(0.5)
    with closing(new_arena(world, SKY, DT, collide=True)) as arena:
        a = thrown(arena, heavy, (0.0, 0.0, 50.0), (2.0, 0.5, 0.0))
        b = thrown(arena, light, (1.0, 0.0, 50.0), (-3.0, 0.5, 0.0))
        contacts = float_on(arena, (a, b), (heavy, light), 0.5)
        va, vb = np.array(a.read()[1]), np.array(b.read()[1])
        apart = np.linalg.norm(np.subtract(a.read()[0], b.read()[0]))
    assert contacts == [{"vehicle 2"}, {"vehicle 1"}]
    np.testing.assert_allclose(2.0 * va + 0.5 * vb, (2.5, 1.25, 0.0), atol=1e-3)
    # They approached at 5 m/s. Bullet pushes apart what has met within a step.
    assert -0.02 <= vb[0] - va[0] <= (0.02 if world == "rigid" else 0.5)
    assert apart >= 0.2 - 2e-3


@WORLDS
def test_vehicles_that_do_not_collide_pass_through_each_other(world):
    with closing(new_arena(world, SKY, DT, collide=False)) as arena:
        a = thrown(arena, ball(), (0.0, 0.0, 50.0), (2.0, 0.0, 0.0))
        b = thrown(arena, ball(), (1.0, 0.0, 50.0), (-3.0, 0.0, 0.0))
        contacts = float_on(arena, (a, b), (ball(), ball()), 0.5)
        assert a.read()[1][0] == pytest.approx(2.0)
        assert b.read()[1][0] == pytest.approx(-3.0)
    assert contacts == [set(), set()]


@WORLDS
def test_a_vehicle_that_has_left_is_touched_no_more(world):
    with closing(new_arena(world, SKY, DT, collide=True)) as arena:
        a = thrown(arena, ball(), (0.0, 0.0, 50.0), (2.0, 0.0, 0.0))
        b = thrown(arena, ball(), (1.0, 0.0, 50.0), (0.0, 0.0, 0.0))
        b.remove()
        contacts = float_on(arena, (a,), (ball(),), 0.5)
        assert a.read()[1][0] == pytest.approx(2.0)
    assert contacts == [set()]


@WORLDS
def test_the_faster_of_two_cannot_jump_through_the_other(world):
    # 100 m/s is 0.25 m in a step, more than both radii
    with closing(new_arena(world, SKY, DT, collide=True)) as arena:
        a = thrown(arena, ball(), (0.0, 0.0, 50.0), (99.0, 0.0, 0.0))
        b = thrown(arena, ball(), (5.0, 0.0, 50.0), (0.0, 0.0, 0.0))
        contacts = float_on(arena, (a, b), (ball(), ball()), 0.1)
    if world == "rigid":
        assert contacts == [{"vehicle 2"}, {"vehicle 1"}]


@pytest.mark.parametrize("seed", range(20))
def test_first_within_agrees_with_small_steps(seed):
    rng = np.random.default_rng(seed)
    a0, a1, b0, b1 = rng.uniform(-1, 1, (4, 3))
    reach = rng.uniform(0.1, 1.0)
    s = np.linspace(0.0, 1.0, 100_001)[:, None]
    near = np.linalg.norm((1 - s) * (a0 - b0) + s * (a1 - b1), axis=1) <= reach
    expected = float(s[near.argmax()][0]) if near.any() else None
    found = first_within(tuple(a0), tuple(a1), tuple(b0), tuple(b1), reach)
    assert found == (None if expected is None else pytest.approx(expected, abs=2e-5))
