"""Laws of the parts of a fit: the lag behind a delay, and intervals that cover the truth."""

import numpy as np
import pytest

from quadsim.identify.intervals import covariances
from quadsim.identify.rotors import lagged
from quadsim.identify.search import Linearized


@pytest.mark.parametrize("delay", [0.0, 0.004, 0.0137, -0.006])
def test_a_lag_behind_a_delay_is_that_of_much_smaller_steps(delay):
    rng = np.random.default_rng(0)
    command = rng.uniform(size=200)
    dt, tau, fine = 0.01, 0.033, 1000
    answer = lagged(command, dt, tau, delay)
    # The same with held commands in steps of 10 us, in which all delays are whole.
    index = np.arange(len(command) * fine) - round(delay / dt * fine)
    held = command[np.clip(index // fine, 0, len(command) - 1)]
    slow = [held[0]]
    keep = np.exp(-dt / fine / tau)
    for value in held[:-1]:
        slow.append(value + keep * (slow[-1] - value))
    assert answer == pytest.approx(np.array(slow)[::fine], abs=1e-9)


def line(rng, count, together):
    """Return the linearized fit of a constant 0 to noise, equal within each `together` values."""
    noise = np.repeat(rng.standard_normal(count // together), together)
    fitted = noise - noise.mean()
    cluster = np.arange(count) // together
    ones = np.ones((count, 1))
    return noise.mean(), Linearized(ones, fitted, cluster, np.array([1e-12]))


def covered(together):
    """Return the shares of intervals that cover 0: by the Jacobian alone, and as reported."""
    rng = np.random.default_rng(1)
    hits = np.zeros(2)
    tries = 100
    for _ in range(tries):
        mean, linearized = line(rng, 160, together)
        found = covariances(linearized)
        for k, covariance in enumerate((found.jacobian, found.reported)):
            hits[k] += abs(mean) < 1.96 * np.sqrt(covariance[0, 0])
    return hits / tries


def test_intervals_cover_the_truth_if_residuals_are_not_independent():
    by_jacobian, reported = covered(together=8)
    assert reported > 0.9
    assert by_jacobian < 0.7, "the control: the Jacobian alone takes residuals as independent"


def test_intervals_of_independent_residuals_cover_the_truth():
    by_jacobian, reported = covered(together=1)
    assert by_jacobian > 0.9
    assert reported >= by_jacobian
