"""Gates and obstacles are known where they stand once they have been near, and from then on."""

import numpy as np
import pytest

from quadsim.config.settings import SettingError
from quadsim.config.spec import Spec
from quadsim.course import Start, load_course
from quadsim.physics.domain_randomization import Displacement, displaced
from quadsim.physics.plant_state import PlantState, start_state
from quadsim.sensing.known_course import KnownCourse
from quadsim.sensing.navigation import TrueState
from quadsim.streams import quadrotor_streams

MAPPED = load_course("lsy_level2")
FLOWN = displaced(MAPPED, quadrotor_streams(0).gates, Displacement(0.1, 0.1, obstacles=0.1))
FAR = (20.0, 20.0, 1.0)


def beside(place, away):
    """Return a point at a horizontal distance from a place, three metres above it."""
    x, y, z = place
    return x, y + away, z + 3.0


def test_a_gate_is_known_from_within_the_range_and_stays_known():
    known = KnownCourse(MAPPED, FLOWN, known_from=0.05)
    place = FLOWN.gates[1].position
    assert known.seen_from(FAR) is None
    assert known.seen_from(beside(place, 0.06)) is None
    course = known.seen_from(beside(place, 0.04))
    assert course.gates == (MAPPED.gates[0], FLOWN.gates[1], *MAPPED.gates[2:])
    assert course.obstacles == MAPPED.obstacles
    assert known.seen_from(FAR) is course, "and nothing is planned anew"


def test_an_obstacle_is_known_by_itself():
    known = KnownCourse(MAPPED, FLOWN, known_from=0.05)
    course = known.seen_from(beside(FLOWN.obstacles[2].base, 0.04))
    assert course.gates == MAPPED.gates
    assert course.obstacles == (*MAPPED.obstacles[:2], FLOWN.obstacles[2], MAPPED.obstacles[3])


def test_a_frame_is_known_for_all_its_passages():
    mapped = MAPPED.but(order=[1, 2, -1])
    flown = displaced(mapped, quadrotor_streams(0).gates, Displacement(0.1))
    course = KnownCourse(mapped, flown, 0.05).seen_from(flown.gates[0].position)
    assert course.gates == (flown.gates[0], mapped.gates[1], flown.gates[2])


def test_the_true_state_comes_with_the_course_as_it_is_known():
    near = PlantState(0.0, start_state(Start(FLOWN.gates[0].position, 0.0), 0.07), ())
    alone = TrueState(near, dt=0.02).now(0.0, (), 0)
    assert alone.course is None
    source = TrueState(near, 0.02, course=KnownCourse(MAPPED, FLOWN, 0.7))
    found = source.now(0.0, (), 0).course
    assert found.gates[0] == FLOWN.gates[0] != MAPPED.gates[0]
    assert np.isfinite(found.points()).all()


@pytest.mark.parametrize("beside", [{"sensing": "gates"}, {"pilot": "split_s_swift"}])
def test_a_range_that_nobody_uses_is_refused(beside):
    with pytest.raises(SettingError, match=r"^known_from: expected none beside"):
        Spec.of("split_s_swift", known_from=0.7, **beside)
