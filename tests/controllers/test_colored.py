"""The laws of colored noise, each against its own formula written afresh, with a noise that the
test rejects."""

import colorednoise
import numpy as np
import pytest
from scipy.linalg import cholesky, solve_triangular, toeplitz

from quadsim.controllers.samplers.colored import LAWS, Colored, spectrum, transform_length
from quadsim.files.values import SettingError

GAMMA = (0.0, 0.5, 1.0, 2.0, 4.0)
# Each length of a transform is compiled, so these horizons have three: 80 steps; 28, which races on
# a short course have too; and 63, which is odd and one step longer than both samples of law exact.
HORIZONS = {"exact": (40, 31), "paper": (80, 63), "library": (40, 14)}
EVEN = {law: horizons[0] for law, horizons in HORIZONS.items()}
SIZES = [(law, T) for law, horizons in HORIZONS.items() for T in horizons]
# T -> n of law exact, where a prime factor of 2 T is above 13
LENGTHS = {31: 63, 145: 294, 149: 300, 155: 312}
LIMIT = 5.5  # standard errors, the worst of some ten thousand numbers
M = 8192


def draw(key, law, T, gamma=GAMMA, call=1):
    """Unit-variance samples of one series each, of law exact its two one after the other.  (M,
    channels, steps)"""
    samples = 2 * M if law == "exact" else M
    z = Colored((1.0,) * len(gamma), gamma, law).build(samples, (1,) * T, key, dt=0.1).sample(call)
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


@pytest.mark.compiled
@pytest.mark.parametrize(("law", "T"), SIZES)
def test_covariance_is_that_of_the_law_and_of_no_other_colour(key, law, T):
    for z, gamma in zip(draw(key, law, T).swapaxes(0, 1), GAMMA, strict=True):
        assert misfit(z[:, :T], covariance(T, gamma, law)) < LIMIT
        assert misfit(z[:, :T], covariance(T, gamma + 0.1, law)) > LIMIT


@pytest.mark.compiled
@pytest.mark.parametrize("law", ["exact", "paper"])
def test_power_falls_with_the_gamma_th_power_of_frequency(key, law):
    """Over the whole transform the bins are independent, so the estimate is free of leakage (error
    about .002)."""
    for z, gamma in zip(draw(key, law, EVEN[law]).swapaxes(0, 1), GAMMA, strict=True):
        assert slope(z) == pytest.approx(-gamma, abs=0.01)
    other = colorednoise.powerlaw_psd_gaussian(1.05, (M, 80), random_state=1)
    assert slope(other) != pytest.approx(-1.0, abs=0.01)


@pytest.mark.compiled
@pytest.mark.parametrize("gamma", GAMMA)
def test_spectrum_is_that_of_the_colorednoise_package(key, gamma):
    """An independent witness. It normalises without DC and doubles its power, so the scale is left
    free."""
    ours, theirs = (
        draw(key, "exact", EVEN["exact"], (gamma,))[:, 0],
        colorednoise.powerlaw_psd_gaussian(gamma, (M, 80), random_state=1),
    )
    ratio = (
        (abs(np.fft.rfft(ours)) ** 2).mean(axis=0) / (abs(np.fft.rfft(theirs)) ** 2).mean(axis=0)
    )[1:-1]
    assert abs(ratio / ratio.mean() - 1).max() < LIMIT * np.sqrt(2 / M)


@pytest.mark.compiled
@pytest.mark.parametrize("law", ["exact", "paper"])
def test_gamma_zero_is_white(key, law):
    T = EVEN[law]
    white, tinted = draw(key, law, T, (0.0, 0.1)).swapaxes(0, 1)[:, :, :T]
    assert misfit(white, np.eye(T)) < LIMIT < misfit(tinted, np.eye(T))


@pytest.mark.compiled
@pytest.mark.parametrize("T", HORIZONS["exact"])
def test_exact_variance_is_one_at_every_time(key, T):
    error = np.sqrt(2 / M)
    assert abs((draw(key, "exact", T) ** 2).mean(axis=0) - 1).max() < LIMIT * error
    even = EVEN["paper"]
    assert abs((draw(key, "paper", even)[:, 0] ** 2).mean() - 1) > LIMIT * error / np.sqrt(even)


def band_limited(key, T, cutoff):
    """Return samples of law exact with a cut-off [Hz], at a control period of 0.1 s.

    The shape is (M, channels, 2 T), with both samples of a transform one after the other.
    """
    sampler = Colored((1.0,) * len(GAMMA), GAMMA, cutoff=(cutoff,) * len(GAMMA))
    z = sampler.build(2 * M, (1,) * T, key, dt=0.1).sample(1)
    return z.transpose(0, 3, 1, 2).reshape(M, len(GAMMA), -1).astype(float)


def band_limited_power(n, gamma, cutoff):
    """Return each bin's part of the variance, below that of the law by the roll-off squared."""
    f = np.arange(n // 2 + 1) / (n * 0.1)
    factors = 1 / (1 + (f / cutoff) ** 4)
    return power(n, gamma, "exact") * np.where(factors < 0.01, 0.0, factors**2)


@pytest.mark.compiled
def test_a_cut_off_lowers_the_power_above_it_for_every_gamma(key):
    n = 80
    z = band_limited(key, T=40, cutoff=1.0)
    # A bin's power is a mean over M squares, or over 2 M where it is complex.
    found = (abs(np.fft.rfft(z, norm="forward")) ** 2).mean(axis=0)
    found[:, 1 : n // 2] *= 2
    error = np.sqrt(2 / M)

    def differs(of_gamma, expected):
        left = expected > 0
        return abs(of_gamma[left] / expected[left] - 1).max() > LIMIT * error

    for of_gamma, gamma in zip(found, GAMMA, strict=True):
        expected = band_limited_power(n, gamma, 1.0)
        assert np.flatnonzero(expected).max() == 25, "3.15 Hz is bin 25.2"
        assert of_gamma[expected == 0] == pytest.approx(0, abs=1e-12)
        assert not differs(of_gamma, expected)
        assert differs(of_gamma, band_limited_power(n, gamma, 1.1))
        assert differs(of_gamma, power(n, gamma, "exact"))


@pytest.mark.compiled
@pytest.mark.parametrize("T", HORIZONS["exact"])
def test_sigma_is_the_deviation_without_the_cut_off(key, T):
    """At even and at odd lengths the variance of each step is that of the bins that are left."""
    n = LENGTHS.get(T, 2 * T)
    variance = (band_limited(key, T, cutoff=1.0) ** 2).mean(axis=0)
    for of_gamma, gamma in zip(variance, GAMMA, strict=True):
        expected = band_limited_power(n, gamma, 1.0).sum()
        assert expected < 1
        assert abs(of_gamma / expected - 1).max() < LIMIT * np.sqrt(2 / M)


@pytest.mark.compiled
def test_a_cut_off_of_zero_is_none(key):
    given = {"samples": 64, "lengths": (1,) * 40, "key": key, "dt": 0.05}
    off, none = (Colored((1.0,) * 2, (0.0, 2.0), cutoff=cut) for cut in ((0.0, 0.0), None))
    assert none.cutoff == ()
    np.testing.assert_array_equal(off.build(**given).sample(1), none.build(**given).sample(1))
    Colored((1.0,) * 2, (0.0, 2.0), law="paper", cutoff=(0.0, 0.0))


def test_a_cut_off_has_a_frequency_for_each_control_and_belongs_to_the_exact_law():
    with pytest.raises(SettingError, match=r"cutoff: expected 2 frequencies \[Hz\].* got 1"):
        Colored((1.0, 1.0), (0.0, 2.0), cutoff=(5.0,))
    with pytest.raises(SettingError, match="cutoff: expected none with the law paper"):
        Colored((1.0,), (2.0,), "paper", cutoff=(5.0,))


@pytest.mark.compiled
def test_both_samples_of_a_longer_transform_have_its_law(key):
    """The last step of the second is not the periodic neighbour of the first: n - 2 T steps without
    use part them."""
    T = 31
    colours = (0.0, 1.0, 2.0)
    for series, gamma in zip(draw(key, "exact", T, colours).swapaxes(0, 1), colours, strict=True):
        first, second = series[:, :T], series[:, T:]
        for z in (first, second):
            assert (
                misfit(z, covariance(T, gamma, "exact"))
                < LIMIT
                < misfit(z, covariance(T, gamma + 0.1, "exact"))
            )
        c = autocovariance(LENGTHS[T], gamma, "exact")
        wrap, error = (
            correlation(second[:, -1], first[:, 0]),
            LIMIT * (1 - c[2 * T - 1] ** 2) / np.sqrt(M),
        )
        assert wrap == pytest.approx(c[2 * T - 1], abs=error)
        assert gamma == 0 or wrap < c[1] - error


def test_transform_of_law_exact_is_twice_the_horizon_unless_a_prime_factor_is_large():
    same = {T: 2 * T for T in (20, 40, 65, 80, 100, 150, 250)}
    for T, n in (LENGTHS | same).items():
        found = {law: transform_length(T, law) for law in LAWS}
        assert found == {"exact": n, "paper": T, "library": 2 * T}


@pytest.mark.compiled
def test_sigma_scales_a_channel(key):
    one, two = (
        Colored((s, 1.0), (2.0, 1.0)).build(64, (1,) * 40, key, dt=0.1).sample(1)
        for s in (1.0, 2.0)
    )
    np.testing.assert_allclose(two[:, 0], 2 * one[:, 0], rtol=1e-6)
    np.testing.assert_array_equal(two[:, 1], one[:, 1])


# Numbers of a horizon of 150 steps for some gamma, rounded.
# Law paper: the correlation of the first with the last step.
PERIODIC = {0.5: 0.33, 1.0: 0.68, 2.0: 0.97, 4.0: 0.999}
# Law exact: the correlation of the two samples of a series at one time, and that of the first one's
# last step with the second one's first step.
OPPOSITE = {1.0: -0.08, 2.0: -0.30, 4.0: -0.52}
SEAM = {1.0: 0.72, 2.0: 0.987, 4.0: 0.9997}
# Law library: the variance before the offset is taken off.
GROWN = {0.01: 1.00, 0.5: 1.01, 1.0: 1.04, 2.0: 1.15, 4.0: 1.23}


def test_published_numbers_are_those_of_the_laws():
    """The laws are those that the draws of shorter horizons are compared with."""
    T = 150
    for gamma, published in PERIODIC.items():
        c = autocovariance(T, gamma, "paper")
        assert c[-1] / c[0] == pytest.approx(published, abs=0.005)
    for gamma, published in OPPOSITE.items():
        c = autocovariance(2 * T, gamma, "exact")
        assert (c[T], c[1]) == pytest.approx((published, SEAM[gamma]), abs=0.005)
    for gamma, published in GROWN.items():
        assert autocovariance(2 * T, gamma, "library")[0] == pytest.approx(published, abs=0.005)


@pytest.mark.compiled
def test_paper_law_is_periodic_and_exact_is_not(key):
    """A transform of length T makes the last number the first one's neighbour; of 2T, the farthest
    away."""
    gamma = tuple(PERIODIC)
    T = EVEN["paper"]
    for z, g in zip(draw(key, "paper", T, gamma).swapaxes(0, 1), gamma, strict=True):
        c = autocovariance(T, g, "paper")
        assert correlation(z[:, 0], z[:, -1]) == pytest.approx(c[-1] / c[0], abs=0.03)
    T = EVEN["exact"]
    for z in draw(key, "exact", T, gamma).swapaxes(0, 1):
        near, half_way, last = (correlation(z[:, 0], z[:, t]) for t in (1, T // 2, T - 1))
        assert near > half_way + 0.05
        assert half_way + 0.05 > last
        assert last < 0.05


@pytest.mark.compiled
def test_halves_of_an_exact_series_have_one_law_and_are_neighbours(key):
    """Each half alone is a sample of the law; together they are antithetic, c(T) < 0, but alike at
    the seam, c(1)."""
    gamma = tuple(OPPOSITE)
    T = EVEN["exact"]
    for series, g in zip(draw(key, "exact", T, gamma).swapaxes(0, 1), gamma, strict=True):
        c = autocovariance(2 * T, g, "exact")
        first, second = series[:, :T], series[:, T:]
        assert misfit(second, covariance(T, g, "exact")) < LIMIT
        assert correlation(first, second) == pytest.approx(c[T], abs=0.03)
        assert c[T] < -0.06
        assert correlation(first[:, -1], second[:, 0]) == pytest.approx(c[1], abs=0.02)
        assert correlation(first, np.roll(second, 1, axis=0)) == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize(
    ("T", "gamma", "variance"),
    [(9, 0.0, 1.0), (9, 1.0, 1.0), (8, 0.0, 14 / 17), (8, 1.0, 103 / 112)],
)
def test_paper_variance_is_one_for_odd_lengths_and_less_for_even_ones(T, gamma, variance):
    """zeta counts the Nyquist bin of an even length four times; a real bin adds once."""
    assert (spectrum(T, gamma, "paper") ** 2).sum() == pytest.approx(variance, rel=1e-12)


@pytest.mark.compiled
@pytest.mark.parametrize(("T", "variance"), [(63, 1.0), (80, 1 - 3 / 161)])
def test_samples_of_law_paper_have_its_variance(key, T, variance):
    """White ones, whose variance is the closest to its expectation, (1 + 4 * 39 + 1) / 161."""
    error = variance * np.sqrt(2 / (M * T))
    assert (draw(key, "paper", T, (0.0,)) ** 2).mean() == pytest.approx(variance, abs=LIMIT * error)
    assert LIMIT * error < 3 / 161, "which tells the two apart"


@pytest.mark.parametrize("gamma", GAMMA)
@pytest.mark.parametrize("T", [8, 9, 150])
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


@pytest.mark.compiled
def test_library_law_has_an_offset_decay_over_a_variance_that_grows_with_gamma(key):
    """Undone, z_t + z_1 .97^t, the variance is that of a normalisation without the DC bin."""
    gamma = tuple(GROWN)
    T = EVEN["library"]
    z = draw(key, "library", T, gamma)
    variance = [autocovariance(2 * T, g, "library")[0] for g in gamma]
    offset = z[:, :, 1:2] / (1 - 0.97)
    np.testing.assert_allclose(offset.std(axis=(0, 2)), np.sqrt(variance), rtol=0.04)
    undone = z + offset * 0.97 ** np.arange(T)
    np.testing.assert_allclose((undone**2).mean(axis=(0, 2)), variance, rtol=0.03)
