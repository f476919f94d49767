"""The counter-based generator: published numbers, N(0, 1) far into the tails, independence.

Each statistic is a distance from its expectation in standard errors, and each has a negative
control.
"""

import numpy as np
import pytest
from scipy.special import ndtr

from quadsim.controllers.lanes.normals import box_muller, fill_normals, philox

pytestmark = pytest.mark.compiled
LANES = 64
LIMIT = 5.0  # standard errors
KS_LIMIT = 1.95  # of sqrt(n) D, one draw in a thousand is above
KEYS = ((1, 2), (2, 1), (1, 3), (0, 0))  # neighbours and a swap
AXES = ("keys", "calls", "blocks", "rows", "lanes")


def draw(blocks, rows, key=(1, 2), call=1, scale=None):
    out = np.full((blocks, rows, LANES), np.nan, np.float32)
    scale = np.ones(rows, np.float32) if scale is None else scale
    # All arguments, as the samplers give them: without the last one the code is another.
    fill_normals(out, scale, np.array(key, np.uint32), call, 0)
    return out


def moments(x):
    """The worst of mean, variance, skewness and kurtosis."""
    x = x.astype(float)
    n, x2 = x.size, x * x
    errors = (x.mean(), x2.mean() - 1, (x2 * x).mean(), (x2 * x2).mean() - 3)
    return max(abs(e) * np.sqrt(n / v) for e, v in zip(errors, (1, 2, 15, 96), strict=True))


def kolmogorov_smirnov(x):
    """sqrt(n) sup |F_n - F|."""
    n, p = x.size, ndtr(np.sort(x.astype(float)))
    return np.sqrt(n) * max((np.arange(1, n + 1) / n - p).max(), (p - np.arange(n) / n).max())


def tails(x):
    """The worst of the Poisson counts beyond 3, 4, 4.5 and 5 sigma on either side."""
    expected = {s: x.size * ndtr(-s) for s in (3.0, 4.0, 4.5, 5.0)}
    counts = [(np.count_nonzero(side * x > s), e) for side in (-1, 1) for s, e in expected.items()]
    return max(abs(count - e) / np.sqrt(e) for count, e in counts)


def correlations(x):
    """The worst between two rows of x (d, n), of the numbers and of their squares."""
    standard = [
        (f - f.mean(axis=1, keepdims=True)) / f.std(axis=1, keepdims=True) for f in (x, x * x)
    ]
    products = [np.einsum("in,jn->ij", f, f) - x.shape[1] * np.eye(len(x)) for f in standard]
    return abs(np.array(products)).max() / np.sqrt(x.shape[1])


def autocorrelation(x):
    """The worst at any lag of the stream, of the numbers and of their squares."""
    worst = 0.0
    for f in (x.ravel(), x.ravel() ** 2 - 1):
        power = abs(np.fft.rfft(f.astype(float))) ** 2
        c = np.fft.irfft(power)
        worst = max(worst, abs(c[1:]).max() / c[0])
    return worst * np.sqrt(x.size)


@pytest.fixture(scope="module")
def stream():
    return draw(64, 512)  # two million numbers


@pytest.fixture(scope="module")
def tensor():
    """(keys, calls, blocks, rows, lanes)"""
    return np.array([[draw(16, 48, key, call) for call in range(4)] for key in KEYS])


@pytest.mark.parametrize(
    ("counter", "key", "words"),
    [
        ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
        ((0xFFFFFFFF,) * 4, (0xFFFFFFFF,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
        (
            (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
            (0xA4093822, 0x299F31D0),
            (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
        ),
    ],
)
def test_philox_gives_the_published_numbers(counter, key, words):
    """kat_vectors of Random123 (Salmon et al. 2011); the third is the digits of pi."""
    assert philox(*np.array(counter + key, np.uint32)) == words


def test_box_muller_follows_its_formula_into_the_corners():
    corners = np.array([0, 1, 255, 256, 2**30, 2**31 - 1, 2**31, 2**32 - 256, 2**32 - 1], np.uint32)
    words = np.random.default_rng(0).integers(0, 2**32, (2, 10**4), np.uint32)
    a, b = np.hstack([np.array(np.meshgrid(corners, corners)).reshape(2, -1), words])
    out = np.array([box_muller(*pair) for pair in zip(a, b, strict=True)])  # one by one
    radius = np.sqrt(-2 * np.log(((a >> 8) + 0.5) * 2.0**-24))
    angle = 2 * np.pi * b.astype(float) / 2**32
    error = abs(out - (radius * [np.sin(angle), np.cos(angle)]).T).max(axis=1)
    # the series; the uniform's last bit near 1
    assert (error < 1e-5 * radius + 1.1 * 2.0**-24 / radius).all()


def test_moments_are_those_of_a_standard_normal(stream):
    assert moments(stream) < LIMIT
    assert moments(stream * np.sqrt(1.01)) > LIMIT  # variance one per cent off


def test_distribution_function_is_normal(stream):
    n = stream.size
    assert kolmogorov_smirnov(stream.ravel()) < KS_LIMIT
    uniforms = np.random.default_rng(0).random((12, n), np.float32)
    # twelve uniforms pass for normal at a glance
    assert kolmogorov_smirnov(uniforms.sum(axis=0) - 6) > KS_LIMIT


def test_tails_are_normal_beyond_five_sigma():
    x = draw(256, 1280)  # 21 million: 6 expected beyond 5 on either side
    assert np.isfinite(x).all()
    assert tails(x) < LIMIT
    assert abs(x).max() > 5.2
    assert tails(np.clip(x, -4.5, 4.5)) > LIMIT  # a generator that stops at 4.5
    assert tails(x * np.float32(1.01)) > LIMIT


@pytest.mark.parametrize("axis", range(5), ids=AXES)
def test_numbers_are_independent_over(axis, tensor):
    def worst(z):
        return correlations(np.moveaxis(z, axis, 0).reshape(z.shape[axis], -1))

    assert worst(tensor) < LIMIT
    first, second, *_ = np.moveaxis(tensor, axis, 0)
    for copy in (first, np.copysign(first, second)):  # again, and again with signs of its own
        planted = tensor.copy()
        np.moveaxis(planted, axis, 0)[1] = copy
        assert worst(planted) > LIMIT


def test_stream_does_not_repeat_itself_at_any_lag(stream):
    limit = 7.0  # the worst of two million lags
    assert autocorrelation(stream) < limit
    lagged = stream.copy()
    lagged[1, :, 1:] = stream[0, :, :-1]  # a copy one lane on, one block later
    assert autocorrelation(lagged) > limit


def test_number_depends_on_its_place_alone():
    """Fewer rows or blocks are the first rows and blocks of more, also where the last group of four
    is short."""
    whole = draw(3, 16)
    for rows in range(1, 16):
        np.testing.assert_array_equal(draw(2, rows), whole[:2, :rows])


def test_rows_are_scaled_one_by_one():
    scale = np.array([0.0, 0.5, 1.0, 3.0, 1e-3, 7.0], np.float32)
    np.testing.assert_allclose(draw(4, 6, scale=scale), draw(4, 6) * scale[:, None], rtol=1e-6)


def test_numbers_are_the_same_for_one_and_two_threads(on_threads):
    one, two = (on_threads(n, lambda: draw(33, 70)) for n in (1, 2))
    np.testing.assert_array_equal(one, two)
