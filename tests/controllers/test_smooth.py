"""Smooth-MPPI and Log-MPPI: their laws, each beside a version that the test rejects."""

from typing import get_args

import numpy as np
import pytest
from point import POINT, REST, START, T, drawn, make, naive_cost, perturbed

from quadsim.controllers.lanes.layout import from_lanes
from quadsim.controllers.presets import PRESETS
from quadsim.controllers.samplers import SAMPLERS, LogNormal
from quadsim.controllers.samplers.lane_sampler import Momentum, Shift
from quadsim.controllers.update import weights

FREE = {"system": POINT.__class__(**vars(POINT) | {"low": (-1e9,) * 2, "high": (1e9,) * 2})}


def kim(U, D, xi, dt, temperature):
    """One iteration of Smooth-MPPI as published: sampled derivatives, integrated over iterations.
    xi (M, T, n_u)"""
    d = D + xi
    V = U + d * dt
    w = weights(np.array([naive_cost(v) for v in V]), temperature)
    D = np.tensordot(w, d, 1)
    return U + D * dt, D


@pytest.mark.compiled
@pytest.mark.parametrize("name", ["smooth", "smooth_star"])
def test_smooth_is_the_published_iteration_over_derivatives(name):
    """Three iterations; with the derivative plan set to zero in between, the plan is another
    one."""
    mppi = make(sampler=name, samples=64, rest_fraction=0.0, **FREE)
    dt = mppi.config.dt
    U, D, forgetful = mppi.plan.copy(), np.zeros((T, 2)), mppi.plan.copy()
    for call in (1, 2, 3):
        xi = drawn(mppi, call).swapaxes(1, 2) / dt
        xi[0] = 0.0
        U, D = kim(U, D, xi, dt, 0.1)
        forgetful, _ = kim(forgetful, 0.0 * D, xi, dt, 0.1)
        mppi.iterate(START, 0)
    np.testing.assert_allclose(mppi.plan, U, atol=1e-4)
    np.testing.assert_allclose(mppi.sampler.momentum.change / dt, D, atol=1e-3)
    assert abs(mppi.plan - forgetful).max() > 1e-2


@pytest.mark.compiled
def test_smooth_samples_with_sigma_dt_and_smooth_star_with_sigma():
    slow, star = (drawn(make(sampler=name)) for name in ("smooth", "smooth_star"))
    np.testing.assert_allclose(slow, 0.1 * star, rtol=1e-5)  # dt = .1 s
    np.testing.assert_allclose(star.std(axis=(0, 2)), (0.8, 0.5), rtol=0.03)


@pytest.mark.compiled
def test_nominal_of_a_plan_with_momentum_leads_where_the_momentum_does():
    mppi = make(sampler="smooth_star", **FREE)
    mppi.sampler.momentum.change = 0.1 * np.cos(np.arange(2.0 * T)).reshape(T, 2)
    led, plain = naive_cost(mppi.plan + mppi.sampler.momentum.change), naive_cost(mppi.plan)
    assert abs(led - plain) > 1e-3
    assert mppi.iterate(START, 0).cost == pytest.approx(led, rel=1e-5)


@pytest.mark.compiled
def test_last_samples_perturb_the_plan_without_its_momentum():
    mppi = make(sampler="smooth_star")
    mppi.sampler.momentum.change[:] = 0.3
    raw, z = drawn(mppi), perturbed(mppi)
    np.testing.assert_allclose(z[180:], raw[180:] - 0.3, atol=1e-6)
    np.testing.assert_array_equal(z[1:180], raw[1:180])


@pytest.mark.compiled
def test_momentum_does_not_wind_up_at_the_limits():
    mppi = make(sampler="smooth_star", sigma=(5.0, 5.0))
    for _ in range(20):
        mppi.iterate(START, 0)
        reach = np.subtract(POINT.high, POINT.low)
        assert np.all(abs(mppi.sampler.momentum.change) <= reach)


@pytest.mark.parametrize("shift", get_args(Shift))
@pytest.mark.parametrize("steps", [1, 3, T, T + 5])
def test_momentum_shifts_with_the_plan_or_by_the_published_slip(shift, steps):
    momentum, D = Momentum(T, 2, shift), np.arange(2.0 * T).reshape(T, 2)
    momentum.change = D
    momentum.shift(steps)
    first = min(steps, T - 1)
    moved = np.vstack([D[first:], np.tile(D[-1:], (first, 1))])
    np.testing.assert_array_equal(
        momentum.change, moved if shift == "corrected" else np.tile(D[first], (T, 1))
    )


@pytest.mark.compiled
def test_plan_takes_its_momentum_along_when_time_moves_on():
    mppi = make(sampler="smooth_star")
    mppi.control(START)
    before = mppi.sampler.momentum.change.copy()
    mppi.shift(1)
    np.testing.assert_array_equal(mppi.sampler.momentum.change[:-1], before[1:])
    np.testing.assert_array_equal(mppi.plan[-1], REST)


def log_normal(key, sigma, samples=65536):
    z = LogNormal((sigma, sigma)).build(samples, (1,) * 4, key, dt=0.1).sample(1)
    return from_lanes(z, samples, 4).astype(float)


@pytest.mark.compiled
@pytest.mark.parametrize("sigma", [0.2, 0.5])
def test_log_normal_has_the_variance_and_kurtosis_of_a_normal_times_a_log_normal(key, sigma):
    """Standard deviation sigma exp(sigma^2), kurtosis 3 exp(4 sigma^2); a Gaussian's are sigma and
    3."""
    z = log_normal(key, sigma)
    sd, kurtosis = z.std(), (z**4).mean() / (z**2).mean() ** 2
    assert sd == pytest.approx(sigma * np.exp(sigma**2), rel=0.01)
    assert kurtosis == pytest.approx(3 * np.exp(4 * sigma**2), rel=0.15)
    assert sd != pytest.approx(sigma, rel=0.03)
    assert kurtosis != pytest.approx(3, rel=0.15)


@pytest.mark.compiled
def test_log_normal_sign_and_size_are_those_of_independent_normals(key):
    """ln |z / sigma| / sigma has the variance 1 + var(ln |xi|) / sigma^2, whatever the sign."""
    sigma = 0.5
    z = log_normal(key, sigma)
    size = np.log(abs(z) / sigma)
    assert size.var() == pytest.approx(np.pi**2 / 8 + sigma**2, rel=0.02)
    assert abs(np.corrcoef(np.sign(z).ravel(), size.ravel())[0, 1]) < 5 / np.sqrt(z.size)


@pytest.mark.compiled
def test_log_normal_is_white(key):
    z = log_normal(key, 0.4).reshape(-1, 8)
    r = np.corrcoef(z.T) - np.eye(8)
    assert abs(r).max() < 5 / np.sqrt(len(z))
    assert abs(np.corrcoef((z + 0.05 * np.roll(z, 1, axis=1)).T) - np.eye(8)).max() > 5 / np.sqrt(
        len(z)
    )


@pytest.mark.compiled
def test_log_normal_of_an_absurd_sigma_is_finite(key):
    assert np.isfinite(log_normal(key, 100.0, 4096)).all()


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_has_numbers_for_every_sampler(preset):
    """Log-normal with the Gaussian's standard deviations; both smooth ones with the same
    perturbations."""
    planners = PRESETS[preset]
    assert set(planners) == set(SAMPLERS)
    sigma, white = (np.array(planners[name].sampling.sigma) for name in ("log_normal", "gaussian"))
    np.testing.assert_allclose(sigma * np.exp(sigma**2), white, rtol=0.02)
    slow, star = (np.array(planners[name].sampling.sigma) for name in ("smooth", "smooth_star"))
    np.testing.assert_allclose(slow * planners["smooth"].mppi.dt, star)
