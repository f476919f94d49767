"""The order of a course: gates are flown several times and from behind, as one frame."""

import numpy as np
import pytest

from quadsim.course import load_course, parse_course
from quadsim.course.frames import frames
from quadsim.files.strict_yaml import FileError

GATES = """
opening: [1.6, 1.6]
start: {position: [-5, 0, 1.5], yaw_deg: 0}
gates:
  - {position: [0, 0, 1.5], yaw_deg: 0, pitch_deg: 20, roll_deg: 10}
  - {position: [8, 0, 1.5], yaw_deg: 30}
"""


def ordered(order):
    return parse_course(f"{GATES}order: {order}\n", "mine.yaml")


def test_gates_are_flown_in_the_order_and_from_behind_where_it_is_negative():
    course = ordered([2, -1, 2, 1])
    plain = parse_course(GATES, "mine.yaml")
    assert course.gates[0] == course.gates[2] == plain.gates[1]
    assert course.gates[3] == plain.gates[0]
    behind = course.gates[1]
    passage, left, up = behind.axes
    x, y, z = plain.gates[0].axes
    np.testing.assert_allclose((passage, left, up), (np.negative(x), np.negative(y), z), atol=1e-12)
    assert len(frames(course.gates)) == 2, "each frame stands once"


def test_without_an_order_each_gate_is_flown_once():
    assert ordered([1, 2]).gates == parse_course(GATES, "mine.yaml").gates


@pytest.mark.parametrize("number", [0, 3, -3])
def test_a_number_that_no_gate_has_is_one_line_with_its_place(number):
    with pytest.raises(FileError, match=r"^mine.yaml:7:\d+: order\[1\]: expected the number"):
        ordered([1, number])


def test_a_fault_of_a_gate_is_shown_where_the_gate_stands():
    text = f"{GATES}order: [-2, 1, 2]\n".replace("[8, 0, 1.5]", "[8, 0, 0.1]")
    with pytest.raises(FileError, match=r"^mine.yaml:6:\d+: gates\[1\].position: expected an open"):
        parse_course(text, "mine.yaml")


def test_a_changed_and_written_course_has_the_same_gates():
    course = load_course("lsy_level2").but(order=[1, 3, -1])
    assert course.published == ()
    written = parse_course(course.to_yaml(), course.name)
    assert written.gates == course.gates
    lower = course.but(laps=1, frame_width=0.1)
    assert [g.position for g in lower.gates] == [g.position for g in course.gates]
