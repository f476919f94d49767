"""Frames, boxes and cylinders as obstacles of a rollout: held against the referee's swept test,
wherever they stand."""

from dataclasses import replace

import numpy as np
import pytest
from oracle import decision_distance, fly_rows
from race_cases import ALL, DT, RADIUS, ROW, course, gate, state
from test_rollout_oracle import SYSTEM, assert_agree, controls, fly_lanes, launch, out_of_reach

from quadsim.controllers.costs.frames import (
    SAFETY_MARGIN,
    ObstacleRow,
    course_obstacles,
    touches,
    touches_round,
)
from quadsim.controllers.costs.race import RaceWeights, race_cost
from quadsim.controllers.lanes.lanes import Rollout
from quadsim.controllers.lanes.layout import LANES
from quadsim.controllers.sampled_trajectories import terms_of
from quadsim.course import Box, Cylinder
from quadsim.course.swept import SweptGate
from quadsim.course.swept_obstacles import SweptObstacle

TURNED = gate(5.0, 1.0, 20.0, 40, 20, 15)


def frames(*gates):
    return course_obstacles(course(*gates), RADIUS)


def test_lines_touch_what_the_referee_calls_a_touch_and_nothing_beyond_the_margin():
    rng, seen = np.random.default_rng(0), set()
    row = ObstacleRow(*frames(TURNED).rows[0])
    bare, wide = (SweptGate(TURNED, 0, r) for r in (RADIUS, RADIUS + 1.01 * SAFETY_MARGIN / 2))
    for _ in range(3000):
        a, b = (
            TURNED.position + TURNED.rotation @ rng.uniform((-0.8, -2.0, -2.0), (0.8, 2.0, 2.0))
            for _ in "ab"
        )
        ends = [TURNED.to_local(tuple(p.tolist())) for p in (a, b)]
        found, (hit, in_margin) = (
            bool(touches(a, b, row)),
            (g.touch(*ends) is not None for g in (bare, wide)),
        )
        assert found or not hit
        if found and not in_margin:  # past a corner: no one side has both ends
            assert min(abs(np.array(ends)[:, 1:]).max(axis=0)) > 0.8
        seen.add((hit, found))
    assert seen == {(False, False), (True, True), (False, True)}


def test_frames_far_away_are_not_tested_and_a_gate_that_comes_twice_is_once():
    row = [gate(4.0 * k) for k in range(1, 201)]
    obstacles = frames(*row, *row)
    assert len(obstacles.rows) == 200
    near = obstacles.near(np.array(state((400.0, 0.0, 20.0), (10.0, 0.0, 0.0))), 1.5)
    assert 20 < len(near) < 40
    assert near[:, 6].min() < 400.0 < near[:, 6].max()


def test_where_the_vehicle_is_within_the_margin_of_a_frame_the_margin_is_given_up():
    g = gate(5.0)
    beside = np.array(state((5.0, 1.0 - RADIUS - SAFETY_MARGIN / 4, 20.0)))
    p = beside[:3]
    tight, row = (ObstacleRow(*rows[0]) for rows in (frames(g).near(beside, 1.5), frames(g).rows))
    assert touches(p, p, row)
    assert not touches(p, p, tight)
    assert touches(p, p + np.array((0.0, SAFETY_MARGIN / 2, 0.0)), tight)


def paid_for_obstacles(cost, T):
    """The cost of frames and obstacles for a vehicle that flies straight on at 10 m/s."""
    x0 = launch((0.0, 0.0, 20.0), (10.0, 0.0, 0.0))
    U = np.tile(SYSTEM.rest, (T, 1))
    still = np.zeros((1, 4, T), np.float32)
    with_obstacles = fly_lanes(cost, x0, U, still)[0]
    without = fly_lanes(out_of_reach(cost), x0, U, still)[0]
    return with_obstacles - without


# Of the preset `race`, so that the loops are those of its flights
RACE = RaceWeights()


@pytest.mark.compiled
@pytest.mark.parametrize("y", [0.0, 1.2, 3.0])
def test_a_frame_that_is_not_next_is_a_crash_in_the_lanes(y):
    """The way to the next gate leads past another: through its opening, at its bar, beside it."""
    there = course(gate(40.0), gate(4.0, y))
    assert (paid_for_obstacles(race_cost(there, RADIUS, RACE, 1), 60) > 0.0) == (y == 1.2)
    assert paid_for_obstacles(race_cost(course(gate(40.0)), RADIUS, RACE, 1), 60) == 0.0


@pytest.mark.compiled
def test_a_crash_is_paid_from_where_it_happened():
    """A bar .4 s ahead: what remains of the horizon after it, to a line's length."""
    cost = race_cost(course(gate(40.0), gate(4.0, 1.2)), RADIUS, RACE, 1)
    for T in (50, 60, 113):
        steps_paid = paid_for_obstacles(cost, T) * T / RACE.crash
        assert steps_paid == pytest.approx(T - 4.0 / (10.0 * DT), abs=8)


@pytest.mark.compiled
def test_samples_past_the_finish_touch_nothing():
    cost = race_cost(ROW, RADIUS, RACE, 1)
    x0 = launch((2.0, 1.1, 20.0), (10.0, 0.0, 0.0))
    U, z = controls(0)
    last = len(cost.targets) - 1
    np.testing.assert_array_equal(
        fly_lanes(cost, x0, U, z, target=last),
        fly_lanes(out_of_reach(cost), x0, U, z, target=last),
    )


POLE, WALL = Cylinder((5.0, 1.0, 19.0), 0.2, 2.0), Box((5.0, 1.0, 20.0), (0.4, 3.0, 1.0), 0.5)


@pytest.mark.parametrize("obstacle", [POLE, WALL], ids=["cylinder", "box"])
def test_lines_touch_an_obstacle_where_the_referee_does_and_nothing_beyond_the_margin(obstacle):
    rng, seen = np.random.default_rng(3), set()
    there = course(gate(40.0), obstacles=(obstacle,))
    row = ObstacleRow(*course_obstacles(there, RADIUS).rows[-1])
    bare, wide = (
        SweptObstacle(obstacle, 0, r) for r in (RADIUS, RADIUS + 1.01 * SAFETY_MARGIN / 2)
    )
    for _ in range(600):
        a, b = (
            tuple((rng.uniform((-0.8, -2.0, -1.6), (0.8, 2.0, 1.6)) + obstacle.centre).tolist())
            for _ in "ab"
        )
        found, hit, in_margin = (
            bool(touches_round(a, b, row)),
            bare.touch(a, b) is not None,
            wide.touch(a, b) is not None,
        )
        assert hit <= found <= in_margin
        seen.add((hit, found))
    assert {(False, False), (True, True)} <= seen


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("dtype", "bounds"),
    [
        (np.float32, {}),
        pytest.param(np.float64, {"rtol": 1e-12, "graze": 1e-10}, marks=pytest.mark.regression),
    ],
)
def test_obstacles_are_crashes_in_the_lanes_as_in_the_oracle(dtype, bounds):
    """Past a frame, a pole and two walls, in the loops that test_rollout_oracle flies."""
    walls = (WALL, replace(WALL, centre=(8.0, -1.0, 20.0)))
    there = course(gate(40.0), gate(3.0), obstacles=(POLE, *walls))
    cost = race_cost(there, RADIUS, ALL, 1)
    frames_alone = replace(cost, obstacles=course_obstacles(replace(there, obstacles=()), RADIUS))
    x0 = launch((0.0, 0.9, 20.0), (9.0, 0.0, 0.0))
    oracle = fly_rows(SYSTEM, cost, x0, *controls(0), clearance=decision_distance)
    free = fly_rows(SYSTEM, frames_alone, x0, *controls(0))
    assert 0.1 < free.crashed.mean() < oracle.crashed.mean() - 0.2 < 0.7
    assert_agree(fly_lanes(cost, x0, *controls(0), dtype=dtype), oracle, **bounds)


@pytest.mark.regression
def test_the_terms_that_are_displayed_count_what_is_paid_for_obstacles():
    """In float64, in the loops of the test above; test_race_value has a sum of fewer terms."""
    there = course(gate(40.0), gate(3.0), obstacles=(POLE, WALL))
    cost = race_cost(there, RADIUS, ALL, 1)
    x0 = launch((0.0, 0.9, 20.0), (9.0, 0.0, 0.0))
    U, z = controls(0)
    v = np.clip(U.T + z[:LANES], np.array(SYSTEM.low)[:, None], np.array(SYSTEM.high)[:, None])
    oracle = fly_rows(SYSTEM, cost, x0, 0 * U, v, clearance=decision_distance)
    assert 0.1 < oracle.crashed.mean() < 0.9

    rollout = Rollout(SYSTEM, cost, np.float64)
    found = rollout.trajectories(x0, v, 0)
    clear = np.flatnonzero(oracle.clearance > 1e-10)
    assert len(clear) > LANES / 2
    for m in clear:
        terms = terms_of(rollout, x0, v[m], 0, found.sample(m))
        np.testing.assert_allclose(list(terms.values()), oracle.terms[m], rtol=1e-9, atol=1e-9)
