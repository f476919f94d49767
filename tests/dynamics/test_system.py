"""A System whose numbers do not fit together is refused at once, in one line."""

from dataclasses import replace

import numpy as np
import pytest

from tests.point import POINT, State


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"low": (3.0, 0.5), "high": (-3.0, -0.5)}, "low: expected finite limits with low <= high"),
        ({"rest": (9.0, 0.5)}, "rest: expected"),
        ({"low": (-3.0,)}, "low: expected 2 numbers, one for each of ax, ay, got 1"),
        ({"rest": (0.0, 0.5, 0.0)}, "rest: expected 2 numbers"),
        ({"high": (float("nan"), 3.0)}, "low: expected finite limits"),
        ({"dt": 0.0}, "dt: expected a number of seconds > 0, got 0"),
        ({"state": dict}, "state: expected a NamedTuple"),
    ],
)
def test_numbers_that_do_not_fit_are_named(changes, problem):
    with pytest.raises(ValueError, match=r"^point: ") as error:
        replace(POINT, **changes)
    assert problem in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("given", [State(1.0, 2.0, 3.0, 4.0), [1, 2, 3, 4], np.arange(1, 5)])
def test_a_state_may_be_a_record_a_list_or_an_array(given):
    np.testing.assert_array_equal(POINT.checked_state(given), [1.0, 2.0, 3.0, 4.0])


@pytest.mark.parametrize("given", [None, "abcd", [1.0], np.zeros((1, 4)), [[1], 2, 3, 4], 3.0])
def test_what_is_no_state_names_the_numbers_of_a_state(given):
    with pytest.raises(ValueError, match="expected 4 numbers: px, py, vx, vy, got"):
        POINT.checked_state(given)
