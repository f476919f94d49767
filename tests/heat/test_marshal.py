"""The marshal: contacts by the swept test, and what each set of rules makes of them."""

import pytest
from referee_cases import FAR, gate

from quadsim.course import Course, Start
from quadsim.heat.marshal import HeatReferee, Marshal, Move
from quadsim.heat.rules import RULES
from quadsim.racing.referee import CLEAR, Referee

R = 0.14
DT = 0.0025
GATES = (gate((10.0, 0.0, 10.0)), gate((20.0, 0.0, 10.0)))
COURSE = Course("test", "", GATES, Start((0.0, 0.0, 10.0), 0.0), FAR, True, 1, (), "")


def race(rules, vehicles=2):
    """Return the marshal and the referees of a race."""
    referees = [HeatReferee(Referee(COURSE, R, 9, 1e3)) for _ in range(vehicles)]
    return Marshal(RULES[rules], referees, [R] * vehicles), referees


def moves(*ways, t=1.0):
    """Return the moves of vehicles from p0 to p1 in one step that ends at t."""
    return {k: Move(t - DT, t, p0, p1) for k, (p0, p1) in enumerate(ways)}


# Two that fly towards each other: 0.2 m apart before the step and after it, 0 m within
THROUGH = (
    ((0.0, 0.0, 10.0), (0.2, 0.0, 10.0)),
    ((0.2, 0.0, 10.0), (0.0, 0.0, 10.0)),
)
# Side by side, 0.2 m apart: they touch, but their centres are farther apart than 0.1 m
BESIDE = (
    ((0.0, 0.0, 10.0), (0.1, 0.0, 10.0)),
    ((0.05, 0.2, 10.0), (0.15, 0.2, 10.0)),
)


def events(referee, t=1.0):
    return referee.observe(t - DT, (0.0, 0.0, 10.0), t, (0.1, 0.0, 10.0))


def test_elimination_puts_both_out_that_come_near_within_a_step():
    marshal, (a, b) = race("elimination")
    marshal.observe(1.0, moves(*THROUGH))
    assert (a.outcome, b.outcome) == ("crashed", "crashed")
    (event,) = events(a)
    assert (event.kind, event.vehicle, event.place) == ("contact", 2, "vehicle 2")
    # centres are 0.1 m apart a quarter of the step after its beginning
    assert event.t == pytest.approx(1.0 - 0.75 * DT)
    assert event.position[0] == pytest.approx(0.05)
    assert event.record()["vehicle"] == 2


def test_who_is_out_passes_no_gate():
    marshal, (a, _) = race("elimination")
    marshal.observe(1.0, moves(*THROUGH))
    found = a.observe(1.0 - DT, (9.9, 0.0, 10.0), 1.0, (10.1, 0.0, 10.0))
    assert [event.kind for event in found] == ["contact"]
    assert a.passed == 0
    # without the marshal's call the same step is a pass
    alone = HeatReferee(Referee(COURSE, R, 9, 1e3))
    found = alone.observe(1.0 - DT, (9.9, 0.0, 10.0), 1.0, (10.1, 0.0, 10.0))
    assert [event.kind for event in found] == ["pass"]


def test_side_by_side_is_no_contact_under_elimination_but_is_one_for_the_chaser():
    marshal, referees = race("elimination")
    marshal.observe(1.0, moves(*BESIDE))
    assert [r.outcome for r in referees] == [None, None]
    marshal, referees = race("chaser")
    marshal.observe(1.0, moves(*BESIDE))
    # the first one is farther from gate 1
    assert [r.outcome for r in referees] == ["crashed", None]
    assert [len(events(r)) for r in referees] == [1, 1]


def test_under_physics_nobody_is_out_and_a_contact_counts_once():
    marshal, referees = race("physics")
    for step in range(5):
        marshal.observe(1.0 + step * DT, moves(*BESIDE, t=1.0 + step * DT))
    assert [r.outcome for r in referees] == [None, None]
    assert [len(events(r)) for r in referees] == [1, 1]
    later = 1.0 + 4 * DT + CLEAR + DT
    marshal.observe(later, moves(*BESIDE, t=later))
    assert len(events(referees[0], later)) == 1


def test_three_at_one_place_are_all_out():
    marshal, referees = race("elimination", 3)
    here = ((0.0, 0.0, 10.0), (0.1, 0.0, 10.0))
    marshal.observe(1.0, moves(here, here, here))
    assert [r.outcome for r in referees] == ["crashed"] * 3
