"""The tracks of level 3 obey the rules of their environment, and a number is always one track."""

from math import dist, pi

import numpy as np
import pytest

from quadsim.course import load_course
from quadsim.course.lsy_tracks import ARENA, BORDER, HEIGHTS, TURN
from quadsim.files.strict_yaml import FileError

TRACKS = [load_course(f"lsy_level3-{k}") for k in range(12)]
MILLIMETRE = 0.002


@pytest.mark.slow
def test_gates_and_poles_keep_their_distances():
    for course in TRACKS:
        gates = [gate.position[:2] for gate in course.gates]
        poles = [pole.base[:2] for pole in course.obstacles]
        start = course.start.position[:2]
        assert [gate.position[2] for gate in course.gates] == list(HEIGHTS)
        assert (np.abs([*gates, *poles]) <= ARENA - BORDER + MILLIMETRE).all()
        for k, gate in enumerate(gates):
            assert all(dist(gate, other) > 1.0 - MILLIMETRE for other in (start, *gates[:k]))
            assert all(dist(gate, pole) > 0.8 - MILLIMETRE for pole in poles[: k + 1])
        for k, pole in enumerate(poles):
            assert all(dist(pole, other) > 0.3 - MILLIMETRE for other in poles[:k])


def test_a_gate_looks_along_the_leg_that_leads_to_it():
    turns = []
    for course in TRACKS:
        before = course.start.position
        for gate in course.gates:
            leg = np.subtract(gate.position, before)
            off = gate.yaw - np.arctan2(leg[1], leg[0])
            turns.append(abs((off + pi) % (2 * pi) - pi))
            before = gate.position
    assert 0.8 * TURN < max(turns) < TURN + 0.01


def test_a_number_is_one_track():
    again = load_course("lsy_level3-3")
    assert again == TRACKS[3]
    assert again.name == "lsy_level3-3"
    assert len({course.text for course in TRACKS}) == len(TRACKS)
    with pytest.raises(FileError, match="no course 'lsy_level3'"):
        load_course("lsy_level3")
