"""Every random stream is derived in one place, by name, and gives the numbers that it has always
given."""

import ast
from hashlib import sha256
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from quadsim import Spec
from quadsim.course import load_course
from quadsim.course.random_courses import random_courses
from quadsim.learn.task import tables, task
from quadsim.render.frames import Pictures
from quadsim.render.poses import drawn_poses
from quadsim.sensing.camera import Camera
from quadsim.streams import (
    Streams,
    course_stream,
    double_integrator_streams,
    fault_stream,
    fresh_seed,
    look_streams,
    observation_noise_key,
    offroad_streams,
    pose_stream,
    quadrotor_streams,
    sensor_streams,
    start_stream,
    start_vehicle_streams,
    texture_stream,
    training_stream,
)

ROOT = Path(__file__).parent.parent
SEEDS = (0, 1, 7, 10**6, 2**40 + 3)
CAMERA = Camera(64, 48, 60.0, 60.0, 20.0)


def generated(stream):
    """Return the numbers by which a generator is seeded."""
    return stream.generate_state(8).tolist()


def assert_same(stream, before):
    """Claim that both streams seed the same generators, and that their children do."""
    assert generated(stream) == generated(before)
    np.testing.assert_array_equal(
        np.random.default_rng(stream).random(5),
        np.random.default_rng(before).random(5),
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_a_quadrotor_flies_with_the_streams_it_has_always_had(seed):
    planner, plant, sensors, gates, faults = np.random.SeedSequence(seed).spawn(5)
    vehicle, gusts = plant.spawn(2)
    streams = quadrotor_streams(seed)
    assert_same(streams.planner, planner)
    assert_same(streams.vehicle, vehicle)
    assert_same(streams.gusts, gusts)
    assert_same(streams.sensors, sensors)
    assert_same(streams.gates, gates)
    assert_same(streams.faults, faults)
    for k, before in enumerate(faults.spawn(3)):
        assert_same(fault_stream(streams.faults, k), before)


@pytest.mark.parametrize("seed", SEEDS)
def test_sensors_have_the_streams_they_have_always_had(seed):
    before = np.random.SeedSequence(seed).spawn(4)[2].spawn(4)
    streams = sensor_streams(quadrotor_streams(seed).sensors)
    assert_same(streams.imu, before[0])
    assert_same(streams.rotors, before[1])
    assert_same(streams.pose, before[2])
    assert_same(streams.camera, before[3])
    assert_same(streams.barometer, np.random.SeedSequence(seed, spawn_key=(2, 6)))


@pytest.mark.parametrize("seed", SEEDS)
def test_the_papers_systems_have_the_streams_they_have_always_had(seed):
    planner, disturbance, _ = np.random.SeedSequence(seed).spawn(3)
    assert_same(offroad_streams(seed).planner, planner)
    assert_same(offroad_streams(seed).gusts, disturbance)
    assert_same(double_integrator_streams(seed).planner, np.random.SeedSequence(seed))


@pytest.mark.parametrize("seed", SEEDS)
def test_environments_and_training_have_the_streams_they_have_always_had(seed):
    for k, before in enumerate(np.random.SeedSequence(seed).spawn(3)):
        starts = start_stream(seed, k)
        assert_same(starts, before)
        for row, vehicle in enumerate(before.spawn(4)):
            (alone,) = start_vehicle_streams(starts, row, racers=1)
            assert_same(alone, vehicle)
            together = start_vehicle_streams(starts, row, racers=3)
            for found, of_racer in zip(together, vehicle.spawn(3), strict=True):
                assert_same(found, of_racer)
    assert observation_noise_key(seed).tolist() == [seed & 0xFFFFFFFF, 0x0B5E]
    assert observation_noise_key(seed).dtype == np.uint32
    assert_same(training_stream(seed), np.random.SeedSequence([seed, 1]))


@pytest.mark.parametrize("seed", SEEDS)
def test_pictures_and_generated_courses_have_the_streams_they_have_always_had(seed):
    for i in (0, 5):
        before = np.random.default_rng((seed, i))
        np.testing.assert_array_equal(
            np.random.default_rng(pose_stream(seed, i)).random(5), before.random(5)
        )
        looks = np.random.default_rng((seed, (1 << 20) + i)).spawn(3)
        for stream, rng in zip(look_streams(seed, i), looks, strict=True):
            np.testing.assert_array_equal(np.random.default_rng(stream).random(5), rng.random(5))
    for number, before in enumerate(np.random.SeedSequence(seed).spawn(3), start=1):
        assert_same(course_stream(seed, number), before)
    assert_same(texture_stream(), np.random.SeedSequence(0))


def test_the_numbers_of_seed_0_are_those_of_earlier_versions():
    """Golden numbers, so that a change in how numpy derives streams is found too."""
    first = {
        name: stream.generate_state(2).tolist()
        for name, stream in quadrotor_streams(0)._asdict().items()
    }
    assert first == {
        "planner": [3757552657, 2018376492],
        "vehicle": [3953331965, 2686814951],
        "gusts": [3613627650, 618621610],
        "sensors": [3241444873, 3830689794],
        "gates": [3685993406, 3082302701],
        "faults": [1216546553, 3895736788],
        "link": [2078861726, 3295290883],
    }
    assert offroad_streams(0).gusts.generate_state(2).tolist() == [673228719, 1136656250]
    assert double_integrator_streams(0).planner.generate_state(2).tolist() == [
        2968811710,
        3677149159,
    ]


def test_what_is_drawn_from_streams_is_what_earlier_versions_drew():
    """Golden numbers of starts, poses, looks and generated courses."""
    starts = tables(task(start="anywhere", randomize=1.0), 5).starts[-1, -1, :4]
    np.testing.assert_allclose(starts, [0.32942933, 5.00536871, 1.36685311, -1.68084145], rtol=1e-6)
    course = load_course("split_s_swift")
    pose = drawn_poses(course, CAMERA, 4, 5)[3]
    np.testing.assert_allclose(pose.p, [-4.15354248, -5.11554258, 1.66454520], rtol=1e-7)
    look = Pictures("split_s_swift", course.text, CAMERA, 5, ("textures", "light"), "drawn").look(3)
    assert look.ground.texture == 19
    assert look.light.ambient == pytest.approx(0.28342326570537724)
    digests = [sha256(made.text.encode()).hexdigest()[:16] for made in random_courses(3, 7)]
    assert digests == ["6b362820ce62af99", "f33213e2417a526a", "38fe59a6c008dd22"]


FAMILIES = {
    "quadrotor": quadrotor_streams,
    "offroad": offroad_streams,
    "double_integrator": double_integrator_streams,
}


@pytest.mark.parametrize("name", FAMILIES)
def test_streams_of_one_seed_are_objects_of_their_own_with_keys_of_their_own(name):
    streams = FAMILIES[name](3)
    assert isinstance(streams, Streams)
    every = [*streams, *sensor_streams(streams.sensors)]
    for one, other in combinations(every, 2):
        assert one is not other
        assert (one.entropy, one.spawn_key) != (other.entropy, other.spawn_key)
        assert generated(one) != generated(other)


def test_streams_of_two_seeds_and_of_two_pictures_differ():
    for one, other in zip(quadrotor_streams(3), quadrotor_streams(4), strict=True):
        assert generated(one) != generated(other)
    of_pictures = [*look_streams(0, 0), *look_streams(0, 1), pose_stream(0, 0), pose_stream(0, 1)]
    for one, other in combinations(of_pictures, 2):
        assert generated(one) != generated(other)
    assert fresh_seed() != fresh_seed()


def test_drawing_from_a_stream_or_appending_one_changes_no_other():
    """A derived stream depends on the seed and its key alone, not on earlier streams or draws."""
    untouched = quadrotor_streams(3)
    streams = quadrotor_streams(3)
    np.random.default_rng(streams.planner).random(1000)
    streams.vehicle.spawn(10)
    sensor_streams(streams.sensors)
    for one, other in zip(streams, untouched, strict=True):
        assert generated(one) == generated(other)
    again = sensor_streams(streams.sensors)
    for one, other in zip(again, sensor_streams(untouched.sensors), strict=True):
        assert generated(one) == generated(other)
    # an eighth stream of a flight would have the next key, as if one more had been spawned
    appended = np.random.SeedSequence(3).spawn(7)
    assert generated(streams.gates) == generated(appended[3])
    assert generated(appended[6]) not in [generated(stream) for stream in streams]


def test_a_spec_has_the_streams_of_its_seed_anew_at_each_access():
    spec = Spec.of("split_s_swift", seed=3)
    assert [generated(s) for s in spec.streams] == [generated(s) for s in quadrotor_streams(3)]
    spec.streams.sensors.spawn(3)
    assert spec.streams.sensors.n_children_spawned == 0


DERIVE = ("SeedSequence", "spawn")


def derivations(text):
    """Return the lines that derive a stream, by SeedSequence(...) or spawn(...)."""
    found = []
    if not any(name in text for name in DERIVE):
        return found  # Most files need not be parsed.
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call):
            called = node.func
            name = called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")
            if name in DERIVE:
                found.append(node.lineno)
    return found


def test_streams_are_derived_in_one_place():
    # A planner that is used alone is given a plain seed, of which it is the only user; a sampler of
    # the user's own gets a generator from the key that the planner draws for it.
    allowed = {
        "quadsim/streams.py",
        "controllers/samplers/lane_sampler.py",
        "controllers/samplers/plain.py",
    }
    files = [
        path
        for package in ("quadsim", "controllers", "web")
        for path in (ROOT / package).rglob("*.py")
    ]
    found = {
        str(path.relative_to(ROOT))
        for path in files
        if derivations(path.read_text(encoding="utf-8"))
    }
    assert found == allowed
