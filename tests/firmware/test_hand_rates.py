"""The rates of a person's sticks are those of the firmware itself."""

import numpy as np
import pytest

from quadsim.firmware.configuration import configured
from quadsim.firmware.text import Text
from quadsim.racing.hand import Rates


@pytest.mark.parametrize("expo", [0, 40])
def test_the_rates_of_a_stick_are_betaflight_s_actual_rates(built, expo):
    lines = ["set rates_type = ACTUAL", "set rc_smoothing = OFF", "aux 0 0 0 1700 2100 0 0"]
    for axis in ("roll", "pitch", "yaw"):
        lines += [f"set {axis}_rc_rate = 7", f"set {axis}_srate = 67", f"set {axis}_expo = {expo}"]
    found = configured(built.program, Text("hand.txt", tuple(lines)), motors_reversed=True)
    rates = Rates(expo=expo / 100)
    stick = (found.positions - 1500.0) / 500.0
    wanted = np.array([rates.rate(position) for position in stick])
    for curve in found.rates:
        # The stick of yaw has the other sign.
        assert np.allclose(curve, np.sign(curve[-1]) * wanted, atol=1e-3)
