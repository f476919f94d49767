"""The numbers of planner, samplers and costs have their ranges wherever an object is made."""

import numpy as np
import pytest

from controllers.config import MPPIConfig
from controllers.costs.race import RaceWeights
from controllers.costs.reference import ReferenceWeights
from controllers.samplers import SAMPLERS, Colored, Gaussian
from quadsim.files.values import SettingError

NAN = float("nan")


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("temperature", 0, "a number > 0 and <= 1e+06"),
        ("temperature", NAN, "a number > 0"),
        ("temperature", 10**400, "a number > 0"),
        ("temperature", None, "a number > 0"),
        ("samples", 0, "a whole number >= 2"),
        ("samples", 64.0, "a whole number >= 2"),
        ("samples", "64", "a whole number >= 2"),
        ("samples", NAN, "a whole number >= 2"),
        ("horizon", 0, "a whole number [steps] >= 2"),
        ("dt", np.zeros(3), "a number [s] > 0"),
        ("first_iterations", 1.5, "a whole number >= 1"),
        ("smooth", 1, "true or false"),
        ("adapt", "true", "true or false"),
    ],
)
def test_a_number_of_mppi_out_of_its_range_is_refused_in_one_line(name, value, expected):
    with pytest.raises(SettingError) as refused:
        MPPIConfig(**{name: value})
    assert str(refused.value).startswith(f"{name}: expected {expected}")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("sigma", [(1, 1, 1, NAN), (0,) * 4, "1234", None, ("1",) * 4])
def test_a_sigma_out_of_its_range_is_refused(sampler, sigma):
    other = {"gamma": (0.0,) * 4} if sampler == "colored" else {}
    with pytest.raises(SettingError, match=r"^sigma: expected .* numbers > 0 and <= 1000, got"):
        SAMPLERS[sampler](sigma=sigma, **other)


def test_the_law_of_colored_sampling_is_one_of_three():
    for law in ("exactly", np.ones(3), 1):
        with pytest.raises(SettingError, match=r"^law: expected 'exact' or"):
            Colored((1.0,), (1.0,), law=law)


def test_a_list_or_an_array_of_numbers_is_kept_as_a_tuple():
    assert Gaussian([1, 2]).sigma == (1.0, 2.0)
    assert Gaussian(np.array([1.0, 2.0])) == Gaussian((1.0, 2.0))
    assert type(MPPIConfig(samples=np.int64(64)).samples) is int


@pytest.mark.parametrize("weights", [RaceWeights, ReferenceWeights])
@pytest.mark.parametrize("value", [-1, NAN, "5", None, True])
def test_a_weight_out_of_its_range_is_refused(weights, value):
    with pytest.raises(SettingError, match=r"^crash: expected a number >= 0"):
        weights(crash=value)
