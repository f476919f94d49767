"""Obstacles of a course: what a file may say, how far away they are, when a moving sphere touches
them."""

from dataclasses import asdict, replace
from itertools import product
from math import radians

import numpy as np
import pytest

from quadsim.course import Box, Cylinder, load_course, parse_course
from quadsim.course.swept_obstacles import SweptObstacle, SweptObstacles
from quadsim.files.strict_yaml import FileError
from quadsim.limit.limits import SOLUTIONS, LimitProblem, load
from quadsim.vehicle import load_vehicle

PLAIN = """\
opening: [1.6, 1.6]
start: {position: [-5, 0, 2], yaw_deg: 0}
gates:
  - {position: [0, 0, 2], yaw_deg: 0}
  - {position: [8, 4, 3], yaw_deg: 90}
"""
GOOD = (
    PLAIN
    + """\
obstacles:
  - cylinder: {base: [4, 2, 0], radius: 0.5, height: 5}
  - box: {centre: [-2, 3, 1], size: [2, 1, 2], yaw_deg: 30}
"""
)
BAD = [
    (
        "radius: 0.5",
        "radius: 0",
        "7:41: obstacles[0].cylinder.radius: expected",
    ),
    (", height: 5", "", "7:15: obstacles[0].cylinder.height: missing"),
    (
        "size: [2, 1, 2]",
        "size: [2, 1]",
        "8:37: obstacles[1].box.size: expected",
    ),
    ("yaw_deg: 30", "yaw: 30", "8:48: obstacles[1].box.yaw: unknown key"),
    ("  - box", "    box", "7:5: obstacles[0]: expected"),
    (
        "cylinder: {base: [4, 2, 0], radius: 0.5, height: 5}",
        "{}",
        "7:5: obstacles[0]: expected",
    ),
    ("cylinder", "pole", "7:5: obstacles[0].pole: unknown key"),
    (
        "[4, 2, 0]",
        "[4, 2, -9]",
        "7:5: obstacles[0]: expected",
    ),
    (
        "[-2, 3, 1]",
        "[-5, 0.6, 2]",
        "2:19: start.position: expected",
    ),
    (
        "[4, 2, 0], radius: 0.5",
        "[0.1, 0, 0], radius: 1",
        "4:5: gates[0]: expected",
    ),
]


def test_each_fault_of_an_obstacle_is_one_line_with_its_place_and_key():
    for old, new, message in BAD:
        assert old in GOOD
        with pytest.raises(FileError) as error:
            parse_course(GOOD.replace(old, new, 1), "mine.yaml")
        assert str(error.value).startswith(f"mine.yaml:{message}")
        assert "\n" not in str(error.value)


def test_an_obstacle_outside_the_bounds_is_an_error():
    with pytest.raises(FileError, match=r"obstacles\[1\]: outside the bounds, expected y"):
        parse_course(
            GOOD.replace("opening", "bounds: [[-9, 9], [-9, 1.9], [0, 9]]\nopening", 1).replace(
                "[8, 4", "[8, 1"
            ),
            "x",
        )


def test_a_course_keeps_its_obstacles_and_shows_them():
    course = parse_course(GOOD, "mine.yaml")
    assert course.obstacles == (
        Cylinder((4.0, 2.0, 0.0), 0.5, 5.0),
        Box((-2.0, 3.0, 1.0), (2.0, 1.0, 2.0), radians(30)),
    )
    assert len(course.points()) == len(parse_course(PLAIN, "mine.yaml").points()) + 16
    assert len(course.points(frames=False)) == 3


def test_a_thin_pole_in_an_opening_does_not_block_it():
    text = GOOD.replace("[4, 2, 0], radius: 0.5", "[0.1, 0, 0], radius: 0.1")
    assert len(parse_course(text, "mine.yaml").obstacles) == 2


def test_obstacles_change_the_key_of_a_race_and_none_leave_it_as_it_was():
    course, vehicle = (
        parse_course(GOOD.replace("height: 5", "height: 3"), "mine.yaml"),
        load_vehicle("swift"),
    )
    bare = LimitProblem(replace(course, obstacles=()), vehicle, 1, "rotors").key
    assert bare == LimitProblem(parse_course(PLAIN, "mine.yaml"), vehicle, 1, "rotors").key
    assert LimitProblem(course, vehicle, 1, "rotors").key != bare
    # stored before courses had obstacles
    for path in SOLUTIONS.glob("split_s_swift_swift_*_rotors_*.npz"):
        limit = load(path)
        assert (
            path.name
            == LimitProblem(load_course("split_s_swift"), vehicle, limit.laps, "rotors").file_name
        )


OBSTACLES = Cylinder((1.0, -2.0, 0.5), 0.7, 1.6), Box((1.0, -2.0, 1.3), (1.4, 0.6, 1.0), 0.6)


@pytest.mark.parametrize("obstacle", OBSTACLES, ids=["cylinder", "box"])
def test_distance_to_an_obstacle_is_that_to_the_nearest_of_its_points(obstacle):
    rng = np.random.default_rng(0)
    cloud = rng.uniform(-1.2, 1.2, (8_000, 3)) + obstacle.centre
    inside = cloud[[obstacle.distance(tuple(p)) == 0.0 for p in cloud]]
    volume = 1.4 * 0.6 * 1.0 if isinstance(obstacle, Box) else np.pi * 0.7**2 * 1.6
    assert len(inside) / len(cloud) * 2.4**3 == pytest.approx(volume, rel=0.15)
    for point in product((-1.0, 1.2, 3.0), (-4.0, -2.0, 0.0), (0.0, 1.5, 4.0)):
        nearest = np.linalg.norm(inside - point, axis=1).min()
        assert nearest - 0.25 <= obstacle.distance(point) <= nearest


@pytest.mark.parametrize("obstacle", OBSTACLES, ids=["cylinder", "box"])
def test_a_sphere_touches_where_it_comes_as_near_as_its_radius(obstacle):
    """Against 201 points of the segment; early at edges alone, by what the grown shape sticks out
    there."""
    rng, radius, found = np.random.default_rng(1), 0.2, 0
    swept = SweptObstacle(obstacle, 0, radius)
    for _ in range(100):
        a, b = (tuple((rng.uniform(-2.0, 2.0, 3) + obstacle.centre).tolist()) for _ in "ab")
        s = np.linspace(0.0, 1.0, 201)
        near = (
            np.array([obstacle.distance(tuple(p)) for p in np.outer(1 - s, a) + np.outer(s, b)])
            <= radius
        )
        touch = swept.touch(a, b)
        assert touch is not None or not near.any()
        if touch is not None:
            at = tuple(np.array(a) + touch * np.subtract(b, a))
            assert obstacle.distance(at) <= 1.74 * radius
            assert not near[s < touch - 8e-3].any()
            found += bool(near.any())
    assert 10 < found < 95


def test_the_near_obstacles_are_those_that_are_touched():
    rng, poles = (
        np.random.default_rng(2),
        [Cylinder((x, y, 0.0), 0.1, 3.0) for x, y in product(range(6), range(6))],
    )
    swept, hits = SweptObstacles(poles, 0.1), 0
    for _ in range(300):
        a = rng.uniform((0.0, 0.0, 0.0), (5.0, 5.0, 3.5))
        p0, p1 = tuple(a.tolist()), tuple((a + rng.normal(0.0, 0.5, 3)).tolist())
        each = {s.index for s in swept.all if s.touch(p0, p1) is not None}
        assert {i.obstacle for i in swept.incidents(p0, p1)} == each
        hits += len(each)
    assert hits > 20
    assert SweptObstacles((), 0.1).incidents((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)) == []


def test_obstacles_go_into_json_as_they_are():
    cylinder, box = asdict(parse_course(GOOD, "mine.yaml"))["obstacles"]
    assert cylinder == {"base": (4.0, 2.0, 0.0), "radius": 0.5, "height": 5.0}
    assert box == {"centre": (-2.0, 3.0, 1.0), "size": (2.0, 1.0, 2.0), "yaw": radians(30)}
