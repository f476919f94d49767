"""Claims about how an estimate is drawn: its ellipsoid, and the corners that a gate camera
found."""

import numpy as np
import pytest
from viser.transforms import SO3

from quadsim.course import load_course
from quadsim.web.page.scene.estimate import ellipsoid, sensed_corners
from quadsim.web.race.live_flight import LiveFlight
from quadsim.web.state.choices import PILOT, Choices, planner_kinds
from quadsim.web.state.numbers import Change


def test_the_half_axes_are_three_standard_deviations_along_the_covariances_own_axes():
    turn = SO3.from_rpy_radians(0.3, -0.2, 1.0).as_matrix()
    covariance = turn @ np.diag([0.01, 0.04, 0.09]) @ turn.T
    axes, quaternion = ellipsoid(covariance)
    assert axes == pytest.approx((0.3, 0.6, 0.9))
    back = SO3(quaternion).as_matrix()
    assert np.linalg.det(back) == pytest.approx(1.0)
    assert back @ np.diag(np.square(axes) / 9.0) @ back.T == pytest.approx(covariance)


@pytest.fixture
def flown(tmp_path_factory):
    """A learned pilot that flies half a second on a gate camera without noise, misses or
    mistakes."""
    file = tmp_path_factory.mktemp("sensing") / "sharp.yaml"
    camera = "{rate: 50, width: 640, height: 480, fx: 320, fy: 320, noise: 0}"
    file.write_text(f"imu: {{rate: 250}}\ncamera: {camera}\n")
    choices = Choices(sampler=f"{PILOT}split_s_swift", sensing=str(file), laps=1)
    flight = LiveFlight(choices)
    for _ in range(50):
        flight.advance()
    return flight


def test_a_corner_without_noise_is_drawn_on_the_gates_corner(flown):
    seen = flown.now.corners
    assert len(seen.pixels) >= 2
    gates = tuple(dict.fromkeys(load_course("split_s_swift").gates))
    true = np.array([gate.corners() for gate in gates])[seen.gates, seen.corners]
    crosses = sensed_corners(flown.now, seen).reshape(-1, 2, 2, 3)  # (corners, lines, ends, 3)
    assert crosses.mean(axis=(1, 2)) == pytest.approx(true, abs=1e-6)


def test_a_pilot_has_no_numbers_to_tune_and_no_plan_to_show(flown):
    before = flown.now.start_numbers
    flown.change(Change("temperature", 2.0))
    assert flown.is_cached
    assert flown.now.numbers(flown.t) == before
    assert flown.sampled_trajectories() is None
    assert planner_kinds("race", f"{PILOT}split_s_swift") == {}


def test_a_flight_that_has_ended_shows_no_picture_any_more(flown):
    assert flown.now.sensed
    flown.end()
    assert flown.now.corners is None
