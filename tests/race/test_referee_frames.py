"""One physical frame is one frame, however the passes through it are written."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from referee_cases import HALF, WIDTH, R, fly, gate, make_referee, straight

from quadsim.course.frames import frame_numbers, frames, same_frame
from quadsim.physics.domain_randomization import Displacement, displaced
from quadsim.streams import quadrotor_streams

HERE = gate()
THERE = replace(HERE, position=(8.0, 0.0, HERE.position[2]))
Z = HERE.position[2]


def turned(yaw=0.0, roll=0.0):
    """The frame of HERE, flown in another direction or written with other angles."""
    return replace(HERE, yaw=HERE.yaw + yaw, roll=HERE.roll + roll)


def events(gates, path, **settings):
    referee = make_referee(*gates, **settings)
    return fly(referee, path), referee


@pytest.mark.parametrize(
    "other",
    [turned(pi), turned(-pi), turned(2 * pi), turned(roll=pi), turned(3.14), turned(-3.14)],
)
def test_a_frame_is_the_same_from_both_sides_and_whatever_its_angles(other):
    assert same_frame(HERE, other)
    assert frames([HERE, THERE, other]) == (HERE, THERE)
    assert frame_numbers([HERE, THERE, other, THERE]) == (0, 1, 0, 1)


@pytest.mark.parametrize(
    "other",
    [
        replace(HERE, position=(0.0, 0.05, Z)),
        replace(HERE, yaw=0.2),
        replace(HERE, opening=(HERE.opening[0] + 0.1, HERE.opening[1])),
        replace(HERE, frame_width=HERE.frame_width + 0.05),
    ],
)
def test_frames_that_stand_apart_or_differ_in_size_are_two(other):
    assert len(frames([HERE, other])) == 2


def test_a_legal_pass_of_a_frame_that_is_flown_both_ways_is_no_wrong_way():
    there = straight((-3.0, 0.0, Z), (10.0, 0.0, Z))
    back = straight((10.0, 0.0, Z), (-3.0, 0.0, Z))
    found, referee = events([HERE, THERE, turned(pi)], [*there, *back[1:]])
    assert [(e.kind, e.gate) for e in found if e.gate in (1, 3)] == [("pass", 1), ("pass", 3)]
    assert referee.outcome == "finished"


def test_the_wrong_side_of_the_next_pass_is_still_wrong():
    """After the first gate the frame is next from behind; it is flown from the front again."""
    first = straight((-3.0, 0.0, Z), (3.0, 0.0, Z))
    round_it = straight((3.0, 9.0, Z), (-3.0, 9.0, Z))
    again = straight((-3.0, 0.0, Z), (3.0, 0.0, Z))
    found, _ = events([HERE, turned(pi)], [*first, (3.0, 9.0, Z), *round_it, *again])
    assert [e.kind for e in found if e.kind in ("pass", "wrong_way")] == ["pass", "wrong_way"]


@pytest.mark.parametrize("other", [turned(pi), turned(2 * pi)])
def test_one_touch_of_a_frame_is_one_hit(other):
    beside = HALF[0] + WIDTH / 2
    path = straight((-3.0, beside, Z), (3.0, beside, Z))
    for order in ([HERE, THERE, other], [other, THERE, HERE]):
        found, _ = events(order, path, penalties=True)
        assert [e.kind for e in found].count("hit") == 1


def test_a_displaced_frame_stays_whole():
    referee = make_referee(HERE, THERE, turned(pi))
    moved = displaced(referee.course, quadrotor_streams(3).gates, Displacement(0.5)).gates
    assert same_frame(moved[0], moved[2])
    assert not np.allclose(moved[0].position, HERE.position, atol=1e-3)
    assert R > 0
