"""Courses changed in Python and written as YAML: checked as files are, and read back equal."""

from dataclasses import fields, replace
from math import radians

import numpy as np
import pytest

import quadsim
from quadsim.course import Box, Cylinder, Gate, Start, course_names, load_course, parse_course
from quadsim.course.course import CourseChanges, in_degrees
from quadsim.course.course_file import CourseFile
from quadsim.course.random_courses import random_courses
from quadsim.files.values import SettingError

FIGURE8 = load_course("figure8")
COURSES = [*map(load_course, course_names()), *random_courses(3, seed=5)]


def test_a_course_written_as_yaml_reads_back_equal(tmp_path):
    for course in COURSES:
        assert course.to_yaml() == course.text, "with its comments"
        course.to_yaml(tmp_path / f"{course.name}.yaml")
        assert load_course(tmp_path / f"{course.name}.yaml") == course


def test_a_course_made_anew_of_its_entries_is_equal_but_for_its_text():
    for course in COURSES:
        again = course.but()
        assert replace(again, text=course.text) == course
        assert parse_course(again.to_yaml(), again.name) == again
        # A course without a text that describes it is written out too
        assert replace(course, text="").to_yaml() == again.text


def test_an_angle_from_degrees_is_written_as_these_degrees():
    rng = np.random.default_rng(0)
    for _ in range(100):
        for digits in (0, 1, 3, 12):
            angle = round(rng.uniform(-360, 360), digits)
            assert radians(in_degrees(radians(angle))) == radians(angle)
            assert len(str(in_degrees(radians(angle)))) <= len(str(angle))
        free = rng.uniform(-6, 6)
        assert radians(in_degrees(free)) == pytest.approx(free, rel=4e-16)


def test_gates_obstacles_and_start_are_objects_or_entries():
    first, *others = FIGURE8.gates
    moved = replace(first, position=(1.0, 0.5, 2.5), yaw=first.yaw + 0.1)
    course = FIGURE8.but(
        name="moved",
        gates=[moved, *others],
        start={"yaw_deg": 10},
        obstacles=[
            Cylinder((0.0, 9.0, 0.0), 0.1, 3.0),
            Box((0.0, -9.0, 1.0), (0.5, 0.5, 2.0), 0.5),
            {"cylinder": {"base": [3, 9, 0], "radius": 0.2, "height": 2}},
        ],
    )
    assert course.gates[1:] == FIGURE8.gates[1:]
    assert course.gates[0].yaw == pytest.approx(moved.yaw, rel=4e-16)
    assert course.gates[0].position == moved.position
    assert course.start == Start(FIGURE8.start.position, radians(10))
    assert [type(obstacle) for obstacle in course.obstacles] == [Cylinder, Box, Cylinder]
    assert parse_course(course.text, "moved") == course
    # Described by its text, so that a run can be flown again from its record alone
    spec = quadsim.Spec.of(course)
    assert spec.record()["own"] == {}


def test_a_gate_of_another_size_keeps_it_and_the_others_follow_the_course():
    small = replace(FIGURE8.gates[0], opening=(1.0, 1.2))
    mixed = FIGURE8.but(gates=[small, *FIGURE8.gates[1:]])
    wide = mixed.but(opening=(2.0, 2.0))
    assert wide.gates[0].opening == (1.0, 1.2)
    assert {gate.opening for gate in wide.gates[1:]} == {(2.0, 2.0)}


def test_default_bounds_follow_the_gates_and_given_ones_stay():
    # without the bounds that its file gives
    free = FIGURE8.but(bounds=None)
    far = replace(free.gates[0], position=(0.0, 30.0, 2.0))
    assert free.but(gates=[far, *free.gates[1:]]).bounds[1][1] > 40.0
    with pytest.raises(SettingError, match=r"^gates\[0\]\.position: .*bounds"):
        FIGURE8.but(gates=[far, *free.gates[1:]])


def test_published_times_are_those_of_the_gates():
    course = load_course("split_s_swift")
    assert course.published
    assert course.but(laps=1).published == course.published
    assert course.but(opening=(2.0, 2.0)).published == ()


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"laps": 0}, "laps: expected a whole number >= 1"),
        ({"lapz": 1}, "lapz: unknown key, did you mean 'laps'"),
        ({"gates": []}, "gates: expected 1 or more"),
        ({"gates": 3}, "gates: expected"),
        ({"gates": [3]}, r"gates\[0\]: expected a mapping"),
        ({"gates": [{"position": [0, 0, 2]}]}, r"gates\[0\]\.yaw_deg: missing"),
        (
            {"gates": [{"position": [0, 0, 2], "yaw": 0}]},
            r"gates\[0\]\.yaw: unknown key, did you mean 'yaw_deg' \(in degrees\)\?",
        ),
        ({"start": {"yaw_deg": 400}}, r"start\.yaw_deg: expected a number \[deg\]"),
        ({"name": "a b"}, "name: expected text like"),
        ({"obstacles": [Gate]}, "obstacles: expected"),
    ],
)
def test_a_change_that_cannot_be_used_is_one_line_with_its_key(changes, problem):
    with pytest.raises(SettingError, match=f"^{problem}") as caught:
        FIGURE8.but(**changes)
    assert "\n" not in str(caught.value)


def test_the_keywords_of_a_change_are_the_keys_of_a_file():
    assert CourseChanges.__optional_keys__ == {f.name for f in fields(CourseFile)}
