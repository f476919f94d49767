"""Every course that comes with the project is sound; a course that is not says where."""

from itertools import pairwise, product
from math import radians

import numpy as np
import pytest

from quadsim.course import COURSES, Course, Gate, Published, course_names, load_course, parse_course
from quadsim.files.strict_yaml import FileError
from quadsim.vehicle import load_vehicle, vehicle_names

GOOD = """\
loop: true
laps: 3
opening: [1.6, 1.6]
start: {position: [-5, 0, 2], yaw_deg: 0}
gates:
  - {position: [0, 0, 2], yaw_deg: 0}
  - position: [8, 4, 3]
    yaw_deg: 90
    pitch_deg: 10
    opening: [2, 1]
"""
ROOMY = "bounds: [[-20, 20], [-20, 20], [0, 9]]\n"
BAD = [
    (
        "yaw_deg: 90",
        "yaw_deg: north",
        "8:14: gates[1].yaw_deg: expected",
    ),
    ("yaw_deg: 90", "yaw: 90", "8:5: gates[1].yaw: unknown key"),
    ("[8, 4, 3]", "[8, 4]", "7:15: gates[1].position: expected"),
    (
        "[8, 4, 3]",
        "[8, 4, .nan]",
        "7:22: gates[1].position[2]: expected",
    ),
    (
        "[8, 4, 3]",
        "[8, 1e5, 3]",
        "7:19: gates[1].position[1]: expected",
    ),
    ("[2, 1]", "[2, 0]", "10:18: gates[1].opening[1]: expected"),
    (
        "[2, 1]",
        "[-2, 1]",
        "10:15: gates[1].opening[0]: expected",
    ),
    ("opening: [1.6, 1.6]\n", "", "1:1: opening: missing"),
    (
        "loop: true",
        "frame_width: 0",
        "1:14: frame_width: expected",
    ),
    (
        GOOD[GOOD.index("gates") :],
        "gates: []\n",
        "5:8: gates: expected",
    ),
    ("laps: 3", "laps: 0", "2:7: laps: expected"),
    ("laps: 3", "laps: 1001", "2:7: laps: expected"),
    ("loop: true", "loop: false", "2:7: laps: expected"),
    (
        "loop: true",
        "name: ../x",
        "1:7: name: expected",
    ),
    (
        "loop: true",
        'name: "a\\n"',
        "1:7: name: expected",
    ),
    (
        "loop: true\n",
        "loop: true\n" + ROOMY.replace("[0, 9]", "[9, 0]"),
        "2:32: bounds[2]: expected",
    ),
    (
        "loop: true\n",
        "loop: true\n" + ROOMY.replace("20]", "4]"),
        "8:15: gates[1].position: outside the bounds",
    ),
    (
        "loop: true\n",
        "loop: true\n" + ROOMY.replace("[-20", "[-4"),
        "5:19: start.position: outside the bounds",
    ),
    (
        "[8, 4, 3]",
        "[8, 4, 0.25]",
        "7:15: gates[1].position: expected",
    ),
    (
        "[-5, 0, 2]",
        "[-5, 0, -2]",
        "4:19: start.position: expected",
    ),
    (
        "[-5, 0, 2]",
        "[0.1, 0.9, 2]",
        "4:19: start.position: expected",
    ),
    (
        "[8, 4, 3]\n    yaw_deg: 90\n    pitch_deg: 10",
        "[8, 4, 0.05]\n    yaw_deg: 90\n    pitch_deg: 90",
        "7:15: gates[1].position: expected",
    ),
    (
        "loop: true\n",
        "loop: true\n" + ROOMY.replace("[-20, 20], [0", "[-20, 4.1], [0"),
        "8:15: gates[1].position: 0.3 m behind the gate",
    ),
]


ALL = [load_course(name) for name in course_names()]


def test_each_fault_of_a_course_is_one_line_with_its_place_and_key():
    for old, new, message in BAD:
        assert old in GOOD
        with pytest.raises(FileError) as error:
            parse_course(GOOD.replace(old, new, 1), "mine.yaml")
        assert str(error.value).startswith(f"mine.yaml:{message}")
        assert "\n" not in str(error.value)


@pytest.mark.slow
def test_no_damage_to_a_file_escapes_as_anything_but_one_line():
    rng = np.random.default_rng(0)
    pieces = [
        *"[]{}:,-#&*!|>'\"%\t\n .e9\0\x07\x85\ufeff",
        "? ",
        "---\n",
        "&a ",
        "*a",
        "~",
        ".nan",
        "1e400",
        "\\e",
    ]
    messages = []
    for _ in range(300):
        at, cut = rng.integers(len(GOOD)), rng.integers(3)
        try:
            parse_course(GOOD[:at] + rng.choice(pieces) + GOOD[at + cut :], "mine.yaml")
        except FileError as error:
            messages.append(str(error))
    assert len(messages) > 100
    assert all(message.isprintable() for message in messages)


def test_a_course_has_the_numbers_of_its_file():
    course = parse_course(
        GOOD + "published:\n  - {who: somebody, time: 12.5}\n", "folder/my oval.yaml"
    )
    assert (course.name, course.loop, course.laps, course.text[:10]) == (
        "my_oval",
        True,
        3,
        GOOD[:10],
    )
    assert course.gates[0] == Gate((0.0, 0.0, 2.0), 0.0, 0.0, 0.0, (1.6, 1.6), 0.275)
    assert course.gates[1] == Gate(
        (8.0, 4.0, 3.0), radians(90), radians(10), 0.0, (2.0, 1.0), 0.275
    )
    assert course.published == (Published("somebody", 12.5),)
    assert course.lap_length == pytest.approx(18.0)


OPEN = """bounds: [[-3, 6], [-3, 3], [-1, 5]]
start: {position: [0, 0, 2], yaw_deg: 0}
opening: [1.5, 1.5]
gates:
  - {position: [PLACE], yaw_deg: 0, pitch_deg: PITCH}
"""


def test_the_last_gate_of_an_open_course_has_room_on_both_sides():
    for place, pitch, problem in (
        ("6, 0, 2", 0, "0.3 m behind the gate, along its passage, is outside the bounds"),
        ("5.8, 0, 2", 0, "0.3 m behind the gate"),
        ("-3, 0, 2", 0, "0.3 m before the gate"),
        ("3, 0, 0.2", 90, "room behind the gate, got the ground nearer"),
        ("3, 0, 0.2", -90, "room before the gate, got the ground nearer"),
        ("3, 0, 4.9", -90, "0.3 m behind the gate"),
    ):
        text = OPEN.replace("PLACE", place).replace("PITCH", str(pitch))
        with pytest.raises(FileError, match=problem) as error:
            parse_course(text, "mine.yaml")
        assert str(error.value).startswith("mine.yaml:5:16: gates[0].position: ")


def test_default_bounds_leave_room_around_start_and_gates():
    (x0, x1), (y0, y1), (z0, z1) = parse_course(GOOD, "mine.yaml").bounds
    assert (x0, y0, z0) == pytest.approx((-15.0, -11.075, -1.0))
    assert x1 == pytest.approx(8 + 1.275 + 10)
    assert y1 > 14 and z1 > 13.5  # noqa: PT018


def test_a_gate_may_come_again_and_opposite_and_stacked_gates_share_a_place():
    again = GOOD.replace("[8, 4, 3]", "[0, 0, 2]").replace(
        "yaw_deg: 90\n    pitch_deg: 10", "yaw_deg: 1"
    )
    assert len(parse_course(again, "mine.yaml").gates) == 2
    twice = GOOD.replace("[8, 4, 3]", "[0, 0, 2]").replace(
        "yaw_deg: 90\n    pitch_deg: 10", "yaw_deg: 180"
    )
    assert len(parse_course(twice, "mine.yaml").gates) == 2
    stacked = GOOD.replace("[8, 4, 3]", "[0, 0, 3.9]").replace(
        "yaw_deg: 90\n    pitch_deg: 10", "yaw_deg: 0"
    )
    assert len(parse_course(stacked, "mine.yaml").gates) == 2


def test_a_frame_may_dip_into_the_ground_while_its_opening_does_not():
    text = GOOD.replace("[0, 0, 2], yaw_deg: 0", "[0, 0, 0.8], yaw_deg: 7, roll_deg: 90")
    low = parse_course(text, "mine.yaml").gates[0]
    assert low.corners()[:, 2].min() == pytest.approx(0.0)
    assert low.corners(low.frame_width)[:, 2].min() < 0.0


def test_distance_to_a_frame_is_that_to_the_nearest_of_its_points():
    gate = Gate((1.0, 2.0, 3.0), 0.7, -0.3, 0.2, (2.0, 1.0), 0.4)
    y, z = np.meshgrid(np.linspace(-1.4, 1.4, 281), np.linspace(-0.9, 0.9, 181))
    bars = (np.abs(y) >= 1.0 - 1e-9) | (np.abs(z) >= 0.5 - 1e-9)
    # (n, 3)
    cloud = np.stack([0 * y[bars], y[bars], z[bars]], axis=1) @ gate.rotation.T + gate.position
    for point in product((0.2, 1.1, 3.0), (0.5, 2.0, 4.0), (2.2, 3.0, 4.5)):
        nearest = np.linalg.norm(cloud - point, axis=1).min()
        assert gate.frame_distance(point) == pytest.approx(nearest, abs=0.01)


def test_a_misspelt_name_gets_the_nearest_course():
    with pytest.raises(FileError) as error:
        load_course("split_swift")
    assert (
        str(error.value)
        == "no course 'split_swift': did you mean 'split_s_swift'? (race courses lists them)"
    )


def test_a_path_loads_a_course_from_anywhere(tmp_path):
    (tmp_path / "mine.yaml").write_text(GOOD)
    assert load_course(tmp_path / "mine.yaml") == parse_course(GOOD, "mine.yaml")


def test_the_folder_holds_the_courses_that_are_named_elsewhere():
    assert {
        "alphapilot",
        "figure8",
        "lsy_level2",
        "paper_flat",
        "split_s_song",
        "split_s_swift",
    } <= set(course_names())


def test_every_course_loads_with_a_source_and_its_text():
    for course in ALL:
        assert course.source, course.name
        assert course.text == (COURSES / f"{course.name}.yaml").read_text()
        assert parse_course(course.text, f"{course.name}.yaml") == course


def test_every_vehicle_fits_through_every_gate():
    widest = max(load_vehicle(name).radius for name in vehicle_names())
    for course in ALL:
        assert min(min(g.opening) for g in course.gates) > 2 * widest, course.name


def test_no_frame_stands_in_another_gates_opening():
    for course in ALL:
        for one, other in product(course.gates, repeat=2):
            room = min(one.opening) / 2
            assert one is other or other.frame_distance(one.position) > room, course.name


def test_no_gate_is_first_met_from_behind():
    """The straight way from the gate before has at most a hair against the passage: the second of a
    split-S has 0."""
    for course in ALL:
        for (before, here), gate in zip(pairwise(_way(course)), course.gates, strict=True):
            if course.name == "aigp_physical" and gate is course.gates[5]:
                continue  # a hairpin, as its organizers have published it
            leg = np.subtract(here, before)
            assert leg @ gate.rotation[:, 0] > -0.05 * np.linalg.norm(leg), course.name


def test_paper_flat_is_level_open_and_without_sharp_turns():
    course = load_course("paper_flat")
    assert not course.loop
    assert 65.0 <= course.lap_length <= 80.0
    assert {g.position[2] for g in course.gates} | {course.start.position[2]} == {2.0}
    assert {g.opening for g in course.gates} == {(2.4, 2.4)}
    turns = np.diff([np.arctan2(*np.subtract(b, a)[1::-1]) for a, b in pairwise(_way(course))])
    assert np.abs(turns).max() < radians(70)


def test_the_middle_of_figure8_is_crossed_on_two_levels():
    course = load_course("figure8")
    low, high = (g for g in course.gates if g.position[:2] == (0.0, 0.0))
    gap = high.corners(high.frame_width)[:, 2].min() - low.corners(low.frame_width)[:, 2].max()
    assert gap > 2 * max(load_vehicle(name).radius for name in vehicle_names())


def _way(course: Course):
    return [course.start.position, *(g.position for g in course.gates)]
