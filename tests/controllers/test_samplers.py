"""Properties of every registered sampler, whatever its law.

The laws of colored noise are in test_colored.

A new sampler is found by its line in SAMPLERS: numbers per control are given to it by the name of
the field, every choice of its further fields is a case.
"""

from dataclasses import fields
from itertools import product
from typing import Literal, get_args, get_origin, get_type_hints

import numpy as np
import pytest
from point import White, make_sampler
from scipy.stats import qmc

from quadsim.controllers.lanes.layout import CHUNK, LANES, from_lanes
from quadsim.controllers.samplers import SAMPLERS, Gaussian, build_lanes
from quadsim.controllers.samplers.lane_sampler import stream_key


def choices(name):
    """Every combination of the sampler's literal fields."""
    hints = get_type_hints(SAMPLERS[name])
    options = {f: get_args(hint) for f, hint in hints.items() if get_origin(hint) is Literal}
    return [dict(zip(options, chosen, strict=True)) for chosen in product(*options.values())]


CASES = [(name, chosen) for name in SAMPLERS for chosen in choices(name)] + [("own", {})]
LIMIT = 5.0  # standard errors
# Each length of the transform in colored sampling is compiled. These horizons share three: 28, 63
# and 80 steps. Law paper has one step for each of the horizon, the others have two or more.
HORIZON = 40
HORIZONS = {"exact": (31, 40), "paper": (63, 80), "library": (14, 40)}
every_sampler = pytest.mark.parametrize(
    "case",
    [
        pytest.param(
            (name, chosen),
            id="-".join((name, *chosen.values())),
            marks=[] if name == "own" else [pytest.mark.compiled],
        )
        for name, chosen in CASES
    ],
)


def horizons(case):
    """Return some horizons, the usual one last."""
    name, chosen = case
    return HORIZONS[chosen["law"]] if name == "colored" else (2, 3, 64, 65, HORIZON)


def make(case, key, samples=4096, horizon=None, sigma=(0.4, 0.8)):
    """Every further number per control is .5 and up."""
    name, chosen = case
    horizon = horizon or horizons(case)[-1]
    if name == "own":
        return build_lanes(White(sigma), len(sigma), samples, (1,) * horizon, key, 0.1)
    numbers = {f.name: tuple(0.5 + k for k in range(len(sigma))) for f in fields(SAMPLERS[name])}
    if chosen.get("law", "exact") != "exact":
        del numbers["cutoff"]
    sampler = make_sampler(name, **numbers | {"sigma": sigma} | chosen)
    return build_lanes(sampler, len(sigma), samples, (1,) * horizon, key, 0.1)


def draw(case, key, call=1, samples=4096, horizon=None, **options):
    horizon = horizon or horizons(case)[-1]
    return from_lanes(
        make(case, key, samples, horizon, **options).sample(call).copy(), samples, horizon
    )


def shared(a, b):
    """The worst correlation of two sets of samples at any channel and time, in standard errors.
    (M, n_u, T)"""
    r = (a * b).mean(axis=0) / np.sqrt((a * a).mean(axis=0) * (b * b).mean(axis=0))
    return abs(r).max() * np.sqrt(len(a))


@every_sampler
def test_layout_holds_every_sample(case, key):
    for samples, horizon in product((2, 63, 64, 65, 200), horizons(case)):
        size = f"{samples} samples of {horizon} steps"
        z = make(case, key, samples, horizon).sample(1)
        halves = z.shape[2] // horizon
        room = len(z) * halves * LANES
        assert z.shape[1:] == (2, halves * horizon, LANES), size
        assert samples <= room < samples + LANES * halves, size
        assert z.dtype == np.float32
        assert np.isfinite(z).all(), size
        assert len(np.unique(from_lanes(z, samples, horizon)[:, 0, 0])) == samples, size


@every_sampler
def test_sample_is_a_function_of_key_and_call(case, key):
    sampler = make(case, key)
    first, second = (sampler.sample(call).copy() for call in (1, 2))
    np.testing.assert_array_equal(make(case, key).sample(2), second)
    np.testing.assert_array_equal(sampler.sample(1), first)
    assert not np.array_equal(first, second)


@every_sampler
def test_chunk_drawn_alone_is_that_of_the_whole(case, key):
    """A sampler of one's own draws chunk by chunk; the others, any part that begins with a pair of
    series."""
    sampler = make(case, key, samples=CHUNK)
    chunks = [
        sampler.sample(7, first, count).copy()
        for first, count in ((0, CHUNK), (CHUNK, CHUNK), (2 * CHUNK, 100))
    ]
    np.testing.assert_array_equal(
        make(case, key, samples=CHUNK).sample(7, 2 * CHUNK, 100), chunks[2]
    )
    np.testing.assert_array_equal(sampler.sample(7, CHUNK, CHUNK), chunks[1])
    assert not np.array_equal(chunks[0], chunks[1])
    if case[0] != "own":
        whole = make(case, key, samples=2 * CHUNK + 100).sample(7)
        np.testing.assert_array_equal(whole, np.concatenate(chunks))


@every_sampler
def test_sample_is_the_same_for_one_and_two_threads(case, key, on_threads):
    one, two = (on_threads(n, lambda: draw(case, key, samples=333)) for n in (1, 2))
    np.testing.assert_array_equal(one, two)


@every_sampler
def test_mean_is_zero_at_every_time(case, key):
    z = draw(case, key).astype(float)
    error = z.std(axis=0) / np.sqrt(len(z))
    assert (abs(z.mean(axis=0)) / error).max() < LIMIT
    assert (abs((z + 0.1 * z.std(axis=0)).mean(axis=0)) / error).max() > LIMIT


@every_sampler
def test_each_channel_scales_with_its_sigma(case, key):
    """Small sigma, where the log-normal's factor exp(sigma eta) is nearly one."""
    one, other = (draw(case, key, sigma=sigma) for sigma in ((0.01, 0.02), (0.02, 0.02)))
    ratio = other.std(axis=(0, 2)) / one.std(axis=(0, 2))
    np.testing.assert_allclose(ratio, (2.0, 1.0), rtol=2e-3)
    assert abs(one.std(axis=(0, 2)) / one.std() - 1).max() > 0.1


@every_sampler
def test_calls_keys_and_channels_are_independent(case, key):
    z, next_call, other_key = (
        draw(case, key),
        draw(case, key, call=2),
        draw(case, key + np.uint32(1)),
    )
    channel, other_channel = z[:, :1], z[:, 1:]
    assert max(shared(z, next_call), shared(z, other_key), shared(channel, other_channel)) < LIMIT
    assert shared(z, next_call + 0.2 * z) > LIMIT


@every_sampler
def test_series_and_lanes_are_independent(case, key):
    """Of the samples that share one series, the first: the others are its neighbours in time."""
    z = make(case, key, samples=128 * LANES).sample(1)[:, 0, 0]  # (series, LANES)
    for rows in (z, z.T):
        planted = rows.copy()
        planted[1] = rows[0]
        worst, caught = (
            abs(np.corrcoef(r) - np.eye(len(r))).max() * np.sqrt(r.shape[1])
            for r in (rows, planted)
        )
        assert worst < LIMIT < caught


@pytest.mark.compiled
def test_gaussian_is_white_with_the_variance_asked_for(key):
    """Covariance over channels and times against sigma^2 on the diagonal and zero elsewhere."""
    sigma = np.repeat((0.4, 0.8), 20)
    z = draw(("gaussian", {}), key, horizon=20).reshape(-1, 40)
    error = np.sqrt((1 + np.eye(40)) / len(z))

    def worst(z):
        return (abs(z.T.astype(float) @ z / len(z) - np.eye(40)) / error).max()

    assert worst(z / sigma) < LIMIT
    assert worst(1.06 * z / sigma) > LIMIT
    assert worst(z / sigma + 0.1 * np.roll(z / sigma, 1, axis=1)) > LIMIT


@pytest.mark.parametrize(
    ("drawn", "found"),
    [
        (
            lambda *shape: np.zeros((shape[0], shape[2], shape[1])),
            r"shape \(64, 20, 2\), .*, got shape \(64, 2, 20\)$",
        ),
        (lambda *shape: np.full(shape, np.nan), "got 2560 that are not finite"),
        (lambda *shape: np.full(shape, 1e300), "got 2560 that are not finite"),
    ],
)
def test_draws_of_ones_own_sampler_that_do_not_fit_are_refused_in_one_line(key, drawn, found):
    class Mine:
        def sample(self, rng, samples, horizon, controls):
            return drawn(samples, horizon, controls)

    with pytest.raises(ValueError, match=found) as caught:
        build_lanes(Mine(), 2, 64, (1,) * 20, key, 0.1).sample(1)
    assert str(caught.value).startswith("sampler: Mine.sample: expected ")
    assert "\n" not in str(caught.value)


def test_numbers_that_do_not_fit_are_refused(key):
    with pytest.raises(ValueError, match="sigma: expected 4 numbers, one per control, got 2"):
        build_lanes(Gaussian((1.0, 1.0)), 4, 64, (1,) * 20, key, 0.1)
    with pytest.raises(ValueError, match="gamma: expected 2 numbers, as sigma has, got 1"):
        make_sampler("colored", sigma=(1.0, 1.0), gamma=(1.0,))


def test_streams_of_one_seed_have_keys_of_their_own():
    one, two = np.random.SeedSequence(3).spawn(2)
    np.testing.assert_array_equal(stream_key(3), stream_key(np.random.SeedSequence(3)))
    assert len({tuple(stream_key(s)) for s in (3, 4, one, two)}) == 4


class Drawing:
    """A sampler of one's own that is a function of the generator."""

    def __init__(self, draw):
        self.draw = draw

    def sample(self, rng, samples, horizon, controls):
        return self.draw(rng, samples, horizon * controls).reshape(samples, horizon, controls)


def drawn_by(draw, key, call=1, first=0):
    source = build_lanes(Drawing(draw), 2, 64, (1,) * 5, key, 0.1)
    return from_lanes(source.sample(call, first).copy(), 64, 5)


def halton(rng, samples, numbers):
    return qmc.Halton(numbers, seed=rng).random(samples)


def sobol(rng, samples, numbers):
    return qmc.Sobol(numbers, seed=rng).random(samples)


def of_children(rng, samples, numbers):
    return np.hstack([child.standard_normal((samples, 1)) for child in rng.spawn(numbers)])


@pytest.mark.parametrize("draw", [halton, sobol, of_children])
def test_a_sampler_may_spawn_generators_and_give_its_own_to_scipy(draw, key):
    z = drawn_by(draw, key)
    np.testing.assert_array_equal(drawn_by(draw, key), z)
    assert len(np.unique(z)) > 600
    for other in (drawn_by(draw, key, call=2), drawn_by(draw, key, first=64)):
        assert not np.isin(other, z).all()


def test_a_sampler_of_ones_own_draws_the_numbers_of_philox(key):
    """The digests of stored flights hold as long as it does."""
    counter = np.array([0, 64, 3, 0], np.uint64)
    stream = np.random.Philox(key=key.astype(np.uint64), counter=counter)
    expected = np.random.Generator(stream).standard_normal((64, 10)).astype(np.float32)
    z = drawn_by(lambda rng, *shape: rng.standard_normal(shape), key, call=3, first=64)
    np.testing.assert_array_equal(z.swapaxes(1, 2).reshape(64, 10), expected)
