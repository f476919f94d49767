"""How far along a race a vehicle is, by which the rules, results and the page compare vehicles."""

from itertools import pairwise

import numpy as np
import pytest

from quadsim.course import load_course
from quadsim.racing.along import Along, Legs

FIGURE8 = load_course("figure8")
SPLIT_S = load_course("split_s_swift")


def positions(course, laps):
    """The start and the centres of all gates of a race."""
    return [course.start.position, *(gate.position for gate in course.gates * laps)]


def test_more_gates_are_farther_whatever_the_way_to_the_next():
    assert Along(passed=2, share=0.9) < Along(passed=3, share=0.1) < Along(passed=3, share=0.2)


@pytest.mark.parametrize("course", [FIGURE8, SPLIT_S], ids=["figure8", "split_s_swift"])
def test_the_metres_of_a_race_order_vehicles_as_the_rules_do(course):
    """Anywhere in the air, with any number of gates passed, also on the wrong side of a gate."""
    rng = np.random.default_rng(0)
    laps = 2
    p = rng.uniform(-12.0, 12.0, (200, 3))
    passed = rng.integers(0, laps * len(course.gates), 200)
    legs = Legs(course, laps)
    metres = [float(legs.progress(p[k : k + 1], passed[k : k + 1])[0]) for k in range(200)]
    by_rules = [Along.of(course, int(passed[k]), tuple(p[k].tolist())) for k in range(200)]
    for (m0, a0), (m1, a1) in pairwise(zip(metres, by_rules, strict=True)):
        assert (m0 < m1) == (a0 < a1)


def test_at_a_gate_the_way_is_the_sum_of_the_legs():
    spots = np.array(positions(FIGURE8, 2))
    legs = Legs(FIGURE8, 2)
    passed = np.arange(len(spots))
    assert np.allclose(legs.progress(spots, passed), legs.ends)
    assert legs.lap_ends.tolist() == [legs.ends[8], legs.ends[16]]


def test_on_the_detour_after_a_gate_the_one_farther_on_is_ahead():
    """Behind gate 4 of the split S the next gate lies back and below: both fly away from it."""
    gate = SPLIT_S.gates[3]
    forward = np.array(gate.axes[0])
    near, far = (tuple((np.array(gate.position) + s * forward).tolist()) for s in (1.0, 3.0))
    to_next = [
        float(np.linalg.norm(np.subtract(SPLIT_S.gates[4].position, p))) for p in (near, far)
    ]
    assert to_next[0] < to_next[1]
    assert Along.of(SPLIT_S, 4, near) < Along.of(SPLIT_S, 4, far)


def test_on_the_grid_the_one_nearer_to_the_first_gate_is_ahead():
    """A second row stands behind the start, as far from it as the vehicle that has started."""
    start, gate = np.array(FIGURE8.start.position), np.array(FIGURE8.gates[0].position)
    forward = (gate - start) / np.linalg.norm(gate - start)
    behind, at_start, ahead = (tuple((start + s * forward).tolist()) for s in (-1.0, 0.0, 1.0))
    shares = [Along.of(FIGURE8, 0, p).share for p in (behind, at_start, ahead)]
    assert shares == sorted(shares)
    assert shares[0] < 0.0 == pytest.approx(shares[1])
