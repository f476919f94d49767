"""The numbers of planner, samplers and costs have their ranges wherever an object is made."""

import numpy as np
import pytest

from quadsim.controllers.config import MPPIConfig
from quadsim.controllers.costs.race import RaceWeights
from quadsim.controllers.costs.reference import ReferenceWeights
from quadsim.controllers.samplers import SAMPLERS, Colored, Gaussian
from quadsim.files.values import SettingError

NAN = float("nan")
# Setting of MPPI -> the range that an error names, and wrong values.
WRONG = {
    "temperature": ("a number > 0 and <= 1e+06", (0, NAN, 10**400, None)),
    "samples": ("a whole number >= 2", (0, 64.0, "64", NAN)),
    "horizon": ("a whole number [steps] >= 2", (0,)),
    "dt": ("a number [s] > 0", (np.zeros(3),)),
    "first_iterations": ("a whole number >= 1", (1.5,)),
    "news_iterations": ("a whole number >= 1", (1.5,)),
    "smooth": ("true or false", (1,)),
    "adapt": ("true or false", ("true",)),
}


def test_a_number_of_mppi_out_of_its_range_is_refused_in_one_line():
    for name, (expected, values) in WRONG.items():
        for value in values:
            with pytest.raises(SettingError) as refused:
                MPPIConfig(**{name: value})
            assert str(refused.value).startswith(f"{name}: expected {expected}"), value
            assert "\n" not in str(refused.value)


def test_a_sigma_out_of_its_range_is_refused_by_every_sampler():
    for name, sampler in SAMPLERS.items():
        other = {"gamma": (0.0,) * 4} if name == "colored" else {}
        for sigma in ((1, 1, 1, NAN), (0,) * 4, "1234", None, ("1",) * 4):
            with pytest.raises(SettingError) as refused:
                sampler(sigma=sigma, **other)
            found = str(refused.value)
            assert found.startswith("sigma: expected "), (name, sigma)
            assert "numbers > 0 and <= 1000, got" in found, (name, sigma)


def test_the_law_of_colored_sampling_is_one_of_three():
    for law in ("exactly", np.ones(3), 1):
        with pytest.raises(SettingError, match=r"^law: expected 'exact' or"):
            Colored((1.0,), (1.0,), law=law)


def test_a_list_or_an_array_of_numbers_is_kept_as_a_tuple():
    assert Gaussian([1, 2]).sigma == (1.0, 2.0)
    assert Gaussian(np.array([1.0, 2.0])) == Gaussian((1.0, 2.0))
    assert type(MPPIConfig(samples=np.int64(64)).samples) is int


@pytest.mark.parametrize("weights", [RaceWeights, ReferenceWeights])
def test_a_weight_out_of_its_range_is_refused(weights):
    for value in (-1, NAN, "5", None, True):
        with pytest.raises(SettingError, match=r"^crash: expected a number >= 0"):
            weights(crash=value)
