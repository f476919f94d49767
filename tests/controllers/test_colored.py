"""The laws of colored noise, each against its own formula written afresh, with a noise that the
test rejects."""

import colorednoise
import numpy as np
import pytest
from scipy.linalg import cholesky, solve_triangular, toeplitz

from controllers.samplers.colored import LAWS, Colored, spectrum, transform_length

GAMMA = (0.0, 0.5, 1.0, 2.0, 4.0)
# T -> n of law exact, where a prime factor of 2 T is above 13
LENGTHS = {145: 294, 149: 300, 155: 312}
LIMIT = 5.5  # standard errors, the worst of some ten thousand numbers
M = 8192


def draw(key, law, T, gamma=GAMMA, call=1):
    """Unit-variance samples of one series each, of law exact its two one after the other.  (M,
    channels, steps)"""
    samples = 2 * M if law == "exact" else M
    z = Colored((1.0,) * len(gamma), gamma, law).build(samples, T, key, dt=0.1).sample(call)
    return z.transpose(0, 3, 1, 2).reshape(M, len(gamma), -1).astype(float)


def power(n, gamma, law):
    """Return each bin's part of the variance, from the law's definition.  (n // 2 + 1,)"""
    k = np.arange(1, n // 2 + 1) ** -float(gamma)
    bins = np.concatenate([[1.0], 4.0 * k])
    zeta = bins.sum()  # as published: every bin but DC counts four times
    if n % 2 == 0:
        bins[-1] /= 4.0  # the Nyquist bin is real and has no twin
    return bins / {"exact": bins.sum(), "paper": zeta, "library": bins[1:].sum()}[law]


def autocovariance(n, gamma, law):
    """c(lag) of the whole transform.  (n,)"""
    p = power(n, gamma, law)
    return np.cos(2 * np.pi * np.outer(np.arange(n), np.arange(len(p))) / n) @ p


def covariance(T, gamma, law):
    """Of one sample.  (T, T)"""
    n = {"exact": LENGTHS.get(T, 2 * T), "paper": T, "library": 2 * T}[law]
    C = toeplitz(autocovariance(n, gamma, law)[:T])
    if law == "library":
        A = np.eye(T)
        A[:, 1] -= 0.97 ** np.arange(T)
        C = A @ C @ A.T
    return C


def misfit(z, C):
    """The worst entry of the covariance of z, whitened by C, in standard errors.  z (M, T)"""
    w = solve_triangular(cholesky(C, lower=True), z.T, lower=True)
    S, identity = w @ w.T / len(z), np.eye(len(C))
    return (abs(S - identity) * np.sqrt(len(z) / (1 + identity))).max()


def slope(z):
    """Of the mean periodogram over frequency, both logarithmic, between DC and Nyquist.  z (M,
    n)"""
    P = (abs(np.fft.rfft(z)) ** 2).mean(axis=0)
    k = np.arange(1, (z.shape[1] + 1) // 2)
    return np.polyfit(np.log(k), np.log(P[k]), 1)[0]


def correlation(a, b):
    return (a * b).mean() / np.sqrt((a * a).mean() * (b * b).mean())


@pytest.mark.parametrize("T", [64, 65])
@pytest.mark.parametrize("law", LAWS)
def test_covariance_is_that_of_the_law_and_of_no_other_colour(key, law, T):
    for z, gamma in zip(draw(key, law, T).swapaxes(0, 1), GAMMA, strict=True):
        assert misfit(z[:, :T], covariance(T, gamma, law)) < LIMIT
        assert misfit(z[:, :T], covariance(T, gamma + 0.1, law)) > LIMIT


@pytest.mark.parametrize("law", ["exact", "paper"])
def test_power_falls_with_the_gamma_th_power_of_frequency(key, law):
    """Over the whole transform the bins are independent, so the estimate is free of leakage (error
    about .002)."""
    for z, gamma in zip(draw(key, law, 65).swapaxes(0, 1), GAMMA, strict=True):
        assert slope(z) == pytest.approx(-gamma, abs=0.01)
    other = colorednoise.powerlaw_psd_gaussian(1.05, (M, 130), random_state=1)
    assert slope(other) != pytest.approx(-1.0, abs=0.01)


@pytest.mark.parametrize("gamma", GAMMA)
def test_spectrum_is_that_of_the_colorednoise_package(key, gamma):
    """An independent witness. It normalises without DC and doubles its power, so the scale is left
    free."""
    ours, theirs = (
        draw(key, "exact", 65, (gamma,))[:, 0],
        colorednoise.powerlaw_psd_gaussian(gamma, (M, 130), random_state=1),
    )
    ratio = (
        (abs(np.fft.rfft(ours)) ** 2).mean(axis=0) / (abs(np.fft.rfft(theirs)) ** 2).mean(axis=0)
    )[1:-1]
    assert abs(ratio / ratio.mean() - 1).max() < LIMIT * np.sqrt(2 / M)


@pytest.mark.parametrize("law", ["exact", "paper"])
def test_gamma_zero_is_white(key, law):
    white, tinted = draw(key, law, 65, (0.0, 0.1)).swapaxes(0, 1)[:, :, :65]
    assert misfit(white, np.eye(65)) < LIMIT < misfit(tinted, np.eye(65))


@pytest.mark.parametrize("T", [150, *LENGTHS])
def test_exact_variance_is_one_at_every_time(key, T):
    error = np.sqrt(2 / M)
    assert abs((draw(key, "exact", T) ** 2).mean(axis=0) - 1).max() < LIMIT * error
    assert abs((draw(key, "paper", 150)[:, 0] ** 2).mean() - 1) > LIMIT * error / np.sqrt(150)


@pytest.mark.parametrize("T", LENGTHS)
def test_both_samples_of_a_longer_transform_have_its_law(key, T):
    """The last step of the second is not the periodic neighbour of the first: n - 2 T steps without
    use part them."""
    colours, limit = (0.0, 1.0, 2.0), LIMIT + 0.5  # the worst of 200 000 numbers
    for series, gamma in zip(draw(key, "exact", T, colours).swapaxes(0, 1), colours, strict=True):
        first, second = series[:, :T], series[:, T:]
        for z in (first, second):
            assert (
                misfit(z, covariance(T, gamma, "exact"))
                < limit
                < misfit(z, covariance(T, gamma + 0.1, "exact"))
            )
        c = autocovariance(LENGTHS[T], gamma, "exact")
        wrap, error = (
            correlation(second[:, -1], first[:, 0]),
            LIMIT * (1 - c[2 * T - 1] ** 2) / np.sqrt(M),
        )
        assert wrap == pytest.approx(c[2 * T - 1], abs=error)
        assert gamma == 0 or wrap < c[1] - error


SAME = {T: 2 * T for T in (20, 40, 65, 80, 100, 150, 250)}


@pytest.mark.parametrize(("T", "n"), (LENGTHS | SAME).items())
def test_transform_of_law_exact_is_twice_the_horizon_unless_a_prime_factor_is_large(T, n):
    assert transform_length(T, "exact") == n
    assert (transform_length(T, "paper"), transform_length(T, "library")) == (T, 2 * T)


def test_sigma_scales_a_channel(key):
    one, two = (
        Colored((s, 1.0), (2.0, 1.0)).build(64, 33, key, dt=0.1).sample(1) for s in (1.0, 2.0)
    )
    np.testing.assert_allclose(two[:, 0], 2 * one[:, 0], rtol=1e-6)
    np.testing.assert_array_equal(two[:, 1], one[:, 1])


def test_paper_law_is_periodic_and_exact_is_not(key):
    """A transform of length T makes the last number the first one's neighbour; of 2T, the farthest
    away."""
    gamma = (0.5, 1.0, 2.0, 4.0)
    for z, published in zip(
        draw(key, "paper", 150, gamma).swapaxes(0, 1), (0.33, 0.68, 0.97, 0.999), strict=True
    ):
        assert correlation(z[:, 0], z[:, -1]) == pytest.approx(published, abs=0.03)
    for z in draw(key, "exact", 150, gamma).swapaxes(0, 1):
        near, half_way, last = (correlation(z[:, 0], z[:, t]) for t in (1, 75, 149))
        assert near > half_way + 0.05
        assert half_way + 0.05 > last
        assert last < 0.05


def test_halves_of_an_exact_series_have_one_law_and_are_neighbours(key):
    """Each half alone is a sample of the law; together they are antithetic, c(T) < 0, but alike at
    the seam, c(1)."""
    z = draw(key, "exact", 150, (1.0, 2.0, 4.0)).swapaxes(0, 1)
    for series, gamma, opposite, seam in zip(
        z, (1, 2, 4), (-0.08, -0.30, -0.52), (0.72, 0.987, 0.9997), strict=True
    ):
        first, second = series[:, :150], series[:, 150:]
        assert misfit(second, covariance(150, gamma, "exact")) < LIMIT
        assert correlation(first, second) == pytest.approx(opposite, abs=0.03)
        assert correlation(first[:, -1], second[:, 0]) == pytest.approx(seam, abs=0.02)
        assert correlation(first, np.roll(second, 1, axis=0)) == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize(
    ("T", "gamma", "variance"),
    [(9, 0.0, 1.0), (9, 1.0, 1.0), (8, 0.0, 14 / 17), (8, 1.0, 103 / 112)],
)
def test_paper_variance_is_one_for_odd_lengths_and_less_for_even_ones(key, T, gamma, variance):
    """zeta counts the Nyquist bin of an even length four times; a real bin adds once."""
    assert (draw(key, "paper", T, (gamma,)) ** 2).mean() == pytest.approx(variance, abs=0.03)


@pytest.mark.parametrize("T", [8, 9, 150])
@pytest.mark.parametrize("gamma", GAMMA)
def test_paper_spectrum_is_the_published_formula(T, gamma):
    N = T // 2 + 1
    n = np.arange(N)
    zeta = N**gamma / T**2 * (1 + 4 * np.sum(n[1:] ** -float(gamma)))
    # of X_k, which irfft divides by T
    published = np.maximum(n / N, 1 / N) ** (-gamma / 2) / np.sqrt(zeta) / T
    # a pair of bins of Z carries the power of one bin of X four times
    twins = np.where((2 * n) % T == 0, 1.0, 0.5)
    s = spectrum(T, gamma, "paper")
    np.testing.assert_allclose(s[:N], published / np.sqrt(twins))
    np.testing.assert_allclose(s[:0:-1], s[1:])


def test_library_law_has_an_offset_decay_over_a_variance_that_grows_with_gamma(key):
    """Undone, z_t + z_1 .97^t, the variance is that of a normalisation without the DC bin."""
    gamma = (0.01, 0.5, 1.0, 2.0, 4.0)
    z = draw(key, "library", 150, gamma)
    offset = z[:, :, 1:2] / (1 - 0.97)
    np.testing.assert_allclose(
        offset.std(axis=(0, 2)), np.sqrt([1.00, 1.01, 1.05, 1.15, 1.23]), rtol=0.04
    )
    undone = z + offset * 0.97 ** np.arange(150)
    np.testing.assert_allclose(
        (undone**2).mean(axis=(0, 2)), [1.00, 1.01, 1.05, 1.15, 1.23], rtol=0.03
    )
