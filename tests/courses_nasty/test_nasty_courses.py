"""Courses at the edge of what is legal are flown, each on three seeds: no hit, no standstill, no
timeout.

The files of this folder with the preset's own budget: make regression. Here one of them, with an
eighth of the samples.
"""

from pathlib import Path

import numpy as np
import pytest

import quadsim
from quadsim.config.build_cost import cost_on
from quadsim.config.spec import Spec

HERE = Path(__file__).parent
COURSES = sorted(HERE.glob("*.yaml"))


def assert_flown(run, gates):
    kinds = {e.kind for e in run.events}
    assert (run.outcome, len(run.gates)) == ("finished", gates), run.events[-1:]
    assert not kinds & {"hit", "unseen_contact"}


def fly(path, seed, **settings):
    course = quadsim.load_course(path)
    assert_flown(quadsim.fly(path, seed=seed, **settings), len(course.gates) * course.laps)


@pytest.mark.compiled
def test_a_u_turn_in_front_of_a_gate_is_finished_with_an_eighth_of_the_samples():
    """By the horizon of the preset: the way around the frame is longer than a short one sees."""
    fly(HERE / "u_turn_in_front.yaml", 0, sampler="gaussian", samples=512, iterations=1)


@pytest.mark.regression
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("path", COURSES, ids=lambda p: p.stem)
def test_nasty_course_is_finished(path, seed):
    fly(path, seed)


def test_a_gate_that_the_vehicle_cannot_pass_is_refused_before_the_flight():
    text = "opening: [0.3, 0.3]\nstart: {position: [0, 0, 2], yaw_deg: 0}\ngates:\n"
    text += "  - {position: [5, 0, 0.2], yaw_deg: 0}\n"
    course = quadsim.course.parse_course(text, "low.yaml")
    with pytest.raises(
        ValueError,
        match=r"low: gates\[0\]: expected an opening that is free 0.24 m above the ground",
    ):
        quadsim.fly(course, vehicle="swift")


def line(gates):
    """Gates 4 m apart on a line."""
    rows = "".join(f"  - {{position: [{4 * k}, 0, 2], yaw_deg: 0}}\n" for k in range(1, gates + 1))
    text = "opening: [1.5, 1.5]\nstart: {position: [0, 0, 2], yaw_deg: 0}\ngates:\n" + rows
    return quadsim.course.parse_course(text, "line.yaml")


def test_frames_that_a_plan_minds_do_not_grow_with_the_number_of_gates():
    minded = {}
    for gates in (60, 200):
        spec = Spec.of(line(gates))
        x = np.zeros(17)
        x[:3] = 120.0, 0.0, 2.0
        minded[gates] = cost_on(spec, spec.course).obstacles.near(x, 1.5)[:, 6].tolist()
    assert minded[60] == minded[200]
    assert len(minded[200]) < 30
