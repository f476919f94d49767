"""The racing cost counts gates, distance and crashes inside a rollout.

The gates' frames are in test_race_frame.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from race_cases import (
    ALL,
    DT,
    EXIT,
    FAR,
    GAP,
    ONLY,
    RADIUS,
    ROW,
    at,
    course,
    fly,
    gate,
    straight,
    term,
    through,
)

from quadsim.controllers.costs.race import RUN_OUT, TERMS, RaceWeights, clear_of_frame, race_cost
from quadsim.controllers.costs.race_targets import GateTarget
from quadsim.course import course_names, load_course
from quadsim.dynamics.named_tuples import column, columns


def remaining(cost, points):
    return fly(cost, points)[0][:, 0]


@pytest.mark.parametrize("speed", [3.0, 10.0, 30.0])
def test_remaining_distance_falls_along_a_straight_flight_by_the_distance_flown(speed):
    cost, step = race_cost(ROW, RADIUS, ONLY["progress"], 1), speed * DT
    left = remaining(cost, straight((0.03, 0, 20), (18, 0, 20), speed))
    assert np.all(np.diff(left) < 0)
    # the step that passes a gate is counted up to its exit
    assert np.all(np.diff(left) > -2.1 * step)
    assert left[0] - left[-1] == pytest.approx(18 - 0.03 - step, abs=0.01)


@pytest.mark.parametrize("yaw", [0.0, 60.0, 120.0, 180.0])
def test_remaining_distance_is_continuous_where_a_gate_is_passed(yaw):
    """Also where the next gate faces away, so that the way there leads round it."""
    cost = race_cost(course(gate(5.0), gate(8.0, 1.0, yaw=yaw)), RADIUS, ONLY["progress"], 1)
    left = remaining(cost, straight((4, 0, 20), (5.7, 0, 20)))  # up to the plane of the second gate
    assert abs(np.diff(left)).max() < 0.25


@pytest.mark.parametrize("phase", np.linspace(0.0, 0.29, 7))
def test_gates_crossed_between_two_steps_at_30_mps_count(phase):
    _, rows, crashed = fly(
        race_cost(ROW, RADIUS, ALL, 1), straight((phase, 0.5, 20.3), (18 + phase, 0.5, 20.3), 30.0)
    )
    assert (rows[-1], crashed[-1]) == (3, 0.0)


def test_crash_is_latched_and_paid_at_every_later_step():
    cost = race_cost(ROW, RADIUS, ONLY["crash"], 1)
    q, _, crashed = fly(
        cost, straight((0.03, 1.1, 20), (8, 1.1, 20)) + straight((8.1, 0, 20), (12, 0, 20))
    )
    hit = crashed.index(1.0)
    np.testing.assert_array_equal(q[:, TERMS.index("crash")], [0.0] * hit + [1.0] * (len(q) - hit))
    assert 40 < hit < 60


def test_wrong_way_is_a_crash_and_a_far_miss_is_nothing():
    cost = race_cost(ROW, RADIUS, ALL, 1)
    outcomes = {}
    for name, y, back in (
        ("wrong way", 0.0, True),
        ("clipped from behind", 1.2, True),
        ("miss", 3.0, False),
        ("back", 3.0, True),
    ):
        _, rows, crashed = fly(cost, through(ROW.gates[0], y, 0.0, back))
        outcomes[name] = rows[0], crashed[0]
    assert outcomes == {
        "wrong way": (0, 1.0),
        "clipped from behind": (0, 1.0),
        "miss": (0, 0.0),
        "back": (0, 0.0),
    }


def test_beyond_a_missed_gate_the_way_leads_back_round_it():
    cost = race_cost(ROW, RADIUS, ONLY["progress"], 1)

    def left(x, y):
        return term("progress", cost, (x + EXIT, y, 20.0))

    assert left(5.1, 3.0) > left(4.6, 3.0) + 1.0  # missing costs
    assert left(4.9, 3.0) > left(4.6, 3.0) + 1.0  # beside the frame as well, where vehicles hovered
    assert left(4.7, 1.5) < left(4.9, 1.5)  # from there the way leads forward
    assert left(6.0, 3.0) < left(7.0, 3.0)  # flying on costs more
    assert left(5.1, 3.0) < left(6.0, 3.0)  # turning back less
    front = left(3.0, 0.0)  # as far in front of the exit as the gate's larger opening, 2 m
    assert left(6.0, 4.0) == pytest.approx(np.hypot(3.0, 4.0) + front, abs=0.01)
    assert np.all(np.diff([left(4.0, y) for y in (3.0, 2.0, 1.0, 0.0)]) < 0)


def test_nothing_stands_where_the_last_target_is_after_the_finish():
    cost, end = race_cost(ROW, RADIUS, ALL, 1), 15 + RUN_OUT
    after = replace(cost, targets=cost.targets[3:])
    for y in (0.0, 1.1, -3.0):
        for x in (end - EXIT, end + EXIT):
            q, _, crashed = fly(after, [(end - 0.3, y, 20.0), (x, y, 20.0)])
            assert (q[0, TERMS.index("clearance")], crashed) == (0.0, [0.0])


def test_flying_on_after_the_finish_is_progress():
    cost = race_cost(ROW, RADIUS, ONLY["progress"], 1)
    left = remaining(cost, straight((0.03, 0, 20), (30, 0, 20)))
    assert np.all(np.diff(left)[150:] < 0)
    assert left[-1] == pytest.approx(15 + RUN_OUT - 30, abs=0.01)
    assert term("progress", cost, (20, 0, 20), row=3) < term("progress", cost, (19, 0, 20), row=3)
    assert term("progress", cost, (20, 0, 20), row=3) < term("progress", cost, (20, 5, 20), row=3)


def test_laps_follow_each_other_without_a_seam():
    loop = course(
        gate(5.0),
        gate(10.0, 5.0, yaw=90),
        gate(5.0, 10.0, yaw=180),
        gate(0.0, 5.0, yaw=270),
        loop=True,
    )
    cost, leg = race_cost(loop, RADIUS, ALL, 3), np.array((5 + EXIT, EXIT - 5))  # from exit to exit
    targets, to_go = cost.targets, column(cost.targets, GateTarget, "to_go")
    assert len(targets) == 3 * 4 + 1
    gates = columns(targets, GateTarget, "x", "bar")
    np.testing.assert_array_equal(gates[4:8], gates[:4])
    legs = columns(targets, GateTarget, "approach", "depth")
    np.testing.assert_allclose(legs[8:12], legs[4:8])
    np.testing.assert_allclose(np.diff(to_go[:12]), -np.hypot(*leg))
    from_gate_4 = GateTarget(*targets[4])
    np.testing.assert_allclose(
        (from_gate_4.ex, from_gate_4.ey, from_gate_4.ez), (*leg / np.hypot(*leg), 0.0)
    )
    assert from_gate_4.leg == pytest.approx(np.hypot(*leg))
    late = cost.targets_from(8, np.array((5.0, 5.0, 20.0, 1.0, 0.0, 0.0)))
    np.testing.assert_allclose(
        column(late, GateTarget, "to_go")[:4], to_go[8:12] - to_go[8], rtol=1e-6
    )


def test_leaving_the_bounds_or_coming_down_is_a_crash_and_starting_on_the_ground_is_none():
    low = course(
        gate(50.0, 0.0, 2.0), start=(0.0, 0.0, 0.0), bounds=((-9.0, 99.0), (-5.0, 5.0), (-1.0, 8.0))
    )
    cost = race_cost(low, RADIUS, RaceWeights(margin=0.2), 1)
    floor, mm = GAP + 0.1, 1e-3  # of the margin, at most .1 m is kept from the ground
    crashed = {
        "stands": [(0, 0, 0.11), (0, 0, 0.11)],
        "climbs": [(0, 0, 0.11), (0, 0, 0.15)],
        "lands": [(0, 0, 0.25), (0, 0, floor - mm)],
        "flies low": [(0, 0, 0.25), (0, 0, floor + mm)],
        "inside": [(0, 0, 2), (GAP - 9 + mm, 5 - GAP - mm, 8 - GAP - mm)],
        "left": [(0, 0, 2), (0, 5 - GAP + mm, 2)],
        "right": [(0, 0, 2), (0, GAP - 5 - mm, 2)],
        "behind": [(0, 0, 2), (GAP - 9 - mm, 0, 2)],
        "above": [(0, 0, 2), (0, 0, 8 - GAP + mm)],
    }
    outcomes = {name: fly(cost, points)[2][0] for name, points in crashed.items()}
    assert outcomes == {
        **dict.fromkeys(crashed, 1.0),
        "stands": 0.0,
        "climbs": 0.0,
        "flies low": 0.0,
        "inside": 0.0,
    }


@pytest.mark.parametrize("name", course_names())
def test_remaining_distance_of_every_course_falls_through_its_gates(name):
    """Straight from exit to exit: what is left never rises, however the next gate faces."""
    c = load_course(name)
    high = replace(c, bounds=FAR)
    exits = [
        c.start.position,
        *(at(g, clear_of_frame(0.15, g.frame_depth), 0.0, 0.0) for g in c.gates),
    ]
    cost = race_cost(high, 0.15, replace(ONLY["progress"], margin=0.0), 1)
    for row, (a, b) in enumerate(pairwise(exits)):
        assert term("progress", cost, b, row=row) <= term("progress", cost, a, row=row) + 1e-9
        assert term("progress", cost, b, row=row + 1) <= GateTarget(*cost.targets[row]).to_go + 2e-3
