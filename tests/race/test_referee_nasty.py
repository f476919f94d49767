"""The referee at the edge of what is legal: a gate that comes again, the ground, flights that get
nowhere."""

from itertools import pairwise
from math import radians

import pytest
from referee_cases import DT, HALF, WIDTH, R, fly, gate, kinds, make_referee, straight, through

from quadsim.course import FRAME_DEPTH
from quadsim.racing.events import NO_PROGRESS
from quadsim.racing.referee import NEARER

CLEAR = FRAME_DEPTH / 2 + R  # behind the plane [m]
BESIDE = HALF[0] + WIDTH + R + 0.3


def round_the_frame(x=0.5):
    """From behind the gate back to its front, beside it."""
    return straight((x, 0.0, 10.0), (x, BESIDE, 10.0)) + straight(
        (-2.0, BESIDE, 10.0), (-2.0, 0.0, 10.0)
    )


@pytest.mark.parametrize("yaw", [0.0, 6.0, -6.0])
def test_a_gate_that_comes_twice_in_a_row_needs_two_crossings(yaw):
    referee = make_referee(gate(), gate(yaw=radians(yaw)), gate((50.0, 0.0, 10.0)), loop=False)
    assert kinds(fly(referee, through())) == [("pass", 1)]
    events = fly(referee, round_the_frame(2.0) + through(), t=1.0)
    assert [kind for kind in kinds(events) if kind[0] == "pass"] == [("pass", 2)]


def test_to_and_fro_across_the_plane_of_the_only_gate_is_one_lap():
    referee = make_referee(gate(), laps=5)
    ends = [(-CLEAR, 0.0, 10.0), (0.9 * CLEAR, 0.0, 10.0)]
    assert [kind for kind, _ in kinds(fly(referee, ends * 4))] == ["pass"] + ["wrong_way"] * 3
    assert kinds(fly(referee, [(2.0, 0.0, 10.0), *round_the_frame(2.0), *through()], t=1.0)) == [
        ("pass", 1)
    ]
    assert referee.passed == 2


def test_a_gate_may_come_several_times_a_lap():
    one, far = gate(), gate((30.0, 0.0, 10.0))
    referee = make_referee(one, far, one, far, laps=1)
    assert kinds(fly(referee, through())) == [("pass", 1)]
    assert fly(referee, through(), t=1.0) == []
    assert kinds(fly(referee, straight((28.0, 0.0, 10.0), (32.0, 0.0, 10.0)), t=2.0)) == [
        ("pass", 2)
    ]
    assert kinds(fly(referee, through(), t=3.0)) == [("pass", 3)]


def test_the_frame_of_a_gate_that_comes_twice_is_hit_once():
    one = gate()
    referee = make_referee(one, gate((30.0, 0.0, 10.0)), one, penalties=True)
    assert [kind for kind in kinds(fly(referee, through(y=HALF[0] + 0.1))) if kind[0] == "hit"] == [
        ("hit", 1)
    ]


def test_a_vehicle_that_slides_along_the_ground_passes_no_gate():
    low = gate((0.0, 0.0, HALF[1]))
    slides, flies = make_referee(low), make_referee(low)
    assert kinds(fly(slides, through(z=R + 0.001))) == [("miss", 1)]
    assert kinds(
        fly(flies, straight((-3.0, 0.0, R + 0.001), (-2.0, 0.0, 0.5)) + through(z=0.5))
    ) == [("pass", 1)]


def test_a_flight_that_gets_no_nearer_for_five_seconds_is_stuck_before_its_gate():
    referee = make_referee(gate((20.0, 0.0, 10.0)), gate((40.0, 0.0, 10.0)))
    near = straight((0.0, 0.0, 10.0), (15.0, 0.0, 10.0), speed=10.0)
    assert fly(referee, near) == []
    t, circle = (
        len(near) * DT,
        straight((15.0, 0.0, 10.0), (12.0, 3.0, 10.0), 5.0) + [(12.0, 3.0, 10.0)] * 3000,
    )
    (event,) = fly(referee, circle, t=t)
    assert (event.kind, event.gate, referee.outcome) == ("stuck", 1, "stuck")
    assert event.t == pytest.approx(t + NO_PROGRESS, abs=0.05)


def test_creeping_is_progress():
    referee = make_referee(gate((20.0, 0.0, 10.0)))
    creep = straight((0.0, 0.0, 10.0), (4 * NEARER, 0.0, 10.0), speed=1.5 * NEARER / NO_PROGRESS)
    assert len(creep) * DT > 2 * NO_PROGRESS
    assert fly(referee, creep) == []


def test_the_way_round_a_gate_that_faces_away_is_progress():
    """At 1 m/s, which takes longer than the five seconds; straight to the centre it would be none
    for long."""
    referee = make_referee(gate(yaw=radians(180.0)))
    corners = [(-2.0, 0.0, 10.0), (-2.0, BESIDE, 10.0), (2.0, BESIDE, 10.0), (2.0, 0.0, 10.0)]
    assert fly(referee, [p for a, b in pairwise(corners) for p in straight(a, b, 1.0)]) == []


def test_an_opening_too_near_to_the_ground_for_the_vehicle_is_refused():
    with pytest.raises(
        ValueError, match=r"gates\[0\]: expected an opening that is free 0.21 m above .* got 0.05 m"
    ):
        make_referee(gate((0.0, 0.0, 0.05), pitch=radians(90.0)))
