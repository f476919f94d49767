"""Frames have the depth that their course gives them, for referee, planner and limit."""

from dataclasses import replace

import numpy as np
import pytest

from quadsim.controllers.costs.frames import ObstacleRow, course_obstacles
from quadsim.controllers.costs.race import RaceWeights, race_cost
from quadsim.course import FRAME_DEPTH, EstimatedGate, load_course, parse_course
from quadsim.course.swept import SweptGate

THICK = load_course("lsy_level2")
THIN = load_course("lsy_track")
RADIUS = 0.07
LESS = (FRAME_DEPTH - 0.02) / 2  # [m] on either side


def test_the_competitions_course_differs_in_the_depth_alone():
    assert THIN.gates == tuple(replace(gate, frame_depth=0.02) for gate in THICK.gates)
    assert (THIN.obstacles, THIN.start, THIN.bounds) == (THICK.obstacles, THICK.start, THICK.bounds)


def test_a_file_keeps_the_depths_and_leaves_out_the_default():
    assert "frame_depth" not in THICK.to_yaml()
    gates = (*THIN.gates[:2], replace(THIN.gates[2], frame_depth=0.3), THIN.gates[3])
    mixed = THIN.but(gates=gates)
    assert [gate.frame_depth for gate in mixed.gates] == [0.02, 0.02, 0.3, 0.02]
    assert parse_course(mixed.to_yaml(), "mixed.yaml").gates == mixed.gates
    assert THICK.but(gates=gates).gates == gates


def test_bars_referee_and_planner_use_it():
    thin, thick = THIN.gates[3], THICK.gates[3]
    for bar, other in zip(thin.bars, thick.bars, strict=True):
        assert bar.half[0] == pytest.approx(other.half[0] - LESS)
    depths = [SweptGate(gate, 0, RADIUS).half_depth for gate in (thin, thick)]
    assert depths[0] == pytest.approx(depths[1] - LESS)
    halves = [
        [ObstacleRow(*row).half for row in course_obstacles(course, RADIUS).rows[:4]]
        for course in (THIN, THICK)
    ]
    np.testing.assert_allclose(halves[0], np.array(halves[1]) - LESS)
    costs = [race_cost(course, RADIUS, RaceWeights(), 1) for course in (THIN, THICK)]
    column = costs[0].row._fields.index("depth")
    np.testing.assert_allclose(
        costs[0].targets[-2, column], costs[1].targets[-2, column] - 2 * LESS
    )


def test_an_estimated_gate_is_as_deep():
    assert EstimatedGate.of(THIN.gates[0], (0.1, 0.0, 0.0), 0.1).frame_depth == 0.02
