"""The referee against PyBullet's contacts: straight passes at and around a turned gate's frame, at
1 to 30 m/s.

Measured over 6 400 such passes: PyBullet never touched a bar, nor changed the velocity, without a
HIT. HITs that PyBullet let pass were from 64 mm outside the bars' true shape (at edges, where boxes
grown by r stick out) to 1.4 mm inside it (a sphere sampled every v dt cuts across an edge).
"""

from contextlib import closing
from dataclasses import dataclass
from math import exp, log, sqrt

import numpy as np
import pytest
from plant_cases import NO_BULLET
from referee_cases import DT, HALF, WIDTH, R, course, gate

from quadsim.racing.referee import Referee
from quadsim.vehicle import GRAVITY, Vehicle

pytest.importorskip("pybullet", reason=NO_BULLET)
from quadsim.physics.world import BulletWorld

GATE = gate((0.0, 0.0, 10.0), yaw=0.7, pitch=-0.4, roll=0.2)
PROBE = Vehicle(
    name="probe",
    mass=1.0,
    inertia=(1e-3,) * 3,
    radius=R,
    rate_tau=(0.05,) * 3,
    omega_max=(10.0,) * 3,
    thrust_max=40.0,
)
HOVER = (0.0, 0.0, GRAVITY * PROBE.mass)  # the probe never turns before it touches, so this is up
CORNER = (sqrt(3) - 1) * R  # by which a grown box's corner sticks out of a sphere [m]
# Half length of a pass [m]: at its ends it is clear of the frame, which it crosses at up to 45
# degrees.
NEAR = 0.5


@dataclass(frozen=True)
class Pass:
    start: np.ndarray  # gate frame [m]  (3,)
    velocity: np.ndarray  # gate frame [m/s]  (3,)

    @property
    def speed(self):
        return float(np.linalg.norm(self.velocity))

    @property
    def depth(self):
        """Return how far the free flight would bring the sphere into a bar's true shape [m].

        It is negative outside.
        """
        s = np.linspace(0.0, 2 * NEAR / self.speed, 4001)[:, None]
        p = self.start + s * self.velocity  # (4001, 3)
        gaps = [np.maximum(np.abs(p - np.array(c)) - np.array(h), 0.0) for c, h in GATE.bars]
        return R - min(float(np.sqrt((g**2).sum(axis=1)).min()) for g in gaps)

    @property
    def unsure(self):
        """Depth that may fall between two samples v dt apart: the sagitta of the sphere, and 1 mm
        [m]."""
        return (self.speed * DT) ** 2 / (8 * R) + 1e-3


def random_pass(rng):
    """Aimed at or just around the frame, from either side, more or less along the passage."""
    edge = np.array(HALF) + WIDTH + R + 0.05
    target = np.array([rng.uniform(-0.1, 0.1), *rng.uniform(-edge, edge)])
    way = np.array([rng.choice([-1.0, 1.0]), *rng.uniform(-0.7, 0.7, 2)])
    way /= np.linalg.norm(way)
    return Pass(target - NEAR * way, exp(rng.uniform(0.0, log(30.0))) * way)


def fly_pass(world, trial):
    """Return whether the referee called a HIT, and whether PyBullet touched.

    PyBullet touched if there was a contact, or if the velocity changed.
    """
    referee = Referee(course(GATE), R, laps=99, timeout=1e3, penalties=True)
    turn, v0 = GATE.rotation, GATE.rotation @ trial.velocity
    p0 = tuple((GATE.position + turn @ trial.start).tolist())
    world.place(p0, (1.0, 0.0, 0.0, 0.0), tuple(v0.tolist()))
    for k in range(int(2 * NEAR / (trial.speed * DT))):
        world.apply(HOVER, (0.0, 0.0, 0.0))
        world.step()
        p1, v, _, _ = world.read()
        referee.observe(k * DT, p0, (k + 1) * DT, p1, world.contacts())
        if world.contacts() or np.linalg.norm(v - v0) > 1e-3 * trial.speed:
            return {e.kind for e in referee.events}, True
        p0 = p1
    return {e.kind for e in referee.events}, False


@pytest.fixture(scope="module")
def trials():
    rng = np.random.default_rng(1)
    with closing(BulletWorld(course(GATE), PROBE, DT)) as world:
        return [
            (trial, *fly_pass(world, trial)) for trial in (random_pass(rng) for _ in range(250))
        ]


@pytest.mark.slow
def test_every_contact_that_pybullet_sees_is_a_hit(trials):
    touched = [kinds for _, kinds, touched in trials if touched]
    assert len(touched) > 100
    assert all("hit" in kinds for kinds in touched)
    assert not any("unseen_contact" in kinds for kinds in touched)


def test_every_hit_but_a_graze_is_a_contact_in_pybullet(trials):
    unseen = [trial for trial, kinds, touched in trials if "hit" in kinds and not touched]
    assert all(-CORNER <= trial.depth < trial.unsure for trial in unseen)


def test_clean_passes_stay_clean_in_pybullet(trials):
    """The control: without passes that touch nothing, a referee that always calls HIT would keep
    the first law."""
    clean = [trial for trial, kinds, touched in trials if "hit" not in kinds and not touched]
    assert len(clean) > 25
    assert all(trial.depth < 0.0 for trial in clean)


def test_disagreement_is_put_on_record():
    """The control: a referee that has the gate 3 m to the left records the contact that PyBullet
    reports."""
    wrong = gate((0.0, 3.0, 10.0))
    referee = Referee(course(wrong), R, laps=99, timeout=1e3, penalties=True)
    true = gate((0.0, 0.0, 10.0))
    with closing(BulletWorld(course(true), PROBE, DT)) as world:
        p0 = (-0.5, HALF[0] + WIDTH / 2, 10.0)
        world.place(p0, (1.0, 0.0, 0.0, 0.0), (5.0, 0.0, 0.0))
        for k in range(60):
            world.apply(HOVER, (0.0, 0.0, 0.0))
            world.step()
            p1 = world.read()[0]
            referee.observe(k * DT, p0, (k + 1) * DT, p1, world.contacts())
            p0 = p1
    assert [e.kind for e in referee.events] == ["unseen_contact"]
