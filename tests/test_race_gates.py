"""How the racing cost counts gates, distance and crashes inside a rollout."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from race_cases import ALL, DT, FAR, ONLY, RADIUS, ROW, WIDTH, course, fly, gate, straight, term, through

from controllers.costs.race import RUN_OUT, TERMS, RaceWeights, race_cost
from quadsim.course import course_names, load_course
from quadsim.referee import Referee


def remaining(cost, points):
    return fly(cost, points)[0][:, 0]


@pytest.mark.parametrize("speed", [3.0, 10.0, 30.0])
def test_remaining_distance_falls_along_a_straight_flight_by_the_distance_flown(speed):
    cost, step = race_cost(ROW, RADIUS, ONLY["progress"], 1), speed * DT
    left = remaining(cost, straight((0.03, 0, 20), (18, 0, 20), speed))
    assert np.all(np.diff(left) < 0)
    assert np.all(np.diff(left) > -2.1 * step)  # the step that passes a gate is counted up to its centre
    assert left[0] - left[-1] == pytest.approx(18 - 0.03 - step, abs=0.01)


@pytest.mark.parametrize("yaw", [0.0, 60.0, 120.0, 180.0])
def test_remaining_distance_is_continuous_where_a_gate_is_passed(yaw):
    """Also where the next gate faces away, so that the way there leads round it."""
    cost = race_cost(course(gate(5.0), gate(8.0, 1.0, yaw=yaw)), RADIUS, ONLY["progress"], 1)
    left = remaining(cost, straight((4, 0, 20), (6, 0, 20)))
    assert abs(np.diff(left)).max() < 0.25


@pytest.mark.parametrize("phase", np.linspace(0.0, 0.29, 7))
def test_gates_crossed_between_two_steps_at_30_mps_count(phase):
    _, rows, crashed = fly(race_cost(ROW, RADIUS, ALL, 1), straight((phase, 0.5, 20.3), (18 + phase, 0.5, 20.3), 30.0))
    assert (rows[-1], crashed[-1]) == (3, 0.0)


@pytest.mark.parametrize("angles", [(0.0, 0.0, 0.0), (130.0, 0.0, 0.0), (-40.0, 25.0, 30.0)])
@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("margin", [0.0, 0.2])
def test_a_millimetre_decides(angles, side, axis, margin):
    """Free opening: half - radius - margin. Frame: half + width + radius + margin."""
    g = gate(5.0, 1.0, 20.0, *angles)
    cost, half = race_cost(course(g), RADIUS, replace(ALL, margin=margin), 1), g.opening[axis] / 2
    outcomes = []
    for edge in (half - RADIUS - margin, half + WIDTH + RADIUS + margin):
        for offset in (edge - 1e-3, edge + 1e-3):
            _, rows, crashed = fly(cost, through(g, *np.roll((side * offset, 0.1), axis)))
            outcomes.append((rows[0], crashed[0]))
    assert outcomes == [(1, 0.0), (0, 1.0), (0, 1.0), (0, 0.0)]


@pytest.mark.parametrize("axis", [0, 1])
def test_gate_is_judged_where_its_plane_is_crossed_within_a_step(axis):
    """Slanted steps that cross the plane three quarters of their way: one inside and on outside, one the other way."""
    cost, half = race_cost(ROW, RADIUS, ALL, 1), ROW.gates[0].opening[axis] / 2
    rows = []
    for side, end in ((1, half + 0.05), (-1, -half - 0.05), (1, half - 0.2), (-1, 0.2 - half)):
        inwards = abs(end) < half
        start = end + side * (0.8 if inwards else -0.8)  # at the plane: .2 from the end
        a, b = (np.add(ROW.gates[0].position, (x, *np.roll((o, 0.0), axis))) for x, o in ((-0.3, start), (0.1, end)))
        rows.append(fly(cost, [a, b])[1][0])
    assert rows == [1, 1, 0, 0]


def test_narrow_gate_keeps_two_fifths_of_its_room():
    g = gate(5.0, opening=(0.6, 0.6))  # .2 m of room: no place for a margin of .25
    cost = race_cost(course(g), RADIUS, RaceWeights(margin=0.25), 1)
    assert [fly(cost, through(g, y, 0.0))[1][0] for y in (0.079, 0.081)] == [1, 0]


def test_crash_is_latched_and_paid_at_every_later_step():
    cost = race_cost(ROW, RADIUS, ONLY["crash"], 1)
    q, _, crashed = fly(cost, straight((0.03, 1.1, 20), (8, 1.1, 20)) + straight((8.1, 0, 20), (12, 0, 20)))
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
    assert outcomes == {"wrong way": (0, 1.0), "clipped from behind": (0, 1.0), "miss": (0, 0.0), "back": (0, 0.0)}


def test_beyond_a_missed_gate_the_way_leads_back_round_it():
    cost = race_cost(ROW, RADIUS, ONLY["progress"], 1)

    def left(x, y):
        return term("progress", cost, (x, y, 20.0))

    assert left(5.1, 3.0) > left(4.9, 3.0) + 1.0  # missing costs
    assert left(6.0, 3.0) < left(7.0, 3.0)  # flying on costs more
    assert left(5.1, 3.0) < left(6.0, 3.0)  # turning back less
    front = left(3.0, 0.0)  # as far in front of the gate as its larger opening, 2 m
    assert left(6.0, 4.0) == pytest.approx(np.hypot(3.0, 4.0) + front, abs=0.01)
    assert np.all(np.diff([left(4.0, y) for y in (3.0, 2.0, 1.0, 0.0)]) < 0)


def test_flying_on_after_the_finish_is_progress():
    cost = race_cost(ROW, RADIUS, ONLY["progress"], 1)
    left = remaining(cost, straight((0.03, 0, 20), (30, 0, 20)))
    assert np.all(np.diff(left)[150:] < 0)
    assert left[-1] == pytest.approx(15 + RUN_OUT - 30, abs=0.01)
    assert term("progress", cost, (20, 0, 20), row=3) < term("progress", cost, (19, 0, 20), row=3)
    assert term("progress", cost, (20, 0, 20), row=3) < term("progress", cost, (20, 5, 20), row=3)


def test_laps_follow_each_other_without_a_seam():
    loop = course(gate(5.0), gate(10.0, 5.0, yaw=90), gate(5.0, 10.0, yaw=180), gate(0.0, 5.0, yaw=270), loop=True)
    aims = race_cost(loop, RADIUS, ALL, 3).aims
    assert len(aims) == 3 * 4 + 1
    np.testing.assert_array_equal(aims[4:8, :13], aims[:4, :13])
    np.testing.assert_allclose(np.diff(aims[:12, 13]), -np.hypot(5, 5))
    np.testing.assert_allclose(aims[4, 15:], (np.sqrt(0.5), -np.sqrt(0.5), 0.0, np.hypot(5, 5)))  # leg from gate 4
    late = race_cost(loop, RADIUS, ALL, 3).aims_from(8)
    np.testing.assert_allclose(late[:4, 13], aims[8:12, 13] - aims[8, 13], rtol=1e-6)


def test_leaving_the_bounds_or_coming_down_is_a_crash_and_starting_on_the_ground_is_none():
    low = course(gate(50.0, 0.0, 2.0), start=(0.0, 0.0, 0.0), bounds=((-9.0, 99.0), (-5.0, 5.0), (-1.0, 8.0)))
    cost = race_cost(low, RADIUS, RaceWeights(margin=0.2), 1)
    edge = 5.0 - RADIUS - 0.2
    crashed = {
        "stands": [(0, 0, 0.11), (0, 0, 0.11)],
        "climbs": [(0, 0, 0.11), (0, 0, 0.15)],
        "lands": [(0, 0, 0.25), (0, 0, 0.199)],
        "flies low": [(0, 0, 0.25), (0, 0, 0.201)],  # at most .1 m is kept from the ground
        "inside": [(0, 0, 2), (0, edge - 1e-3, 2)],
        "left": [(0, 0, 2), (0, edge + 1e-3, 2)],
        "right": [(0, 0, 2), (0, -edge - 1e-3, 2)],
        "behind": [(0, 0, 2), (-9, 0, 2)],
        "above": [(0, 0, 2), (0, 0, 7.8)],
    }
    outcomes = {name: fly(cost, points)[2][0] for name, points in crashed.items()}
    assert outcomes == {**dict.fromkeys(crashed, 1.0), "stands": 0.0, "climbs": 0.0, "flies low": 0.0, "inside": 0.0}


def test_without_a_margin_the_cost_passes_and_crashes_as_the_referee_judges():
    """Flights straight through a tilted gate's plane at random places."""
    rng, g = np.random.default_rng(0), gate(5.0, 1.0, 20.0, 40, 20, 15)
    one, seen = course(g), set()
    cost = race_cost(one, RADIUS, ALL, 1)
    for y, z in rng.uniform(-2, 2, (300, 2)):
        a, b = (tuple(p.tolist()) for p in through(g, y, z))
        kinds = {e.kind for e in Referee(one, RADIUS, 1, 9.0).observe(0.0, a, DT, b)} & {"pass", "hit"}
        _, rows, crashed = fly(cost, [a, b])
        assert kinds == ({"pass"} if rows[0] else set()) | ({"hit"} if crashed[0] else set())
        seen |= kinds or {"neither"}
    assert seen == {"pass", "hit", "neither"}


@pytest.mark.parametrize("name", course_names())
def test_remaining_distance_of_every_course_falls_through_its_gates(name):
    """Straight from centre to centre: what is left never rises, however the next gate faces."""
    c = load_course(name)
    high = replace(c, bounds=FAR)
    centres = [c.start.position, *(g.position for g in c.gates)]
    cost = race_cost(high, 0.05, replace(ONLY["progress"], margin=0.0), 1)
    for row, (a, b) in enumerate(pairwise(centres)):
        assert term("progress", cost, b, row=row) <= term("progress", cost, a, row=row) + 1e-9
        assert term("progress", cost, b, row=row + 1) <= cost.aims[row, 13] + 2e-3
