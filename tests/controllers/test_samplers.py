"""What every registered sampler promises, whatever its law. The laws of colored noise are in test_colored."""

import numpy as np
import pytest
from oracle import from_lanes

from controllers.rollout.lanes import LANES
from controllers.samplers import SAMPLERS, SamplerConfig
from controllers.samplers.colored import LAWS

CASES = [(name, law) for name in SAMPLERS for law in (LAWS if name == "colored" else ("exact",))]
LIMIT = 5.0  # standard errors
every_sampler = pytest.mark.parametrize("case", CASES, ids="-".join)


def make(case, key, samples=4096, horizon=20, sigma=(0.4, 0.8), gamma=(2.0, 0.5)):
    name, law = case
    return SAMPLERS[name](SamplerConfig(sigma, gamma, law), samples, horizon, key, 0.1)


def draw(case, key, call=1, samples=4096, horizon=20, **options):
    return from_lanes(make(case, key, samples, horizon, **options).sample(call).copy(), samples, horizon)


def shared(a, b):
    """The worst correlation of two sets of samples at any channel and time, in standard errors.  (M, n_u, T)"""
    r = (a * b).mean(axis=0) / np.sqrt((a * a).mean(axis=0) * (b * b).mean(axis=0))
    return abs(r).max() * np.sqrt(len(a))


@every_sampler
@pytest.mark.parametrize("samples", [2, 63, 64, 65, 200])
@pytest.mark.parametrize("horizon", [2, 3, 64, 65])
def test_layout_holds_every_sample(case, key, samples, horizon):
    z = make(case, key, samples, horizon).sample(1)
    halves = z.shape[2] // horizon
    room = len(z) * halves * LANES
    assert z.shape[1:] == (2, halves * horizon, LANES)
    assert samples <= room < samples + LANES * halves
    assert z.dtype == np.float32
    assert np.isfinite(z).all()
    assert len(np.unique(from_lanes(z, samples, horizon)[:, 0, 0])) == samples


@every_sampler
def test_sample_is_a_function_of_key_and_call(case, key):
    sampler = make(case, key)
    first, second = (sampler.sample(call).copy() for call in (1, 2))
    np.testing.assert_array_equal(make(case, key).sample(2), second)
    np.testing.assert_array_equal(sampler.sample(1), first)


@every_sampler
def test_sample_is_the_same_for_one_and_two_threads(case, key, on_threads):
    one, two = (on_threads(n, lambda: draw(case, key, samples=333, horizon=35)) for n in (1, 2))
    np.testing.assert_array_equal(one, two)


@every_sampler
def test_mean_is_zero_at_every_time(case, key):
    z = draw(case, key).astype(float)
    error = z.std(axis=0) / np.sqrt(len(z))
    assert (abs(z.mean(axis=0)) / error).max() < LIMIT
    assert (abs((z + 0.1 * z.std(axis=0)).mean(axis=0)) / error).max() > LIMIT


@every_sampler
def test_sigma_belongs_to_its_channel(case, key):
    spread = draw(case, key, sigma=(0.2, 0.0, 0.4), gamma=(1.0, 1.0, 1.0)).std(axis=(0, 2))
    assert spread[1] == 0.0
    assert spread[2] > 1.9 * spread[0] > 0.0


@every_sampler
def test_calls_keys_and_channels_are_independent(case, key):
    z, next_call, other_key = draw(case, key), draw(case, key, call=2), draw(case, key + np.uint32(1))
    channel, other_channel = z[:, :1], z[:, 1:]
    assert max(shared(z, next_call), shared(z, other_key), shared(channel, other_channel)) < LIMIT
    assert shared(z, next_call + 0.2 * z) > LIMIT


@every_sampler
def test_series_and_lanes_are_independent(case, key):
    """Of the samples that share one series, the first: the others are its neighbours in time."""
    z = make(case, key, samples=128 * LANES, horizon=5).sample(1)[:, 0, 0]  # (series, LANES)
    for rows in (z, z.T):
        planted = rows.copy()
        planted[1] = rows[0]
        worst, caught = (abs(np.corrcoef(r) - np.eye(len(r))).max() * np.sqrt(r.shape[1]) for r in (rows, planted))
        assert worst < LIMIT < caught


def test_gaussian_is_white_with_the_variance_asked_for(key):
    """Covariance over channels and times against sigma^2 on the diagonal and zero elsewhere."""
    sigma = np.repeat((0.4, 0.8), 20)
    z = draw(("gaussian", "exact"), key).reshape(-1, 40)
    error = np.sqrt((1 + np.eye(40)) / len(z))

    def worst(z):
        return (abs(z.T.astype(float) @ z / len(z) - np.eye(40)) / error).max()

    assert worst(z / sigma) < LIMIT
    assert worst(1.06 * z / sigma) > LIMIT
    assert worst(z / sigma + 0.1 * np.roll(z / sigma, 1, axis=1)) > LIMIT
