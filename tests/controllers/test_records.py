"""Rows of frames, obstacles and targets are read by the names of their records."""

import numpy as np
import pytest
from race_cases import ALL, RADIUS, course, gate

from quadsim.controllers.costs.frames import ObstacleRow, course_obstacles, frame_row, obstacle_row
from quadsim.controllers.costs.race import race_cost
from quadsim.controllers.costs.race_targets import GateTarget
from quadsim.course import Box, Cylinder
from quadsim.course.swept import SweptGate
from quadsim.dynamics.named_tuples import as_rows, column, columns

TURNED = gate(5.0, 1.0, 20.0, 40, 20, 15)


def test_columns_are_the_fields_of_the_records_in_their_rows():
    records = [GateTarget(*(100.0 * k + np.arange(len(GateTarget._fields)))) for k in range(3)]
    rows = as_rows(records, GateTarget)
    for name in GateTarget._fields:
        assert column(rows, GateTarget, name).tolist() == [getattr(r, name) for r in records]
    assert columns(rows, GateTarget, "nx", "nz").tolist() == [[r.nx, r.ny, r.nz] for r in records]
    assert [GateTarget(*row) for row in rows] == records


def test_a_table_without_rows_has_its_columns():
    assert as_rows([], ObstacleRow).shape == (0, len(ObstacleRow._fields))


def test_the_row_of_a_frame_has_the_sizes_of_the_referee_and_the_tightest_box_around_the_slab():
    row, swept = frame_row(TURNED, RADIUS, 0.0, 0.0), SweptGate(TURNED, 0, RADIUS)
    assert (row.free_y, row.free_z) == swept.free
    assert (row.out_y, row.out_z) == swept.outer
    assert row.half == swept.half_depth
    axes = np.array([(row.nx, row.ny, row.nz), (row.lx, row.ly, row.lz), (row.ux, row.uy, row.uz)])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
    corners = (row.x, row.y, row.z) + signs * (row.half, row.out_y, row.out_z) @ axes
    np.testing.assert_allclose(corners.min(axis=0), (row.x_low, row.y_low, row.z_low))
    np.testing.assert_allclose(corners.max(axis=0), (row.x_high, row.y_high, row.z_high))


@pytest.mark.parametrize("grown", [0.0, 0.12])
def test_the_box_of_an_obstacle_is_its_own_grown_on_all_sides(grown):
    pole = obstacle_row(Cylinder((1.0, 2.0, 3.0), 0.2, 4.0), grown)
    r = 0.2 + grown
    assert (pole.x_low, pole.y_low, pole.z_low) == pytest.approx((1 - r, 2 - r, 3 - grown))
    assert (pole.x_high, pole.y_high, pole.z_high) == pytest.approx((1 + r, 2 + r, 7 + grown))
    assert (pole.half, pole.out_y, pole.out_z, pole.radius2) == pytest.approx(
        (2 + grown, r, r, r * r)
    )
    box = obstacle_row(Box((1.0, 2.0, 3.0), (2.0, 4.0, 6.0)), grown)
    assert (box.half, box.out_y, box.out_z) == pytest.approx((1 + grown, 2 + grown, 3 + grown))
    assert (box.x_low, box.z_high) == pytest.approx((-grown, 6 + grown))


def test_a_course_keeps_every_frame_once_and_all_obstacles_behind_them():
    others = (Box((1.0, 2.0, 3.0), (2.0, 4.0, 6.0)), Cylinder((1.0, 2.0, 3.0), 0.2, 4.0))
    rows = course_obstacles(course(TURNED, gate(9.0), TURNED, obstacles=others), RADIUS).rows
    assert columns(rows, ObstacleRow, "x", "z").tolist() == [
        [5, 1, 20],
        [9, 0, 20],
        [1, 2, 3],
        [1, 2, 5],
    ]


def test_a_target_has_unit_vectors_and_its_leg_leads_from_the_exit_before():
    cost = race_cost(course(gate(5.0), TURNED, gate(9.0, 3.0, yaw=90)), RADIUS, ALL, 1)
    before = np.array((0.0, 0.0, 20.0))  # the start
    for target in (GateTarget(*row) for row in cost.targets):
        passage, left = (
            np.array((target.nx, target.ny, target.nz)),
            np.array((target.lx, target.ly, target.lz)),
        )
        assert (passage @ passage, left @ left, passage @ left) == pytest.approx((1.0, 1.0, 0.0))
        exit = np.array((target.x, target.y, target.z))
        leg = target.leg * np.array((target.ex, target.ey, target.ez))
        np.testing.assert_allclose(before + leg, exit, atol=1e-9)
        before = exit
    assert target.to_go == 0.0
