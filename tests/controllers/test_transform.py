"""The transform in lanes against numpy's, for lengths of every kind of factor."""

import numpy as np
import pytest

from quadsim.controllers.lanes.layout import LANES
from quadsim.controllers.lanes.normals import fill_normals
from quadsim.controllers.lanes.passes import frequencies, narrowest_band, passes
from quadsim.controllers.lanes.transform import fill_transformed

# Radices 2 to 7, and 31 in a loop; those of other tests, as each is compiled
N = [62, 63, 80]
SOME = 80


def bins(n, scale, key, first=0, call=3):
    """Return the bins that the transform starts from, for two series of one channel.

    They are complex, of shape (n, LANES).
    """
    rows = np.empty((1, 2 * n, LANES), np.float32)
    fill_normals(rows, scale, key, call, first)
    return rows[0, :n] + 1j * rows[0, n:]


def fill(n, scale, key, series=2, steps=None, first=0, offset=0.0):
    steps = steps or n
    z = np.full((series, 1, steps, LANES), np.nan, np.float32)
    fill_transformed(z, scale[None], np.full(steps, offset, np.float32), key, 3, first, n)
    return z[:, 0]


def in_plain_python(n, Z):
    """Return what the passes make of Z (B,), run as Python."""
    text, result, turns = passes(n, lanes=1, band=len(Z))
    names = {"F": float, "turns": np.array([(turn.real, turn.imag) for turn in turns])}
    names |= {"x": np.resize(np.hstack([Z.real, Z.imag]), 2 * n), "y": np.empty(2 * n)}
    exec(text, names)
    return names[result][:n] + 1j * names[result][n:]


def test_the_passes_of_every_length_are_the_transform():
    """All radices that are written out, 2 to 13, and large primes in a loop."""
    for n in [*range(2, 41), 7 * 13, 11 * 13, 150, 300]:
        Z = np.random.default_rng(n).normal(size=(n, 2)) @ (1.0, 1j)
        z = np.fft.ifft(Z, norm="forward")
        np.testing.assert_allclose(in_plain_python(n, Z), z, atol=1e-12, err_msg=f"n = {n}")


@pytest.mark.parametrize(
    ("n", "band"), [(12, 12), (12, 6), (12, 4), (12, 3), (12, 1), (39, 3), (80, 16), (300, 100)]
)
def test_the_passes_from_a_band_are_the_transform_of_the_band_and_zeros(n, band):
    Z = np.random.default_rng(n).normal(size=(band, 2)) @ (1.0, 1j)
    whole = np.zeros(n, complex)
    whole[frequencies(band)] = Z
    np.testing.assert_allclose(
        in_plain_python(n, Z), np.fft.ifft(whole, norm="forward"), atol=1e-12
    )


@pytest.mark.parametrize(
    ("n", "highest", "band"),
    [(300, 0, 25), (300, 47, 100), (300, 49, 100), (300, 50, 150), (300, 75, 300), (62, 15, 31)],
)
def test_the_narrowest_band_holds_the_highest_frequency_on_both_sides(n, highest, band):
    assert narrowest_band(n, highest) == band
    assert {-highest, highest} <= set(frequencies(band)) or band == n


@pytest.fixture
def scale():
    return lambda n: np.tile(np.random.default_rng(n).uniform(0.5, 2.0, n), 2).astype(np.float32)


@pytest.mark.compiled
@pytest.mark.parametrize("n", N)
def test_parts_of_the_transform_are_the_two_series(n, scale, key):
    Z = bins(n, scale(n), key)
    z = np.fft.ifft(Z, axis=0, norm="forward")
    tolerance = 1e-5 * np.sqrt((abs(Z) ** 2).sum(axis=0)).max()
    np.testing.assert_allclose(fill(n, scale(n), key), [z.real, z.imag], atol=tolerance)
    # the sign of the exponent matters
    assert abs(np.fft.fft(Z, axis=0) - z).max() > 100 * tolerance or n < 3


@pytest.mark.compiled
def test_fewer_steps_and_an_odd_number_of_series_are_the_same_numbers(scale, key):
    whole = fill(SOME, scale(SOME), key, series=4)
    np.testing.assert_array_equal(fill(SOME, scale(SOME), key, series=3, steps=17), whole[:3, :17])


@pytest.mark.compiled
def test_series_can_be_made_without_those_before_them(scale, key):
    whole = fill(SOME, scale(SOME), key, series=4)
    np.testing.assert_array_equal(fill(SOME, scale(SOME), key, first=1), whole[2:])
    assert not np.array_equal(whole[:2], whole[2:])


@pytest.mark.compiled
def test_offset_takes_its_share_of_the_second_step(scale, key):
    plain = fill(SOME, scale(SOME), key)
    np.testing.assert_allclose(
        fill(SOME, scale(SOME), key, offset=0.5), plain - 0.5 * plain[:, 1:2], atol=1e-5
    )
