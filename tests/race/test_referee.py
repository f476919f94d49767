"""Crossings and clips whose verdict is known in advance: level, stacked and turned gates."""

from dataclasses import replace
from math import cos, pi, sin

import numpy as np
import pytest
from referee_cases import DT, HALF, WIDTH, R, fly, gate, kinds, make_referee, straight, through

from quadsim.course import FRAME_DEPTH, Gate

# Crossings


@pytest.mark.parametrize("phase", [0.0, 0.1, 0.37, 0.99])
def test_crossing_at_30_m_s_is_timed_to_a_nanosecond(phase):
    v = np.array([30.0 * cos(0.2), 30.0 * sin(0.2), 1.5])
    t_cross = (12.0 + phase) * DT
    path = np.array([0.0, 0.1, 10.2]) + np.outer(np.arange(40) * DT - t_cross, v)
    (event,) = fly(make_referee(gate()), [tuple(p) for p in path.tolist()])
    assert event.kind == "pass"
    assert event.t == pytest.approx(t_cross, abs=1e-9)
    assert event.offset == pytest.approx((0.1, 0.2), abs=1e-9)
    assert event.position == pytest.approx((0.0, 0.1, 10.2), abs=1e-9)
    assert event.speed == pytest.approx(np.linalg.norm(v), rel=1e-9)


def test_step_that_ends_exactly_on_the_plane_counts_once():
    referee = make_referee(gate(), gate((50.0, 0.0, 10.0)), laps=2)
    assert kinds(fly(referee, [(-0.1, 0.0, 10.0), (0.0, 0.0, 10.0), (0.1, 0.0, 10.0)])) == [
        ("pass", 1)
    ]


SIDES = {"left": (1, 0), "right": (-1, 0), "top": (0, 1), "bottom": (0, -1)}


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("spare", [1e-3, -1e-3])
def test_one_millimetre_decides_between_pass_and_hit(side, spare):
    y, z = (s * (h - R - spare) for s, h in zip(SIDES[side], HALF, strict=True))
    events = fly(make_referee(gate()), through(y, 10.0 + z))
    assert kinds(events) == [("pass" if spare > 0 else "hit", 1)]


def test_clip_is_called_where_the_sphere_meets_the_bar_not_at_the_plane():
    (hit,) = fly(make_referee(gate()), through(y=HALF[0]))
    assert hit.position[0] == pytest.approx(-FRAME_DEPTH / 2 - R, abs=1e-9)


def test_oblique_pass_that_clips_a_bar_behind_the_plane_is_a_pass_and_then_a_hit():
    slope = 0.5
    path = straight(
        (-2.0, HALF[0] - R - 0.02 - 2 * slope, 10.0), (2.0, HALF[0] - R - 0.02 + 2 * slope, 10.0)
    )
    events = fly(make_referee(gate(), gate((50.0, 0.0, 10.0))), path)
    assert kinds(events) == [("pass", 1), ("hit", 1)]
    assert events[1].offset[0] == pytest.approx(HALF[0] - R, abs=1e-9)


@pytest.mark.parametrize("back", [False, True])
def test_frame_of_a_gate_that_is_not_next_is_hit_in_either_direction(back):
    referee = make_referee(gate((50.0, 0.0, 10.0)), gate())
    assert kinds(fly(referee, through(y=HALF[0] + 0.1, back=back))) == [("hit", 2)]
    assert referee.outcome == "crashed"


def test_one_fast_step_across_a_bar_is_a_hit():
    assert kinds(fly(make_referee(gate()), [(-1.0, 0.9, 10.0), (1.0, 0.9, 10.0)])) == [("hit", 1)]


def test_opening_flown_backward_is_the_wrong_way_and_forward_is_nothing_unless_next():
    referee = make_referee(gate((50.0, 0.0, 10.0)), gate())
    assert kinds(fly(referee, through(back=True))) == [("wrong_way", 2)]
    assert fly(referee, through(), t=1.0) == []
    assert referee.passed == 0


def test_missed_gate_can_be_flown_back_to_and_passed():
    referee = make_referee(gate(), gate((50.0, 0.0, 10.0)))
    outside = HALF[0] + WIDTH + R + 0.01
    back = straight((2.0, outside, 10.0), (-2.0, outside, 10.0))
    events = fly(referee, through(y=outside) + back + through())
    assert kinds(events) == [("miss", 1), ("pass", 1)]
    assert referee.outcome is None


def test_far_plane_is_no_miss():
    assert fly(make_referee(gate()), through(y=3 * HALF[0] + 2.01)) == []
    assert kinds(fly(make_referee(gate()), through(y=3 * HALF[0] + 1.99))) == [("miss", 1)]


def test_two_gates_in_one_step_pass_in_order_of_crossing():
    referee = make_referee(gate(), gate((0.3, 0.0, 10.0)))
    events = fly(referee, [(-0.5, 0.0, 10.0), (0.5, 0.0, 10.0)])
    assert kinds(events) == [("pass", 1), ("pass", 2)]
    assert [e.t for e in events] == pytest.approx([0.5 * DT, 0.8 * DT], abs=1e-9)
    assert referee.outcome == "finished"


def test_two_gates_in_one_step_in_the_wrong_order_pass_only_the_next():
    referee = make_referee(gate((0.3, 0.0, 10.0)), gate())
    assert kinds(fly(referee, [(-0.5, 0.0, 10.0), (0.5, 0.0, 10.0)])) == [("pass", 1)]
    assert referee.next_gate == 1


# Stacked gates: 4 and 5 of the Split-S track, one above the other with opposite passages, frames
# overlapping by 7 cm
UPPER = Gate((-4.3, -5.6, 3.4), pi, 0.0, 0.0, (1.5, 1.5), WIDTH)
LOWER = Gate((-4.3, -5.6, 1.42), 0.0, 0.0, 0.0, (1.5, 1.5), WIDTH)


def test_split_s_through_stacked_gates_passes_both():
    referee = make_referee(UPPER, LOWER)
    turn = [(-5.5 - sin(a), -5.6, 2.41 + 0.99 * cos(a)) for a in np.linspace(0, pi, 60).tolist()]
    events = fly(
        referee,
        [*straight((-2.0, -5.6, 3.4), turn[0]), *turn, *straight(turn[-1], (-2.0, -5.6, 1.42))],
    )
    assert kinds(events) == [("pass", 1), ("pass", 2)]


def test_bar_that_stacked_gates_share_is_a_hit_of_both():
    path = straight((-2.0, -5.6, 2.41), (-6.0, -5.6, 2.41))
    events = fly(make_referee(UPPER, LOWER, penalties=True), path)
    assert [k for k in kinds(events) if k[0] == "hit"] == [("hit", 1), ("hit", 2)]


def test_upper_opening_taken_for_the_lower_one_is_a_miss_and_the_wrong_way():
    referee = make_referee(LOWER, UPPER)
    events = fly(referee, straight((-6.0, -5.6, 3.4), (-2.0, -5.6, 3.4)))
    assert sorted(kinds(events)) == [("miss", 1), ("wrong_way", 2)]


def test_coplanar_gate_that_becomes_next_within_the_step_is_not_missed():
    twin = replace(LOWER, yaw=pi)
    referee = make_referee(UPPER, twin)
    assert kinds(fly(referee, straight((-2.0, -5.6, 3.4), (-6.0, -5.6, 3.4)))) == [("pass", 1)]


# Turned gates


def turn(rng):
    """A random rotation and the yaw, pitch, roll of R times a gate's own rotation."""
    m, r = np.linalg.qr(rng.standard_normal((3, 3)))
    m *= np.sign(np.diag(r))
    return m if np.linalg.det(m) > 0 else -m


def angles(m):
    return np.arctan2(m[1, 0], m[0, 0]), -np.arcsin(m[2, 0]), np.arctan2(m[2, 1], m[2, 2])


def moved(g, m, shift):
    yaw, pitch, roll = (float(a) for a in angles(m @ g.rotation))
    return replace(
        g, position=tuple((m @ g.position + shift).tolist()), yaw=yaw, pitch=pitch, roll=roll
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_rigid_motion_of_course_and_path_changes_nothing(seed):
    rng = np.random.default_rng(seed)
    gates = [gate((4.0 * k, 0.0, 10.0), *rng.uniform(-0.4, 0.4, 3).tolist()) for k in range(4)]
    path = np.array(straight((-2.0, 0.0, 10.0), (14.0, 0.0, 10.0), speed=15.0))
    path[:, 1:] += rng.uniform(0.05, 1.0) * np.sin(path[:, :1] + rng.uniform(0, 6, 2))
    m, shift = turn(rng), rng.uniform(-20, 20, 3) + np.array([0.0, 0.0, 500.0])
    here = fly(make_referee(*gates, penalties=True), [tuple(p) for p in path.tolist()])
    there = make_referee(*(moved(g, m, shift) for g in gates), penalties=True)
    there = fly(there, [tuple(p) for p in (path @ m.T + shift).tolist()])
    assert kinds(there) == kinds(here)
    assert here
    for a, b in zip(here, there, strict=True):
        assert b.t == pytest.approx(a.t, abs=1e-9)
        assert b.offset == pytest.approx(a.offset, abs=1e-9)
        assert b.position == pytest.approx(m @ a.position + shift, abs=1e-9)


def test_pitched_gate_is_judged_in_its_own_frame_and_not_in_the_world_s():
    """A box along the world's axes would call this dive through a gate that faces down a hit."""
    dive = straight((0.6, 0.0, 12.0), (0.6, 0.0, 8.0))
    # passage down; its 1.2 m height lies along the world's x
    sideways = gate(pitch=pi / 2, yaw=0.0)
    assert kinds(fly(make_referee(sideways), dive)) == [("hit", 1)]
    assert kinds(fly(make_referee(replace(sideways, roll=pi / 2)), dive)) == [("pass", 1)]
