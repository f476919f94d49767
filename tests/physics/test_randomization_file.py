"""Randomizations: what a file lists is drawn as widely as it says, and nothing else is."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from quadsim.config.spec import Spec
from quadsim.course import load_course
from quadsim.course.frames import same_frame
from quadsim.dynamics.quadrotor import Control
from quadsim.files.strict_yaml import FileError
from quadsim.files.values import SettingError
from quadsim.physics.domain_randomization import Displacement, Randomization, displaced, forces
from quadsim.physics.link import CommandNoise
from quadsim.physics.randomization_file import (
    OUTDOOR,
    RandomizationRanges,
    load_randomization,
    parse_randomization,
    randomization_names,
)
from quadsim.streams import quadrotor_streams

SEEDS = 80
LEVEL2 = load_randomization("lsy_level2")


def drawn(ranges, seeds=SEEDS):
    """Return the specs of many seeds under a randomization, on a course with room."""
    base = Spec.of("lsy_level2", vehicle="cf21b_500", randomization=ranges, randomize=1.0)
    return [replace(base, seed=seed) for seed in range(seeds)]


def places(rows, attribute):
    """Return the positions of gates or the bases of poles  (courses, items, 3)."""
    return np.array([[getattr(item, attribute) for item in items] for items in rows])


def test_every_randomization_has_a_source_and_a_name_of_its_own():
    for name in randomization_names():
        ranges = load_randomization(name)
        assert ranges.name == name
        assert ranges.source or ranges == OUTDOOR


def test_what_is_left_out_is_not_drawn():
    (spec,) = drawn(RandomizationRanges(mass=0.1), seeds=1)
    varied = spec.variation
    assert varied.mass != 0.0
    assert replace(varied, mass=0.0) == Randomization()
    assert spec.flown_course == spec.course


@pytest.mark.slow
def test_gates_poles_and_vehicle_are_drawn_as_widely_as_the_file_says():
    specs = drawn(LEVEL2)
    bare = specs[0].course
    flown = [spec.flown_course for spec in specs]
    moves = places([c.gates for c in flown], "position") - places([bare.gates], "position")
    poles = places([c.obstacles for c in flown], "base") - places([bare.obstacles], "base")
    yaws = np.array([[gate.yaw for gate in course.gates] for course in flown])
    turns = yaws - [gate.yaw for gate in bare.gates]
    turns = np.arctan2(np.sin(turns), np.cos(turns))
    masses = np.array([spec.variation.mass * spec.vehicle.mass for spec in specs])
    inertia = np.array([spec.variation.inertia for spec in specs]) * specs[0].vehicle.inertia
    for found, width in (
        (moves[..., :2], 0.15),
        (moves[..., 2], 0.1),
        (poles[..., :2], 0.15),
        (poles[..., 2], 0.05),
        (turns, 0.2),
        (masses, 0.005),
        (inertia, 1e-6),
    ):
        assert 0.93 * width < np.abs(found).max() < 1.01 * width
        # uniform, and the negative control: a normal distribution of this width has half of it
        assert np.std(found) == pytest.approx(width / np.sqrt(3), rel=0.2)
    assert abs(np.corrcoef(masses, inertia[:, 0])[0, 1]) < 0.25, "each by itself"


def test_places_along_x_and_y_are_the_same_without_heights_and_turns():
    course = load_course("split_s_swift")
    seeds = quadrotor_streams(5).gates
    flat = displaced(course, seeds, Displacement(0.15))
    all_ways = displaced(course, seeds, Displacement(0.15, height=0.1, turn=(0.1, 0.1, 0.1)))
    for a, b in zip(flat.gates, all_ways.gates, strict=True):
        assert a.position[:2] == b.position[:2]
        assert a.position[2] != b.position[2]
        assert a.yaw != b.yaw


def test_a_frame_that_is_flown_from_both_sides_is_turned_once():
    course = load_course("split_s_swift")
    both = course.but(loop=False, laps=1, order=[1, 2, -1, -2])
    first, second, back, second_back = displaced(
        both, quadrotor_streams(1).gates, Displacement(0.3, height=0.2, turn=(0.2, 0.3, 0.4))
    ).gates
    assert same_frame(first, back)
    assert same_frame(second, second_back)
    assert not same_frame(first, course.gates[0])
    np.testing.assert_allclose(first.axes[0], np.negative(back.axes[0]), atol=1e-9)


def test_a_force_is_uniform_and_forgotten_from_step_to_step():
    a = np.array(list(islice(forces(np.random.SeedSequence(1), 0.1, 0.05), 20_000)))
    assert np.abs(a).max() == pytest.approx(2.0, rel=0.01)  # 0.1 N on 50 g [m/s^2]
    assert a.std() == pytest.approx(2.0 / np.sqrt(3), rel=0.02)
    assert abs(np.mean(a[1:] * a[:-1])) / a.var() < 0.02


def test_the_noise_of_a_command_is_held_for_a_control_period():
    noise = CommandNoise((0.1, 0.2, 0.0, 0.4), steps=10, stream=np.random.SeedSequence(2))
    command = Control(1.0, 2.0, 3.0, 9.81)
    rows = np.array([noise.added(command) for _ in range(8000)]) - command
    periods = rows.reshape(-1, 10, 4)
    assert (periods == periods[:, :1]).all()
    np.testing.assert_allclose(periods[:, 0].std(axis=0), (0.1, 0.2, 0.0, 0.4), rtol=0.1)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("mass: 5", "mine.yaml:1:7: mass: expected"),
        ("gates_turn: [1, 2, 3]", "mine.yaml:1:1: gates_turn: "),
        ("command_noise: [0, 0, 0]", "mine.yaml:1:16: command_noise: expected"),
    ],
)
def test_a_fault_of_a_file_is_one_line_with_its_place(text, expected):
    with pytest.raises(FileError) as caught:
        parse_randomization(text, "mine.yaml")
    assert str(caught.value).startswith(expected)


def test_an_object_is_checked_as_a_file_is():
    with pytest.raises(SettingError, match=r"^randomization: mass: expected"):
        Spec.of("figure8", randomization=RandomizationRanges(mass=5.0))
