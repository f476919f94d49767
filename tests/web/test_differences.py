"""Claims about flights that are shown together: how they differ, and their names."""

from dataclasses import replace

import pytest
from web_cases import choices, competitor

from quadsim.controllers.presets import PRESETS
from quadsim.web.race.competitor import named
from quadsim.web.state.differences import brief, compared, differences, distinct_names

USUAL = PRESETS["race"]["colored"]
T = f"{USUAL.mppi.temperature:g}"


def record(sampler="colored", **more):
    return choices(sampler, **more).spec().record()


PLAIN = record()
GAUSSIAN = record("gaussian")
SEED = record(seed=5)
COLD = record(numbers={"temperature": 0.2})
FEW = record(numbers={"samples": 512})
WHITE = record(numbers={"gamma_rates": 0.0, "gamma_thrust": 0.0})
BOLD = record(settings={"crash": 0.0})
LONG = record(laps=2)
HAND = record("hand")


@pytest.mark.parametrize(
    ("other", "differ"),
    [
        (GAUSSIAN, "sampler"),
        (SEED, "seed (0 / 5)"),
        (COLD, f"temperature ({T} / 0.2)"),
        (record(laps=2), "laps (1 / 2)"),
        (record(sensing="mocap"), "sensing (perfect / mocap)"),
        (record(deadline_ms="8", clock="wall"), "clock (simulated / wall) and deadline (none / 8)"),
        (HAND, "controller"),
    ],
)
def test_all_that_differs_is_said_and_nothing_else(other, differ):
    assert compared([PLAIN, other]) == f"They differ in {differ}; all else is equal."


def test_flights_that_are_alike_are_called_so_and_one_is_not_compared():
    assert compared([PLAIN, record()]) == "They are all alike."
    assert compared([PLAIN]) == ""


def test_a_record_from_the_disk_is_the_record_of_the_flight():
    """JSON has lists in place of tuples."""
    stored = competitor("colored", laps=1).record
    assert differences([PLAIN, stored]) == []


def test_a_number_that_one_sampler_has_not_is_no_difference_from_it():
    assert [one.name for one in differences([WHITE, GAUSSIAN])] == ["sampler"]
    assert [one.name for one in differences([WHITE, PLAIN])] == ["gamma"]


@pytest.mark.parametrize(
    ("records", "names"),
    [
        ([PLAIN, GAUSSIAN], ["colored", "gaussian"]),
        ([PLAIN, SEED], ["colored seed 0", "colored seed 5"]),
        # what the preset has is not named
        ([PLAIN, COLD, GAUSSIAN], ["colored", "colored T 0.2", "gaussian"]),
        ([PLAIN, WHITE], ["colored", "colored γ 0"]),
        # a cost of crashes is no crash
        ([PLAIN, BOLD], ["colored", "colored crash cost 0"]),
        # each is named by what is its own, numbers of the planner first
        ([COLD, LONG, SEED], ["colored T 0.2", "colored laps 2", "colored seed 5"]),
        ([PLAIN, PLAIN], ["colored", "colored 2"]),
        # no single number tells all three apart, two do; what most have is left out
        ([PLAIN, COLD, FEW], ["colored", "colored T 0.2", "colored samples 512"]),
        ([COLD, COLD, PLAIN], ["colored T 0.2", "colored T 0.2 2", "colored"]),
    ],
)
def test_names_say_what_tells_flights_apart(records, names):
    assert distinct_names(records) == names


def test_names_do_not_change_when_the_flights_have_ended():
    live = named([replace(competitor(seed=seed), live=True, outcome=None) for seed in (0, 1)])
    ended = named([competitor(seed=seed) for seed in (0, 1)])
    assert [one.name for one in live] == [one.name for one in ended]


def test_four_numbers_are_brief_in_a_name():
    assert brief("0.8 0.8 0.8 2") == "0.8/2"
    assert brief("1 1 1 1") == "1"
    assert brief("1 2 3 4") == "1 2 3 4"
