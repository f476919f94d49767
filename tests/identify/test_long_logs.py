"""Long logs: which spans are fitted, and products that start no threads."""

import numpy as np
import pytest

from quadsim.identify.budget import MOST_TIME, SPAN, liveliest
from quadsim.identify.products import MOST_MULTIPLICATIONS, inner
from quadsim.identify.stretches import _calm_voltage, stretches
from quadsim.logs.flight_log import SIGNALS, FlightLog

RATE = 20.0  # [Hz]
TIMES_AS_LONG = 3


def long_log():
    """Return a flight of three times MOST_TIME that moves in its last third alone."""
    n = round(TIMES_AS_LONG * MOST_TIME * RATE)
    t = np.arange(n) / RATE
    moving = t >= (TIMES_AS_LONG - 1) * MOST_TIME
    rng = np.random.default_rng(0)
    motors = 0.5 + np.where(moving, 0.2, 0.01)[:, None] * rng.uniform(-1.0, 1.0, (n, 4))
    table = dict.fromkeys(SIGNALS) | {"motor_commands": motors}
    return FlightLog(name="long", t=t, **table, pieces=(slice(0, n),), remarks=())


def test_the_liveliest_spans_of_a_long_log_are_fitted():
    (whole,) = stretches(long_log())
    kept = liveliest([whole])
    assert MOST_TIME - SPAN <= sum(each.duration for each in kept) <= MOST_TIME
    assert min(each.start for each in kept) >= (TIMES_AS_LONG - 1) * MOST_TIME
    assert liveliest(kept) == kept, "a log that is short enough stays as it is"


@pytest.mark.parametrize("rows", [1, 500, 3 * MOST_MULTIPLICATIONS // 35 + 7])
def test_a_product_in_blocks_is_the_product(rows):
    rng = np.random.default_rng(0)
    A = rng.standard_normal((rows, 5))
    B = rng.standard_normal((rows, 7))
    np.testing.assert_allclose(inner(A, B), A.T @ B, rtol=1e-9, atol=1e-9 * rows)


def test_a_voltage_is_averaged_as_far_as_its_noise_demands():
    rng = np.random.default_rng(0)
    sag = np.where(np.arange(400) % 100 < 50, 16.0, 15.0)
    np.testing.assert_array_equal(_calm_voltage(sag, 0.005), sag)
    noisy = 16.0 + 0.3 * rng.standard_normal(400)
    assert np.std(_calm_voltage(noisy, 0.005)) < 0.4 * np.std(noisy)
