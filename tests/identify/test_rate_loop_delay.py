"""The delayed commands of a rate loop's fit."""

import numpy as np
import pytest

from quadsim.identify.rate_loop import _delayed


def test_a_signal_is_held_beyond_its_ends_whatever_its_delay():
    values = np.array([1.0, 2.0, 4.0])
    assert _delayed(values, 0.0).tolist() == [1.0, 2.0, 4.0]
    assert _delayed(values, 0.5) == pytest.approx([1.0, 1.5, 3.0])
    # a solver's step below zero
    assert _delayed(values, -0.5) == pytest.approx([1.5, 3.0, 4.0])
