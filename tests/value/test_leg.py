"""The time of a leg of a point mass: closed forms, and the search over all times."""

import numpy as np
import pytest

from quadsim.value.leg import THRUST_SHARE, PointMass, States, leg_time, mean_square
from quadsim.vehicle import GRAVITY

SWIFT = PointMass(thrust=40.0, drag=0.4)
WEIGHTLESS = 1e4  # thrust beside which gravity does not count [m/s^2]


def states(position, velocity=(0.0, 0.0, 0.0)):
    return States(np.array(position, float), np.array(velocity, float))


def random_legs(n, seed=0):
    """Legs of racing: forward at both ends, with some speed to the sides."""
    rng = np.random.default_rng(seed)
    way = 8.0 * rng.normal(size=(n, 3))
    ahead = way / np.linalg.norm(way, axis=1, keepdims=True)
    ends = [3.0 * rng.normal(size=(n, 3)) + rng.uniform(0.0, 20.0, (n, 1)) * ahead for _ in "ab"]
    return States(np.zeros((n, 3)), ends[0]), States(way, ends[1])


def cost(start, end, mass, times):
    """The sum that a leg minimises, by its definition."""
    thrust = mean_square(start, end, mass.drag, times) / mass.thrust**2
    return (1.0 - THRUST_SHARE) * times + THRUST_SHARE * times * thrust


@pytest.mark.parametrize("d", [1.0, 30.0])
def test_from_rest_to_rest_it_is_the_least_time_of_a_mean_square(d):
    """12 d^2 / T^4 = f^2, along a line and without weight."""
    found = leg_time(states((0, 0, 0)), states((d, 0, 0)), PointMass(WEIGHTLESS, 0.0))
    assert found == pytest.approx((12.0 * d**2 / WEIGHTLESS**2) ** 0.25, rel=1e-6)


def test_mean_square_is_that_of_the_thrust_that_flies_the_leg():
    """The thrust is linear in time; its integrals lead from one state to the other."""
    start, end = states((0, 0, 0), (5, -2, 1)), states((4, 3, -1), (8, 4, 2))
    T, n = 0.7, 20001
    t = np.linspace(0.0, T, n)[:, None]
    way, change = end.position - start.position, end.velocity - start.velocity
    off = way / T - (start.velocity + end.velocity) / 2.0
    acceleration = change / T + (12.0 / T**2) * off * (T / 2.0 - t)
    moved = np.trapezoid(start.velocity + np.cumsum(acceleration, axis=0) * T / (n - 1), t, axis=0)
    np.testing.assert_allclose(moved, way, atol=2e-3)
    thrust = acceleration + np.array((0.0, 0.0, GRAVITY))
    of_thrust = np.trapezoid((thrust**2).sum(axis=1), t[:, 0]) / T
    assert mean_square(start, end, 0.0, T) == pytest.approx(of_thrust, rel=1e-3)


def test_it_is_the_least_over_all_times():
    """Against a scan, for legs on which the time of turning back is a trap."""
    start, end = random_legs(300)
    found = leg_time(start, end, SWIFT)
    times = np.geomspace(0.02, 8.0, 3000)
    scanned = cost(
        States(start.position[:, None], start.velocity[:, None]),
        States(end.position[:, None], end.velocity[:, None]),
        SWIFT,
        times,
    ).min(axis=1)
    assert np.mean(found < scanned * 1.002) > 0.97
    assert np.all(found > scanned * 0.998)


def test_more_thrust_is_never_slower():
    start, end = random_legs(300)
    by_thrust = [leg_time(start, end, PointMass(f, 0.0)) for f in (20.0, 40.0, 80.0)]
    assert np.all(np.diff(by_thrust, axis=0) <= 1e-9)


def test_drag_holds_back_a_leg_that_gains_speed_and_helps_one_that_brakes():
    rest, fast = states((0, 0, 0)), states((20, 0, 0), (25, 0, 0))
    back = (states((0, 0, 0), (25, 0, 0)), states((20, 0, 0)))
    for (start, end), is_slower in (((rest, fast), True), (back, False)):
        slowed, free = (leg_time(start, end, PointMass(40.0, k)) for k in (0.4, 0.0))
        assert (slowed > free) == is_slower


def test_it_is_smooth_in_the_states():
    """The least time under a limit jumps where a leg becomes possible; this cost does not."""
    end = states((6, 0, 0), (50, 0, 0))
    aside = np.linspace(0.0, 3.0, 601)
    start = States(np.zeros((601, 3)), np.stack([0 * aside + 50, aside, 0 * aside], axis=1))
    found = leg_time(start, end, SWIFT)
    assert abs(np.diff(found)).max() < 0.02
    assert np.ptp(found) > 0.02
