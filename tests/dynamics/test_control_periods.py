"""Control periods between calls of a controller, late ones included."""

from itertools import pairwise

import pytest

from quadsim.dynamics.control_periods import ControlPeriods

DT = 0.01


def counted(times):
    periods = ControlPeriods(DT)
    return [periods.advance(t) for t in times]


def test_calls_on_time_are_one_period_apart_whatever_rounding_does_to_their_instants():
    assert counted([k * DT for k in range(1000)]) == [0] + [1] * 999


def test_no_time_has_passed_at_the_first_call_and_at_the_same_instant():
    assert counted([3.0, 3.0, 3.0 + DT]) == [0, 0, 1]


def test_a_late_call_counts_at_least_one_period():
    """Half a period lies between two whole numbers, of which rounding may take either."""
    late = [0.0, 0.015, 0.025, 0.035, 0.045, 0.055]
    assert all(count >= 1 for count in counted(late)[1:])


def test_counts_of_late_calls_add_up_to_the_time_that_has_passed():
    times = [k * 0.0137 for k in range(200)]
    assert sum(counted(times)) == round(times[-1] / DT)
    assert sum(max(round((b - a) / DT), 1) for a, b in pairwise(times)) == 199, (
        "differences that are rounded one by one do not"
    )


def test_the_next_call_is_due_one_period_after_the_last():
    periods = ControlPeriods(DT)
    assert periods.next == 0.0
    periods.advance(2.0)
    assert periods.next == pytest.approx(2.01)
