"""The time to go of whole courses: beside the limits, and its derivatives."""

from dataclasses import replace

import numpy as np
import pytest

from quadsim.config.spec import Spec
from quadsim.limit.limits import LimitProblem
from quadsim.value import PointMass, passages_of, value_of_course, value_of_passages

RACES = {
    "split_s_swift": {},
    "split_s_song": {"vehicle": "cpc", "thrust_to_weight": 3.3, "laps": 2},
    "alphapilot": {"vehicle": "flightmare", "thrust_to_weight": 6.4},
}
FIGURE8 = Spec.of("figure8", laps=1)


@pytest.fixture(scope="module")
def figure8():
    return value_of_course(FIGURE8.course, FIGURE8.vehicle, 1)


@pytest.mark.slow
@pytest.mark.parametrize("course", RACES)
def test_a_point_mass_is_a_little_faster_than_the_limit(course):
    spec = Spec.of(course, **RACES[course])
    limit = LimitProblem.of(spec.course, spec.vehicle, spec.laps).best_known()
    value = value_of_course(spec.course, spec.vehicle, spec.laps)
    assert 0.92 < value.time / limit.time < 0.97


@pytest.mark.slow
def test_the_way_does_not_depend_on_the_draws(figure8, monkeypatch):
    monkeypatch.setattr("quadsim.value.course_value.DRAWN", 80)
    other = value_of_course(FIGURE8.course, FIGURE8.vehicle, 1)
    assert other.time == pytest.approx(figure8.time, rel=1e-3)


@pytest.mark.slow
def test_more_thrust_is_faster(figure8):
    start = FIGURE8.course.start.position
    mass = figure8.mass
    times = [
        value_of_passages(figure8.passages, start, PointMass(share * mass.thrust, mass.drag)).time
        for share in (0.8, 1.25)
    ]
    assert times[0] > figure8.time > times[1]


def test_crossings_are_within_the_openings_and_forward(figure8):
    assert np.all(np.abs(figure8.crossings[:, :2]) <= figure8.passages.half + 1e-9)
    assert np.all(figure8.crossings[:, 2] > 0.0)
    assert np.all(np.diff(figure8.to_go) < 0.0)
    assert figure8.to_go[-1] == 0.0


@pytest.mark.slow
def test_slopes_are_those_of_the_time_from_other_crossings(figure8):
    """A race that begins at a gate, as fast as the best way is there, is the rest of the race."""
    k = 2
    rest = replace(
        figure8.passages,
        position=figure8.passages.position[k + 1 :],
        rotation=figure8.passages.rotation[k + 1 :],
        half=figure8.passages.half[k + 1 :],
    )
    step = np.array([0.05, 0.05, 0.5, 0.5, 0.5])
    for axis in range(5):
        times = []
        for sign in (-1.0, 1.0):
            crossing = figure8.crossings[k].copy()
            crossing[axis] += sign * step[axis]
            begin = figure8.passages.states(crossing, k)
            times.append(value_of_passages(rest, begin.position, figure8.mass, begin.velocity).time)
        slope = (times[1] - times[0]) / (2.0 * step[axis])
        assert slope == pytest.approx(figure8.slope[k, axis], abs=2e-3)


def test_openings_are_smaller_by_the_radius():
    wide, narrow = (passages_of(FIGURE8.course, radius, 1).half for radius in (0.0, 0.1))
    np.testing.assert_allclose(wide - narrow, 0.1)


def test_path_begins_at_rest_and_leads_through_the_crossings(figure8):
    start = np.array(FIGURE8.course.start.position)
    way = figure8.path(start, points=10)
    np.testing.assert_allclose(way.velocity[0], 0.0)
    at = figure8.passages.states(figure8.crossings)
    np.testing.assert_allclose(way.position[10::10], at.position, atol=1e-9)
    np.testing.assert_allclose(way.velocity[10::10], at.velocity, atol=1e-9)
