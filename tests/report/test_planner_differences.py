"""Variants that differ in their sampler say what else differs."""

from quadsim.config.spec import Spec
from quadsim.report.planner_differences import planner_differences


def records(**variants):
    return {name: Spec.of("figure8", **own).record() for name, own in variants.items()}


def test_what_a_preset_changes_with_its_sampler_is_named():
    (line,) = planner_differences(
        records(gaussian={"sampler": "gaussian"}, colored={"sampler": "colored"})
    )
    assert line.startswith("Beside the sampler, these numbers of the preset differ: ")
    assert "overshoot (gaussian 1, colored 2)" in line
    assert "first_noise (gaussian 1, colored 0.3)" in line
    assert "cost_rise (gaussian 0, colored 2)" in line


def test_one_sampler_and_equal_numbers_need_no_line():
    plain = {"sampler": "colored"}
    assert planner_differences(records(one=plain, other=plain | {"overshoot": 1.0})) == []
    equal = {"overshoot": 1.0, "first_noise": 1.0, "cost_rise": 0.0}
    both = records(gaussian=equal | {"sampler": "gaussian"}, colored=equal | plain)
    assert planner_differences(both) == []
