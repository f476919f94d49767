"""Domain randomization: a seed is one disturbance for every planner, size 0 is no change, the laws
hold."""

from contextlib import closing
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from quadsim.config.build import build
from quadsim.config.build_plant import plant_of
from quadsim.config.spec import Spec
from quadsim.course import load_course, parse_course
from quadsim.course.checks import misplaced_gates, start_problems
from quadsim.dynamics.quadrotor import ModelParams
from quadsim.files.values import SettingError
from quadsim.physics.domain_randomization import (
    Displacement,
    Randomization,
    displaced,
    draw,
    gusts,
)
from quadsim.physics.plant import PLANTS, default_plant
from quadsim.physics.randomization_file import VEHICLE, load_randomization
from quadsim.streams import quadrotor_streams
from quadsim.vehicle import GRAVITY, Uncertainty, load_vehicle, with_thrust_to_weight
from tests.small import SMALL

HOVER = (0.0, 0.0, 0.0, GRAVITY)


def spec(**settings):
    return Spec.of(**SMALL, **settings)


def drift(one):
    """States of the plant that a spec describes, hovering for .1 s."""
    with closing(plant_of(one)) as plant:
        return np.array([plant.step(HOVER).x for _ in range(40)])


def test_same_seed_is_the_same_disturbance_for_every_planner():
    a, b = (spec(sampler=s, randomize=1.0, seed=7) for s in ("gaussian", "colored"))
    assert a.record()["variation"] == b.record()["variation"]
    assert np.array_equal(drift(a), drift(b))
    assert not np.array_equal(drift(a), drift(replace(a, seed=8))), (
        "another seed draws other numbers"
    )


def test_size_zero_is_the_plant_as_it_was():
    one = spec(seed=3)
    plant = PLANTS[default_plant()](one.course, one.vehicle, one.plant_dt)
    assert np.array_equal(drift(one), [plant.step(HOVER).x for _ in range(40)])


@pytest.mark.compiled
def test_randomization_changes_neither_the_planners_samples_nor_its_nominal_model():
    calm, rough = spec(randomize=0.0), spec(randomize=2.0)
    z = []
    for one in (calm, rough):
        parts = build(one)
        z.append(parts.controller.planner.sampler.sample(1).copy())
        parts.plant.close()
    assert np.array_equal(*z)
    assert rough.model == ModelParams.of(rough.vehicle) == ModelParams.of(load_vehicle("swift"))


def test_randomization_is_in_proportion_to_its_size():
    one, two = (draw(quadrotor_streams(5).vehicle, size) for size in (1.0, 2.0))
    assert two.offset == pytest.approx([2 * x for x in one.offset])
    assert (two.mass, two.drag, two.gust) == pytest.approx(
        (2 * one.mass, 2 * one.drag, 2 * one.gust)
    )
    drawn = [draw(quadrotor_streams(seed).vehicle, 1.0) for seed in range(200)]
    assert max(abs(d.mass) for d in drawn) <= 0.05 < 1.1 * max(abs(d.mass) for d in drawn), (
        "uniform up to 5 %"
    )
    assert abs(np.corrcoef([d.mass for d in drawn], [d.thrust for d in drawn])[0, 1]) < 0.2, (
        "drawn independently"
    )


@pytest.mark.slow
@pytest.mark.parametrize("dt", [0.0025, 0.02])
def test_gusts_have_their_deviation_and_correlation_time_for_any_step(dt):
    w = np.array(list(islice(gusts(np.random.SeedSequence(1), 0.5, dt), int(1000 / dt))))
    # 1000 s hold about 1000 independent gusts an axis
    assert w.std() == pytest.approx(0.5, rel=0.05)
    lag = round(VEHICLE.gust_tau / dt)
    assert np.mean(w[lag:] * w[:-lag]) / w.var() == pytest.approx(np.exp(-1), abs=0.08)


def test_a_heavier_body_sinks_under_the_nominal_hover_command():
    vehicle, course = load_vehicle("paper"), load_course("paper_flat")
    plant = PLANTS[default_plant()](course, vehicle, body=Randomization(mass=0.05).body(vehicle))
    for _ in range(400):
        state = plant.step(HOVER)
    assert state.x.vz == pytest.approx(GRAVITY / 1.05 - GRAVITY, rel=1e-3), (
        "1 s of the missing 5 % [m/s]"
    )


@pytest.mark.parametrize("name", ["swift", "flightmare", "paper"])
def test_thrust_to_weight_scales_map_and_limit_alike(name):
    v = with_thrust_to_weight(load_vehicle(name), 3.3)
    assert v.thrust_max == pytest.approx(3.3 * GRAVITY)
    assert v.name == f"{name}-twr3.3"
    if v.rotors:
        assert 4 * v.rotors.thrust(v.rotors.motor_omega_max) / v.mass == pytest.approx(v.thrust_max)


BESIDE_A_FRAME = """
opening: [1.6, 1.6]
start: {position: [-0.35, 0.9, 1.5], yaw_deg: 0}
gates:
  - {position: [0, 0, 1.5], yaw_deg: 0}
  - {position: [8, 0, 1.5], yaw_deg: 0}
"""


def test_a_start_without_room_is_drawn_again_and_every_other_one_stays():
    course = parse_course(BESIDE_A_FRAME, "beside")
    drawn_again = 0
    for seed in range(60):
        seeds = quadrotor_streams(seed).vehicle
        free, kept = draw(seeds, 1.0), draw(seeds, 1.0, course)
        assert not list(start_problems(course, kept.start(course.start).position))
        blocked = bool(list(start_problems(course, free.start(course.start).position)))
        assert (kept.offset != free.offset) == blocked
        assert replace(kept, offset=free.offset) == free
        drawn_again += blocked
    assert drawn_again >= 6  # the check can fail


def test_a_start_that_cannot_have_room_is_one_line():
    course = parse_course(BESIDE_A_FRAME, "beside")
    walls = tuple(replace(gate, position=course.start.position) for gate in course.gates)
    narrow = replace(course, gates=tuple(replace(w, opening=(0.2, 0.2)) for w in walls))
    with pytest.raises(SettingError, match=r"^randomize: expected room .* of 100 starts") as error:
        draw(quadrotor_streams(0).vehicle, 1e-3, narrow)
    assert "\n" not in str(error.value)


def test_displaced_gates_stand_where_a_course_file_may_have_them():
    course = load_course("lsy_level2")
    drawn_again = 0
    for seed in range(40):
        seeds = quadrotor_streams(seed).gates
        assert not misplaced_gates(displaced(course, seeds, Displacement(1.0)))
        distinct = tuple(dict.fromkeys(course.gates))
        moves = np.random.default_rng(seeds).uniform(-1, 1, (len(distinct), 2))
        first = dict(zip(distinct, moves, strict=True))
        moved = displaced(course, seeds, Displacement(1.0))
        same = [
            np.array_equal(now.position[:2], np.array(gate.position[:2]) + first[gate])
            for gate, now in zip(course.gates, moved.gates, strict=True)
        ]
        drawn_again += not all(same)
    assert 5 <= drawn_again < 40


def test_gates_without_a_place_are_one_line():
    with pytest.raises(SettingError, match=r"^displace_gates: expected a place for gate \d"):
        displaced(load_course("lsy_level2"), quadrotor_streams(0).gates, Displacement(1000.0))


def test_a_vehicle_whose_uncertainty_is_known_is_drawn_from_it():
    known = Uncertainty(mass=0.01, thrust=0.02, rate_lag=0.03, motor_lag=0.04, drag=0.05)
    vehicle = replace(load_vehicle("swift"), uncertainty=known)
    names = ("mass", "thrust", "rate_lag", "motor_lag", "drag")
    streams = [quadrotor_streams(seed).vehicle for seed in range(400)]
    drawn = np.array([[getattr(draw(s, 1.0, vehicle=vehicle), n) for n in names] for s in streams])
    stds = [getattr(known, name) for name in names]
    assert drawn.std(axis=0) == pytest.approx(stds, rel=0.1)
    # The control: without it, the same seeds draw from the tolerances of any vehicle.
    usual = np.array([draw(s, 1.0).mass for s in streams])
    assert usual.std() > 2.0 * known.mass
    assert np.corrcoef(usual, drawn[:, 0])[0, 1] == pytest.approx(1.0)
    # Another randomization counts before the vehicle's own uncertainty.
    level = load_randomization("lsy_level2")
    of_level = [draw(s, 1.0, ranges=level, vehicle=vehicle).mass for s in streams[:9]]
    assert of_level == [draw(s, 1.0, ranges=level).mass for s in streams[:9]]


def test_a_map_that_is_too_small_has_every_gate_too_near_to_the_start():
    """A map of 0.93 of the course's size, and the gates where they stand."""
    spec = Spec.of("lsy_level2", map_scale=0.93, plant="rigid")
    start = np.array(spec.course.start.position)
    for mapped, stands in zip(spec.course.gates, spec.flown_course.gates, strict=True):
        apart = np.array(mapped.position) - start
        assert apart[:2] == pytest.approx(0.93 * (np.array(stands.position) - start)[:2])
        assert (stands.position[2], stands.opening) == (mapped.position[2], mapped.opening)
    pairs = zip(spec.course.obstacles, spec.flown_course.obstacles, strict=True)
    for mapped, stands in pairs:
        apart = np.array(mapped.base) - start
        assert apart[:2] == pytest.approx(0.93 * (np.array(stands.base) - start)[:2])
    # displaced gates are displaced from there
    both = spec.but(displace_gates=0.1)
    for stands, moved in zip(spec.flown_course.gates, both.flown_course.gates, strict=True):
        off = np.array(moved.position) - np.array(stands.position)
        assert abs(off).max() <= 0.1
