"""The double integrator and its cost: explicit Euler, and the lanes against the oracle."""

import numpy as np
import pytest
from oracle import fly_rows, to_lanes

from quadsim.controllers.costs import evaluate
from quadsim.controllers.lanes.lanes import Rollout
from quadsim.controllers.lanes.layout import LANES
from quadsim.paper.integrator import (
    UNLIMITED,
    PointControl,
    PointState,
    double_integrator,
    quadratic_cost,
)

SYSTEM = double_integrator(0.015)
COST = quadratic_cost((-4.0, -4.0))
START = (-9.0, -9.0, 0.1, 0.1)
M = 200  # samples
T = 65  # steps


def controls(seed=0, spread=3.0):
    rng = np.random.default_rng(seed)
    return rng.normal(0, 1, (T, 2)), rng.normal(0, spread, (M, 2, T)).astype(np.float32)


def fly_lanes(U, z, dtype=np.float32, system=SYSTEM):
    J = np.empty((-(-M // LANES), LANES), dtype)
    Rollout(system, COST, dtype)(np.array(START), U, to_lanes(z, dtype=dtype), 0, J)
    return J.ravel()[:M]


def test_constant_control_goes_as_the_sums_of_explicit_euler():
    """n steps of u: v = v0 + n u dt, p = p0 + n v0 dt + n (n - 1) / 2 u dt^2."""
    n = 40
    dt = SYSTEM.dt
    x = START
    for _ in range(n):
        x = SYSTEM.next(x, (2.0, -1.0))
    np.testing.assert_allclose(x[2:], (0.1 + n * 2 * dt, 0.1 - n * dt))
    grid = -9 + n * 0.1 * dt + np.array([2, -1]) * n * (n - 1) / 2 * dt**2
    np.testing.assert_allclose(x[:2], grid)
    assert x[0] != pytest.approx(-9 + n * 0.1 * dt + 2 * n * (n + 1) / 2 * dt**2, rel=1e-4), (
        "semi-implicit Euler"
    )


def test_cost_is_five_per_square_metre_and_a_half_per_square_metre_per_second():
    x = PointState(px=-3.0, py=-6.0, vx=2.0, vy=-1.0)
    found = evaluate(COST, x, x, PointControl(0.0, 0.0), (-4.0, -4.0))
    assert found.terms == {"distance": 5 * 5.0, "speed": 0.5 * 5.0}
    assert (found.reached, found.crashed) == (False, 0.0)


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("dtype", "rtol"),
    [(np.float32, 2e-5), pytest.param(np.float64, 1e-12, marks=pytest.mark.regression)],
)
def test_lanes_agree_with_the_oracle(dtype, rtol):
    U, z = controls()
    stronger = double_integrator(SYSTEM.dt, gain=1.05)
    oracle, wrong = (fly_rows(system, COST, START, U, z).J for system in (SYSTEM, stronger))
    np.testing.assert_allclose(fly_lanes(U, z, dtype), oracle, rtol=rtol)
    assert np.mean(abs(wrong / oracle - 1) > rtol) > 0.9


@pytest.mark.compiled
def test_controls_have_no_limit():
    """A log-normal tail of a million still counts, and weighs in as it should."""
    U, z = controls()
    z[5, 0, 10] = 1e6
    oracle = fly_rows(SYSTEM, COST, START, U, z).J
    np.testing.assert_allclose(fly_lanes(U, z), oracle, rtol=2e-5)
    assert oracle[5] > 1e6 * np.median(oracle)
    assert max(SYSTEM.high) == UNLIMITED < np.finfo(np.float32).max
