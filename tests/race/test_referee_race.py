"""The rules of a race: how a flight ends, laps, the timed mode, contacts that the plant reports."""

from dataclasses import replace
from itertools import pairwise
from math import pi

import pytest
from referee_cases import DT, HALF, WIDTH, R, fly, gate, kinds, make_referee, straight, through

from quadsim.racing.events import PENALTY, flown_laps, lap_penalties, sector_times

# The ends of a flight


def test_start_on_the_ground_is_no_crash_and_landing_later_is():
    referee = make_referee(gate())
    assert fly(referee, [(5.0, 0.0, R)] * 50) == []
    assert fly(referee, straight((5.0, 0.0, R), (5.0, 0.0, R + 0.09), speed=1.0)) == []
    assert fly(referee, straight((5.0, 0.0, R + 0.09), (5.0, 0.0, R), speed=1.0)) == []
    assert fly(referee, straight((5.0, 0.0, R), (5.0, 0.0, 1.0), speed=1.0)) == []
    (event,) = fly(referee, straight((5.0, 0.0, 1.0), (5.0, 0.0, -0.1), speed=5.0))
    assert (event.kind, event.gate, referee.outcome) == ("ground", 0, "crashed")
    assert event.position[2] == pytest.approx(R, abs=2e-3)


def test_leaving_the_bounds_ends_the_flight_where_it_crosses_them():
    referee = make_referee(gate(), bounds=((-5.0, 5.0), (-5.0, 5.0), (0.0, 20.0)))
    (event,) = fly(referee, straight((0.0, 4.0, 15.0), (0.0, 6.0, 15.0)))
    assert (event.kind, referee.outcome) == ("bounds", "crashed")
    assert event.position[1] == pytest.approx(5.0, abs=1e-9)


def test_start_below_the_bounds_may_climb_into_them():
    referee = make_referee(gate(), bounds=((-5.0, 5.0), (-5.0, 5.0), (0.5, 20.0)))
    assert fly(referee, straight((0.0, 4.0, 0.2), (0.0, 4.0, 3.0))) == []


def test_plant_that_blows_up_is_out_of_bounds():
    referee = make_referee(gate())
    (event,) = referee.observe(0.0, (5.0, 0.0, 1.0), DT, (float("nan"), 0.0, 1.0))
    assert (event.kind, event.position, referee.outcome) == ("bounds", (5.0, 0.0, 1.0), "crashed")


def test_timeout_ends_the_flight_at_its_second_unless_the_race_is_over():
    referee = make_referee(gate(), timeout=0.051)
    (event,) = fly(referee, [(5.0, 0.0, 10.0)] * 60)
    assert (event.kind, event.t, referee.outcome) == ("timeout", pytest.approx(0.051), "timeout")
    referee = make_referee(gate(), timeout=0.0755)
    assert [e.kind for e in fly(referee, through())] == ["pass"]
    assert referee.outcome == "finished"


def test_no_event_follows_the_end():
    referee = make_referee(gate())
    fly(referee, through())
    assert referee.outcome == "finished"
    assert fly(referee, through(y=HALF[0], back=True), t=1.0, contacts=("gate 1",)) == []


# Laps

SQUARE = [
    gate((10.0, 0.0, 10.0)),
    gate((20.0, 10.0, 10.0), pi / 2),
    gate((10.0, 20.0, 10.0), pi),
    gate((0.0, 10.0, 10.0), -pi / 2),
]
CORNERS = [(0.0, 0.0, 10.0), (20.0, 0.0, 10.0), (20.0, 20.0, 10.0), (0.0, 20.0, 10.0)]


def test_laps_end_at_the_last_gate_and_sum_to_the_race():
    referee = make_referee(*SQUARE, laps=3)
    corners = [*CORNERS * 3, CORNERS[0]]
    events = fly(referee, [p for a, b in pairwise(corners) for p in straight(a, b, 20.0)[:-1]])
    assert referee.outcome == "finished"
    assert [e.lap for e in events] == [1] * 4 + [2] * 4 + [3] * 4
    laps, sectors = flown_laps(events, 3), sector_times(events)
    assert laps == pytest.approx([3.5, 4.0, 4.0])
    assert sum(laps) == pytest.approx(events[-1].t)
    assert sectors[0] == pytest.approx([0.5, 1.0, 1.0, 1.0])
    assert [sum(lap) for lap in sectors] == pytest.approx(laps)


def test_open_course_is_one_lap():
    referee = make_referee(gate(), gate((10.0, 0.0, 10.0)), loop=False)
    events = fly(referee, straight((-5.0, 0.0, 10.0), (12.0, 0.0, 10.0), 10.0))
    assert referee.outcome == "finished"
    assert flown_laps(events, 1) == pytest.approx([1.5])
    assert sector_times(events) == [pytest.approx([0.5, 1.0])]
    assert (referee.passed, referee.lap, events[-1].t) == (2, 1, pytest.approx(1.5))


@pytest.mark.parametrize(("laps", "loop"), [(0, True), (2, False)])
def test_laps_the_course_does_not_have_are_refused(laps, loop):
    with pytest.raises(ValueError, match=r"^test: expected .*1 lap.*, got \d$"):
        make_referee(gate(), laps=laps, loop=loop)


def test_gate_too_small_for_the_vehicle_is_refused():
    with pytest.raises(
        ValueError, match=r"gates\[1\]: expected an opening wider than .* 0\.22 m, got 0\.2 x 1 m"
    ):
        make_referee(gate(), replace(gate(), opening=(0.2, 1.0)))


# Timed mode


def test_hit_costs_seconds_and_the_gate_still_counts():
    referee = make_referee(gate(), penalties=True)
    events = fly(referee, through(y=HALF[0] + 0.1))
    assert kinds(events) == [("hit", 1), ("pass", 1)]
    assert (referee.outcome, lap_penalties(events, 1)) == ("finished", [PENALTY])


def test_centre_outside_the_frame_is_a_hit_and_a_miss():
    referee = make_referee(gate(), penalties=True)
    assert kinds(fly(referee, through(y=HALF[0] + WIDTH + R / 2))) == [("hit", 1), ("miss", 1)]


@pytest.mark.parametrize(("away", "hits"), [(0.1, 1), (0.49, 1), (0.51, 2)])
def test_new_hit_needs_half_a_second_clear_of_the_gate(away, hits):
    referee = make_referee(gate(), penalties=True)
    bar, clear = (-0.01, HALF[0], 10.0), (-1.0, HALF[0], 10.0)
    n = round(away / DT)
    events = fly(referee, [clear, bar, *[bar] * 400, clear, *[clear] * n, bar])
    assert [e.kind for e in events].count("hit") == hits


def test_penalty_belongs_to_the_lap_it_happened_in():
    referee = make_referee(*SQUARE, laps=2, penalties=True)
    corners = [*CORNERS, *((x, y, 10.6) for x, y, _ in CORNERS), (0.0, 0.0, 10.6)]
    fly(referee, [p for a, b in pairwise(corners) for p in straight(a, b, 20.0)[:-1]])
    assert referee.outcome == "finished"
    assert lap_penalties(referee.events, 2) == [0.0, 4 * PENALTY]
    assert flown_laps(referee.events, 2)[1] == pytest.approx(sum(sector_times(referee.events)[1]))


def test_ground_ends_the_timed_mode_too():
    referee = make_referee(gate(), penalties=True)
    assert kinds(fly(referee, straight((5.0, 0.0, 1.0), (5.0, 0.0, 0.0)))) == [("ground", 0)]
    assert referee.outcome == "crashed"


# Contacts that the plant reports


def test_contact_the_referee_did_not_see_is_recorded_once():
    referee = make_referee(gate(), gate((50.0, 0.0, 10.0)))
    events = fly(referee, through(), contacts=("ground", "gate 2"))
    assert kinds(events) == [("unseen_contact", 2), ("pass", 1)]


def test_contact_that_follows_a_hit_is_no_news():
    referee = make_referee(gate(), penalties=True)
    events = fly(referee, [(-1.0, HALF[0], 10.0), (-0.01, HALF[0], 10.0)])
    events += referee.observe(
        DT, (-0.01, HALF[0], 10.0), 2 * DT, (-0.3, HALF[0], 10.0), ("gate 1",)
    )
    assert kinds(events) == [("hit", 1)]
