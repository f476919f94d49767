"""The one drawing of a course: gates and obstacles stand where they are, in metres."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from quadsim.course import load_course
from quadsim.figures.course import draw_course, gate_bar


@pytest.mark.parametrize("name", ["split_s_swift", "lsy_level2"])
def test_a_gate_from_above_is_a_bar_as_long_as_its_frame_around_its_centre(name):
    for gate in load_course(name).gates:
        frame, opening = gate_bar(gate)
        np.testing.assert_allclose(frame.mean(axis=0), gate.position[:2])
        np.testing.assert_allclose(opening.mean(axis=0), gate.position[:2])
        if gate.pitch == gate.roll == 0.0:
            width = gate.opening[0]
            outer = width + 2 * gate.frame_width
            assert np.linalg.norm(np.diff(opening, axis=0)) == pytest.approx(width)
            assert np.linalg.norm(np.diff(frame, axis=0)) == pytest.approx(outer)


def test_a_course_is_drawn_to_scale_with_all_of_its_gates_and_obstacles():
    course = load_course("lsy_level2")
    axes = Figure().subplots()
    draw_course(axes, course, bounds=True)
    assert axes.get_aspect() == 1.0
    numbers = [text.get_text() for text in axes.texts if text.get_text()]
    assert len(numbers) == len(course.gates) + len(course.obstacles)
    assert len(axes.patches) == len(course.obstacles)
    for patch, obstacle in zip(axes.patches, course.obstacles, strict=True):
        np.testing.assert_allclose(patch.get_xy()[:-1], obstacle.outline())
