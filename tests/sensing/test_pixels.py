"""The tracker: found corners are near the true ones where the expected ones are not."""

from math import radians

import numpy as np
import pytest
from small import SHORT

import quadsim
from quadsim.course import load_course
from quadsim.course.frames import frames
from quadsim.render.eye import CourseEye
from quadsim.rotation import exp, from_yaw, product, turned
from quadsim.sensing import load_sensing
from quadsim.sensing.measurements import Photo
from quadsim.sensing.nominal import Nominal
from quadsim.sensing.pixel_camera import TimedPose, row_poses
from quadsim.sensing.pixels.tracker import Tracker
from quadsim.sensing.state import FilterState

pytestmark = pytest.mark.compiled

SWIFT = load_course("split_s_swift")
GATES = frames(SWIFT.gates)
CONFIG = load_sensing("pixels").pixels
# Poses on the way to gates, and the motion at them: position [m], yaw [deg], velocity [m/s] and
# body rates [rad/s]
SEEN = (
    ((-5.0, 4.7, 0.9), -45.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ((3.0, 3.0, 1.5), 30.0, (8.0, 5.0, -3.0), (1.0, -2.0, 1.0)),
    ((1.0, -5.0, 3.0), 180.0, (-12.0, 0.0, 0.0), (-3.0, 1.0, 0.0)),
    ((-10.0, -5.5, 2.0), 0.0, (10.0, 0.0, 0.0), (3.0, 0.0, 2.0)),
)
POSITION_STD = 0.08
TURN_STD = 0.015


@pytest.fixture(scope="module")
def photos():
    """Pictures at SEEN, of moving cameras with rolling shutters, noise, and banners beside."""
    eye = CourseEye(CONFIG, np.random.SeedSequence(0), SWIFT)
    return [photo_at(eye, *seen) for seen in SEEN]


def photo_at(eye, position, yaw, velocity, rates):
    q = from_yaw(radians(yaw))
    moments = []
    for t in np.arange(-0.02, 0.021, 0.0025).tolist():
        p = np.array(position) + t * np.array(velocity)
        moments.append(TimedPose(t, (*p.tolist(), *turned(q, tuple(t * w for w in rates)))))
    return Photo(0.0, eye(*row_poses(CONFIG, 0.0, moments)))


def state_at(position, yaw, velocity, position_std, turn_std, rng):
    """Return a filter's state with errors of these standard deviations, which it knows."""
    p = np.array(position) + position_std * rng.standard_normal(3)
    q = product(from_yaw(radians(yaw)), exp((turn_std * rng.standard_normal(3)).tolist()))
    variances = np.repeat([position_std**2, 0.01, turn_std**2, 0.01, 0.01], 3)
    nominal = Nominal(0.0, tuple(p.tolist()), velocity, q)
    return FilterState(nominal, np.zeros(0), np.zeros((0, 3)), np.diag(variances))


def errors(photos, position_std, turn_std, moving=True):
    """Return the errors of expected and of found corners [px]."""
    tracker = Tracker(CONFIG, GATES)
    rng = np.random.default_rng(1)
    expected = []
    found = []
    for photo, (position, yaw, velocity, rates) in zip(photos, SEEN, strict=True):
        still = (0.0, 0.0, 0.0)
        state = state_at(position, yaw, velocity if moving else still, position_std, turn_std, rng)
        seen = tracker.tracked(photo, state, rates if moving else still)
        true, _ = CONFIG.gate_corners(GATES, position, from_yaw(radians(yaw)))
        at = true[seen.found.gates, seen.found.corners]
        found += np.linalg.norm(seen.found.pixels - at, axis=1).tolist()
        believed, _ = CONFIG.gate_corners(GATES, state.nominal.position, state.nominal.attitude)
        believed = believed[seen.found.gates, seen.found.corners]
        expected += np.linalg.norm(believed - at, axis=1).tolist()
    return np.array(expected), np.array(found)


@pytest.mark.slow
def test_corners_are_found_to_a_pixel_where_they_are_expected_some_pixels_away(photos):
    expected, found = errors(photos, POSITION_STD, TURN_STD)
    assert len(found) >= 12
    assert np.median(expected) > 4.0
    assert np.median(found) < 1.0
    assert np.mean(found > 5.0) < 0.1


def test_the_motion_while_the_rows_are_read_is_taken_into_account(photos):
    _, moving = errors(photos, 0.01, 0.002)
    _, still = errors(photos, 0.01, 0.002, moving=False)
    assert np.median(still) > 2.0 * np.median(moving)


@pytest.mark.slow
def test_a_heading_that_is_known_to_six_degrees_is_found_in_a_picture(photos):
    tracker = Tracker(CONFIG, GATES)
    position, yaw, velocity, rates = SEEN[0]
    state = state_at(position, yaw - 8.0, velocity, 0.1, 1e-6, np.random.default_rng(3))
    turn = slice(6, 9)
    state.P[turn, turn] = np.diag(np.square([radians(0.5), radians(0.5), radians(6.0)]))
    seen = tracker.tracked(photos[0], state, rates)
    assert seen.searched
    true, _ = CONFIG.gate_corners(GATES, position, from_yaw(radians(yaw)))
    at = true[seen.found.gates, seen.found.corners]
    believed, _ = CONFIG.gate_corners(GATES, state.nominal.position, state.nominal.attitude)
    believed = believed[seen.found.gates, seen.found.corners]
    assert len(at) >= 4
    assert np.median(np.linalg.norm(believed - at, axis=1)) > 30.0
    assert np.median(np.linalg.norm(seen.found.pixels - at, axis=1)) < 2.0


def test_next_to_nothing_is_found_where_no_gate_is():
    away = CourseEye(CONFIG, np.random.SeedSequence(0), load_course("split_s_swift"))
    tracker = Tracker(CONFIG, GATES)
    rng = np.random.default_rng(2)
    found = 0
    for position, yaw, velocity, rates in SEEN:
        # The picture is taken from above the course, towards the sky.
        photo = photo_at(away, (0.0, 0.0, 50.0), yaw, velocity, rates)
        state = state_at(position, yaw, velocity, POSITION_STD, TURN_STD, rng)
        found += len(tracker(photo, state, rates).pixels)
    assert found <= 1


@pytest.mark.slow
def test_a_flight_on_pictures_knows_its_place_and_repeats_to_the_last_bit():
    settings = {**SHORT, "timeout": 0.6}
    run = quadsim.fly("split_s_swift", sensing="pixels", seed=3, **settings)
    columns = run.telemetry
    off = [columns[f"est_p{axis}"] - columns[f"p{axis}"] for axis in "xyz"]
    assert np.linalg.norm(off, axis=0)[-1] < 0.1
    assert columns["found"].sum() > 10
    again = quadsim.fly("split_s_swift", sensing="pixels", seed=3, **settings)
    assert np.array_equal(again.telemetry["est_px"], columns["est_px"], equal_nan=True)
