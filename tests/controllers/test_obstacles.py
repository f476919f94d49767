"""Every gate's frame as an obstacle of a rollout: held against the referee's swept test, and wherever it stands."""

from dataclasses import replace

import numpy as np
import pytest
from race_cases import ALL, DT, RADIUS, ROW, course, gate, state
from test_rollout_oracle import SYSTEM, controls, fly_lanes, launch

from controllers.costs.frames import SAFETY_MARGIN, frame_obstacles, touches
from controllers.costs.race import race_cost
from quadsim.course.swept import SweptGate

TURNED = gate(5.0, 1.0, 20.0, 40, 20, 15)


def frames(*gates):
    return frame_obstacles(gates, RADIUS, 1.0, 5)


def test_lines_touch_what_the_referee_calls_a_touch_and_nothing_beyond_the_margin():
    rng, seen = np.random.default_rng(0), set()
    (row,) = frames(TURNED).rows
    bare, wide = (SweptGate(TURNED, 0, r) for r in (RADIUS, RADIUS + 1.01 * SAFETY_MARGIN / 2))
    for _ in range(3000):
        a, b = (TURNED.position + TURNED.rotation @ rng.uniform((-0.8, -2.0, -2.0), (0.8, 2.0, 2.0)) for _ in "ab")
        ends = [TURNED.to_local(tuple(p.tolist())) for p in (a, b)]
        found, (hit, in_margin) = bool(touches(a, b, row)), (g.touch(*ends) is not None for g in (bare, wide))
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
    (tight,), (row,) = frames(g).near(beside, 1.5), frames(g).rows
    assert touches(p, p, row)
    assert not touches(p, p, tight)
    assert touches(p, p + np.array((0.0, SAFETY_MARGIN / 2, 0.0)), tight)


@pytest.mark.parametrize("y", [0.0, 1.2, 3.0])
def test_a_frame_that_is_not_next_is_a_crash_in_the_lanes(y):
    """The way to the next gate leads past another: through its opening, at its bar, beside it."""
    there = course(gate(40.0), gate(4.0, y))
    cost = race_cost(there, RADIUS, replace(ALL, clearance=0.0), 1)
    alone = race_cost(course(gate(40.0)), RADIUS, replace(ALL, clearance=0.0), 1)
    x0, U = launch((0.0, 0.0, 20.0), (10.0, 0.0, 0.0)), np.tile(SYSTEM.rest, (60, 1))
    still = np.zeros((1, 4, 60), np.float32)
    crashed = fly_lanes(cost, x0, U, still)[0] - fly_lanes(replace(cost, obstacles=None), x0, U, still)[0]
    assert (crashed > 0.0) == (y == 1.2)
    assert fly_lanes(alone, x0, U, still)[0] == fly_lanes(replace(alone, obstacles=None), x0, U, still)[0]


def test_a_crash_is_paid_from_where_it_happened():
    """A bar .4 s ahead: what remains of the horizon after it, to a line's length."""
    cost = race_cost(course(gate(40.0), gate(4.0, 1.2)), RADIUS, replace(ALL, clearance=0.0), 1)
    for T in (50, 60, 113):
        x0, U, still = launch((0.0, 0.0, 20.0), (10.0, 0.0, 0.0)), np.tile(SYSTEM.rest, (T, 1)), np.zeros((1, 4, T))
        paid = fly_lanes(cost, x0, U, still)[0] - fly_lanes(replace(cost, obstacles=None), x0, U, still)[0]
        assert paid * T / ALL.crash == pytest.approx(T - 4.0 / (10.0 * DT), abs=8)


def test_samples_past_the_finish_touch_nothing():
    cost = race_cost(ROW, RADIUS, ALL, 1)
    x0 = launch((2.0, 1.1, 20.0), (10.0, 0.0, 0.0))
    U, z = controls(0)
    last = len(cost.targets) - 1
    np.testing.assert_array_equal(
        fly_lanes(cost, x0, U, z, target=last), fly_lanes(replace(cost, obstacles=None), x0, U, z, target=last)
    )
