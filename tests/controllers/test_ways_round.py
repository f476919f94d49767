"""Targets lead round obstacles: the shortest way that is clear of them, and none where there is
nothing in the way."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from race_cases import ALL, RADIUS, ROW, course, fly, gate, straight

from quadsim.controllers.costs.frames import obstacle_rows
from quadsim.controllers.costs.race import race_cost
from quadsim.controllers.costs.race_targets import GateTarget
from quadsim.controllers.costs.room import Room
from quadsim.controllers.costs.ways_round import sees, shortest, way_round
from quadsim.course import Box, Cylinder
from quadsim.dynamics.named_tuples import columns

ROOM = Room(floor=0.2, x_low=-50.0, x_high=50.0, y_low=-50.0, y_high=50.0, z_high=40.0)
WALL = Box((5.0, 1.0, 10.0), (0.4, 6.0, 20.0))  # from y = -2 to 4, from the ground to z = 20
CLEAR = 0.5
A, B = (0.0, 0.0, 10.0), (10.0, 0.0, 10.0)


def length(*points):
    return float(np.linalg.norm(np.diff(np.vstack(points), axis=0), axis=1).sum())


def test_the_way_round_a_wall_is_the_short_one_and_clear_of_it():
    way = way_round(A, B, (WALL,), CLEAR, ROOM)
    path = np.vstack([A, way, B])
    assert sees(path[:-1], path[1:], obstacle_rows((WALL,), CLEAR)).all()
    assert way[:, 1].tolist() == pytest.approx([-2.52, -2.52])  # on the side of its near end
    assert length(A, way, B) == pytest.approx(2 * np.hypot(5.0 - 0.72, 2.52) + 1.44, rel=1e-6)


def test_a_low_wall_is_flown_over_and_where_there_is_no_way_there_is_none():
    low = replace(WALL, size=(0.4, 60.0, 20.2))
    assert (way_round(A, B, (low,), CLEAR, ROOM)[:, 2] > 20.5).all()
    assert len(way_round(A, B, (replace(low, size=(0.4, 200.0, 90.0)),), CLEAR, ROOM)) == 0


@pytest.mark.parametrize(
    "obstacle", [Cylinder((5.0, 0.0, 0.0), 0.05, 20.0), replace(WALL, centre=(5.0, 9.0, 10.0))]
)
def test_beside_a_free_line_and_round_a_pole_no_point_is_needed(obstacle):
    assert len(way_round(A, B, (obstacle,), 0.2, ROOM)) == 0


def test_between_two_walls_the_way_is_the_shortest_of_all():
    walls = WALL, Box((8.0, -3.0, 10.0), (0.4, 6.0, 20.0))
    way = way_round(A, B, walls, CLEAR, ROOM)
    path = np.vstack([A, way, B])
    assert sees(path[:-1], path[1:], obstacle_rows(walls, CLEAR)).all()
    assert way[:, 1].min() < -2.4 < 0.4 < way[:, 1].max()


def test_the_shortest_path_is_that_of_all_orders_of_five_nodes():
    far = np.inf
    lengths = np.full((5, 5), far)
    for a, b, way in ((0, 2, 1), (0, 3, 4), (1, 3, 1), (1, 4, 5), (2, 3, 2)):
        lengths[a, b] = way
    assert shortest(np.minimum(lengths, lengths.T)) == ([0, 2, 3, 1], 4.0)
    assert shortest(np.full((3, 3), far))[1] == far


WALLED = course(
    gate(0.0),
    gate(20.0),
    obstacles=(Box((10.0, 2.0, 20.0), (0.4, 6.0, 40.0)),),
    start=(-5.0, 0.0, 20.0),
)


def exits(cost):
    return columns(cost.targets, GateTarget, "x", "z")


def test_a_wall_between_two_gates_puts_rows_between_them_and_the_way_to_go_counts_along_them():
    cost, bare = (
        race_cost(WALLED, RADIUS, ALL, 1),
        race_cost(replace(WALLED, obstacles=()), RADIUS, ALL, 1),
    )
    assert len(cost.targets) == len(bare.targets) + 2
    np.testing.assert_array_equal(exits(bare)[1:], exits(cost)[3:])
    # from the first gate [m]
    walled, free = (GateTarget(*c.targets[0]).to_go for c in (cost, bare))
    assert walled > free + 0.1
    corners = exits(cost)[1:3].tolist()
    assert max(y for _, y, _ in corners) < -1.0
    legs = pairwise([(-1.0, 0.0, 20.0), (1.0, 0.0, 20.0), *corners, (21.0, 0.0, 20.0)])
    points = [p for a, b in legs for p in straight(a, b)[:-1]]
    _, rows, crashes = fly(cost, points)
    # a gate, both corners, the other gate, and behind the finish
    assert sorted(set(rows)) == [0, 1, 2, 3, 4]
    assert not any(crashes)


def test_the_row_ahead_is_the_last_in_sight_and_never_one_that_lies_behind():
    cost = race_cost(WALLED, RADIUS, ALL, 1)

    def ahead(target, *p):
        return cost.row_ahead(target, np.array([*p, 1.0, 0.0, 0.0]))

    assert ahead(0, -3.0, 0.0, 20.0) == 0
    assert ahead(1, 2.0, 0.0, 20.0) in (1, 2)
    assert ahead(1, 9.0, 3.0, 20.0) == 1  # before the middle of the wall, its first corner
    # past the wall, and where all is in sight
    assert ahead(1, 12.0, 0.0, 20.0) == ahead(1, 10.0, -5.0, 20.0) == 3
    assert ahead(1, 0.02, 0.0, 20.0) == 0  # still between the bars of the first gate
    assert ahead(9, 30.0, 0.0, 20.0) == len(cost.targets) - 1
    assert race_cost(ROW, RADIUS, ALL, 1).row_ahead is None
