"""Switches are put where ARM is on and the sticks command body rates."""

import pytest

from quadsim.firmware.switches import conditions_of, modes_on, switches_of
from quadsim.firmware.translation import ConfigurationError

ARM = "aux 0 0 0 1700 2100 0 0"


def switches(*lines):
    """Return the switches of lines as the firmware prints them."""
    return switches_of(conditions_of("\n".join(lines)), "mine.txt")


def moved(*lines):
    """Return {AUX number: (before arming, in flight)} of the channels that leave their low end."""
    pairs = switches(*lines).pairs
    return {n: pair for n, pair in enumerate(pairs, 1) if pair != (1000.0, 1000.0)}


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ((ARM,), {1: (1000.0, 1900.0)}),
        # Pilots have ANGLE at the low end, HORIZON in the middle.
        (
            (ARM, "aux 1 1 1 900 1300 0 0", "aux 2 2 1 1300 1700 0 0"),
            {1: (1000.0, 1900.0), 2: (1900.0, 1900.0)},
        ),
        # FLIP OVER AFTER CRASH at the high end
        ((ARM, "aux 1 35 1 1700 2100 0 0"), {1: (1000.0, 1900.0)}),
        # PREARM is held before and after; AIR MODE is on
        (
            (ARM, "aux 1 36 1 1700 2100 0 0", "aux 2 28 2 1500 2100 0 0"),
            {1: (1000.0, 1900.0), 2: (1900.0, 1900.0), 3: (1800.0, 1800.0)},
        ),
        # PREARM in the middle of the switch of ARM
        (
            (ARM, "aux 1 36 0 1300 2100 0 0"),
            {1: (1500.0, 1900.0)},
        ),
        # ARM at the low end
        (("aux 0 0 0 900 1300 0 0",), {1: (1700.0, 1000.0)}),
        # ARM by two switches
        (
            ("aux 0 0 0 1700 2100 1 0", "aux 1 0 1 1300 1700 1 0"),
            {1: (1000.0, 1900.0), 2: (1000.0, 1500.0)},
        ),
        # HORIZON follows ANGLE
        (
            (ARM, "aux 1 1 1 900 1300 0 0", "aux 2 2 0 900 900 0 1"),
            {1: (1000.0, 1900.0), 2: (1700.0, 1700.0)},
        ),
        # AIR MODE only where ANGLE is: without
        ((ARM, "aux 1 1 1 1700 2100 0 0", "aux 2 28 1 1700 2100 0 0"), {1: (1000.0, 1900.0)}),
        # a mode that decides nothing stays off
        ((ARM, "aux 1 13 1 1700 2100 0 0"), {1: (1000.0, 1900.0)}),
        # conditions that are not configured
        ((ARM, "aux 1 0 0 900 900 0 0"), {1: (1000.0, 1900.0)}),
    ],
)
def test_each_switch_is_where_it_can_fly(lines, expected):
    found = moved(*lines)
    if "aux 1 0 1 1300 1700 1 0" in lines:  # either of the two switches disarms
        conditions = conditions_of("\n".join(lines))
        idle, flight = (dict(enumerate(p)) for p in switches(*lines)[:2])
        assert 0 in modes_on(conditions, flight)
        assert 0 not in modes_on(conditions, idle)
        return
    assert found == expected


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ((), "expected a switch for ARM"),
        ((ARM, "aux 1 1 1 900 2100 0 0"), "with ARM on and ANGLE off"),
        ((ARM, "aux 1 1 0 1700 2100 0 0"), "with ARM on and ANGLE off"),
        ((ARM, "aux 1 36 0 900 1300 0 0"), "with ARM and PREARM on"),
        (("aux 0 0 0 900 2100 0 0",), "with ARM off, from which it is armed"),
        ((ARM, "aux 1 0 1 900 900 0 28"), "expected ARM to follow no other mode"),
        (
            (ARM, "aux 1 1 1 900 1500 0 0", "aux 2 2 1 1500 2100 0 0"),
            "ANGLE and HORIZON off",
        ),
    ],
)
def test_switches_that_cannot_fly_are_one_line(lines, said):
    with pytest.raises(ConfigurationError) as caught:
        switches(*lines)
    assert str(caught.value).startswith("mine.txt: expected ")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("logics", "held", "expected"),
    [
        ((0, 0), (True, False), True),
        ((1, 1), (True, False), False),
        ((1, 1), (True, True), True),
        ((0, 1), (True, False), True),
        ((1, 0), (False, True), True),
        ((1, 0), (True, False), True),
        ((1,), (False,), False),
    ],
)
def test_conditions_are_joined_as_the_firmware_joins_them(logics, held, expected):
    """One that holds is enough, or all those with the logic 1."""
    lines = [f"aux {k} 1 {k} 1700 2100 {logic} 0" for k, logic in enumerate(logics)]
    positions = {k: 1900.0 if holds else 1000.0 for k, holds in enumerate(held)}
    assert (1 in modes_on(conditions_of("\n".join(lines)), positions)) is expected
