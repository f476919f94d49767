"""Traffic: what is seen is late and noisy as asked, and plans are known one instant later."""

import numpy as np
import pytest

from quadsim.dynamics.expected_path import ExpectedPath
from quadsim.dynamics.quadrotor import State
from quadsim.heat.traffic import Sight, Traffic
from quadsim.streams import sighting_stream

DT = 0.0025


EXACT = Sight()


def traffic(sight=EXACT, vehicles=2, seed=0):
    return Traffic(vehicles, sight, [sighting_stream(seed, k) for k in range(vehicles)])


def at(x):
    return State.of(
        (x, 0.0, 1.0), (2.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0,) * 3, 9.81, (0.0,) * 3
    )


def fly(known, seconds):
    """Let vehicle 1 fly along x at 2 m/s."""
    for step in range(round(seconds / DT) + 1):
        known.note(1, step * DT, at(2.0 * step * DT), passed=step)


@pytest.mark.parametrize("delay", [0.0, 0.02, 0.1])
def test_others_are_seen_where_they_were_a_delay_ago(delay):
    known = traffic(Sight(delay=delay))
    fly(known, 0.5)
    seen = known.sightings(0, 0.5)[1]
    assert seen.t == pytest.approx(0.5 - delay)
    assert seen.position[0] == pytest.approx(2.0 * (0.5 - delay))
    assert seen.passed == round((0.5 - delay) / DT)


def test_noise_has_its_standard_deviations_and_none_is_none():
    known = traffic(Sight(position_noise=0.05, velocity_noise=0.2))
    known.note(1, 0.0, at(3.0), 0)
    seen = [known.sightings(0, 0.0)[1] for _ in range(4000)]
    positions = np.array([s.position for s in seen]) - (3.0, 0.0, 1.0)
    velocities = np.array([s.velocity for s in seen]) - (2.0, 0.0, 0.0)
    np.testing.assert_allclose(positions.std(axis=0), 0.05, rtol=0.06)
    np.testing.assert_allclose(velocities.std(axis=0), 0.2, rtol=0.06)
    np.testing.assert_allclose(positions.mean(axis=0), 0.0, atol=0.004)
    exact = traffic()
    exact.note(1, 0.0, at(3.0), 0)
    assert exact.sightings(0, 0.0)[1].position == (3.0, 0.0, 1.0)


def test_the_noise_of_one_vehicle_does_not_depend_on_the_others_looks():
    sight = Sight(position_noise=0.05)
    alone, beside = traffic(sight, 3), traffic(sight, 3)
    for known in (alone, beside):
        known.note(1, 0.0, at(3.0), 0)
        known.note(2, 0.0, at(4.0), 0)
    beside.sightings(2, 0.0)
    assert alone.sightings(0, 0.0) == beside.sightings(0, 0.0)


def test_a_plan_is_known_after_the_instant_at_which_it_was_announced():
    known = traffic()
    path = ExpectedPath(0.0, 0.01, np.zeros((2, 3)))
    known.announce(1, path)
    assert known.announced(1) is None
    known.publish()
    assert known.announced(1) is path


def test_who_has_not_started_or_has_left_is_not_seen():
    known = traffic(vehicles=3)
    assert known.sightings(0, 0.0) == {}
    known.note(1, 0.0, at(0.0), 0)
    assert set(known.sightings(0, 0.0)) == {1}
    known.leave(1)
    assert known.sightings(0, 0.0) == {}


def test_an_expected_path_is_interpolated_and_goes_on_straight():
    path = ExpectedPath(1.0, 0.5, np.array([[0.0, 0, 0], [1.0, 0, 0], [1.0, 2.0, 0]]))
    times = np.array([0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5])
    expected = [[-0.5, 0], [0, 0], [0.5, 0], [1, 0], [1, 1], [1, 2], [1, 4]]
    np.testing.assert_allclose(path.at(times)[:, :2], expected)


def test_an_expected_path_keeps_positions_of_its_own():
    positions = np.zeros((2, 3))
    path = ExpectedPath(0.0, 1.0, positions)
    positions[:] = 7.0
    assert (path.positions == 0.0).all()
    with pytest.raises(ValueError, match="read-only"):
        path.positions[0, 0] = 1.0
