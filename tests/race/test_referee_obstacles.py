"""Obstacles under the referee: a hit names the obstacle, in both plants; PyBullet's contacts are
hits."""

from contextlib import closing
from itertools import pairwise

import numpy as np
import pytest
from plant_cases import NO_BULLET
from referee_cases import DT, FAR, R, fly, gate, straight

from quadsim.course import Box, Course, Cylinder, Start
from quadsim.physics.plant import RigidPlant
from quadsim.physics.rigid_body import RigidBody
from quadsim.racing.events import lap_penalties
from quadsim.racing.referee import Referee
from quadsim.vehicle import GRAVITY, Vehicle

POLE, WALL = Cylinder((-1.0, 0.0, 9.0), 0.1, 2.0), Box((3.0, 0.0, 10.0), (0.5, 2.0, 1.0), 0.4)
HERE, AWAY = (gate(),), (gate((0.0, 40.0, 10.0)),)
PROBE = Vehicle(
    name="probe",
    mass=1.0,
    inertia=(1e-3,) * 3,
    radius=R,
    rate_tau=(0.05,) * 3,
    omega_max=(10.0,) * 3,
    thrust_max=40.0,
)


def course(*obstacles, gates=HERE):
    return Course("test", "", gates, Start((-5.0, 0.0, 10.0), 0.0), FAR, True, 1, (), "", obstacles)


def referee(*obstacles, penalties=False, **options):
    return Referee(course(*obstacles, **options), R, 9, 1e3, penalties)


def test_a_hit_of_an_obstacle_ends_the_flight_and_names_it():
    judge = referee(POLE, WALL)
    (event,) = fly(judge, straight((2.0, -3.0, 10.0), (3.0, 3.0, 10.0)))
    assert (event.kind, event.gate, event.obstacle, event.place) == ("hit", 0, 2, "obstacle 2")
    assert (judge.outcome, event.position[1]) == ("crashed", pytest.approx(0.185, abs=0.01))
    assert event.record()["obstacle"] == 2


def test_between_obstacles_nothing_happens():
    judge = referee(Cylinder((-1.0, 0.3, 9.0), 0.1, 2.0), Cylinder((-1.0, -0.3, 9.0), 0.1, 2.0))
    (event,) = fly(judge, straight((-2.0, 0.0, 10.0), (2.0, 0.0, 10.0)))
    assert (event.kind, event.place, judge.outcome) == ("pass", "gate 1", None)
    assert event.record()["obstacle"] == 0


def test_in_the_timed_mode_a_hit_costs_its_seconds_once():
    judge = referee(POLE, penalties=True)
    events = fly(judge, straight((-3.0, 0.0, 10.0), (2.0, 0.0, 10.0)))
    assert [e.kind for e in events] == ["hit", "pass"]
    assert lap_penalties(events, 1) == [3.0]


def test_a_contact_that_the_plant_alone_sees_is_put_on_record():
    judge = referee(POLE)
    (event,) = fly(
        judge, straight((2.0, 0.0, 12.0), (3.0, 0.0, 12.0), speed=9.0), contacts=("obstacle 1",)
    )
    assert (event.kind, event.place) == ("unseen_contact", "obstacle 1")


def test_our_rigid_body_reports_an_obstacle_and_stands_clear_of_it_at_the_start():
    body = RigidBody(course(POLE, WALL), PROBE, DT)
    body.place((-2.0, 0.0, 10.0), (1.0, 0.0, 0.0, 0.0), v=(2.0 / DT, 0.0, 0.0))
    body.step()
    assert body.contacts() == ("obstacle 1",)
    with closing(RigidPlant(course(POLE, WALL), PROBE, DT)) as plant:
        assert plant.state.contacts == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    "obstacle", [POLE, WALL, Cylinder((-1.0, 0.0, 9.0), 0.015, 1.55)], ids=["drum", "box", "pole"]
)
def test_every_contact_that_pybullet_sees_is_a_hit_and_hits_are_near(obstacle):
    pytest.importorskip("pybullet", reason=NO_BULLET)
    from quadsim.physics.world import BulletWorld

    rng, outcomes = np.random.default_rng(5), []
    with closing(BulletWorld(course(obstacle, gates=AWAY), PROBE, DT)) as world:
        for _ in range(50):
            aim = np.array(obstacle.centre) + rng.uniform(-0.5, 0.5, 3) * np.ptp(
                obstacle.corners(), axis=0
            )
            way = rng.normal(size=3) * (1.0, 1.0, 0.3)
            v = rng.uniform(1.0, 20.0) * way / np.linalg.norm(way)
            p0 = tuple((aim - 1.8 * v / np.linalg.norm(v) + rng.uniform(-0.2, 0.2, 3)).tolist())
            outcomes.append(passed_by(world, obstacle, p0, v))
    assert all(hit for hit, touched, _ in outcomes if touched)
    assert sum(touched for _, touched, _ in outcomes) > 20
    assert all(nearest < 1.74 * R for hit, touched, nearest in outcomes if hit and not touched)


def passed_by(world, obstacle, p0, v):
    """Return whether the referee called a hit, whether PyBullet touched, and the least distance.

    The distance is that to the obstacle's surface [m].
    """
    judge, nearest = referee(obstacle, gates=AWAY), np.inf
    world.place(p0, (1.0, 0.0, 0.0, 0.0), tuple(v.tolist()))
    points = [p0]
    for _ in range(int(3.6 / (np.linalg.norm(v) * DT))):
        world.apply((0.0, 0.0, GRAVITY * PROBE.mass), (0.0, 0.0, 0.0))
        world.step()
        points.append(world.read()[0])
        nearest = min(nearest, obstacle.distance(points[-1]))
        if touched := world.contacts():
            break
    for k, (a, b) in enumerate(pairwise(points)):
        judge.observe(k * DT, a, (k + 1) * DT, b, touched if b is points[-1] else ())
    assert touched in ((), ("obstacle 1",))
    assert not any(e.kind == "unseen_contact" for e in judge.events)
    return any(e.kind == "hit" for e in judge.events), bool(touched), nearest
