"""Claims about a stored run as a competitor of the next START."""

import json

import pytest
from web_cases import choices

from quadsim.record.run import canonical, hostless
from quadsim.web.state.choices import Choices, RaceChoices
from quadsim.web.stored.take_over import taken_over


def recorded(flight):
    """The spec of a flight as it is read from the disk."""
    return json.loads(canonical(flight.spec().record()))


@pytest.mark.parametrize(
    "flown",
    [
        choices("colored"),
        choices("gaussian", numbers={"samples": 512, "temperature": 0.2}),
        choices("colored", settings={"horizon": 100, "gamma": (1.0, 1.0, 1.0, 3.0)}),
        choices("colored", sensing="mocap"),
    ],
)
def test_a_run_that_is_taken_over_flies_the_same_again(flown):
    record = recorded(flown)
    found = taken_over(record, flown.race)
    assert found.differs == ()
    again = recorded(Choices.of(flown.race, found.choices))
    assert hostless(again) == hostless(record)


def test_what_the_race_has_otherwise_is_named():
    record = recorded(
        choices("colored", seed=5, randomize=1.0, laps=1, clock="wall", deadline_ms="8")
    )
    race = RaceChoices(course="figure8", laps=2)
    found = taken_over(record, race).differs
    assert found == ("seed 5", "randomize 1.0", "laps 1", "clock wall", "deadline 8.0")


def test_a_flight_that_no_settings_describe_is_refused_in_one_line():
    record = recorded(choices("hand"))
    with pytest.raises(ValueError, match="hand: expected a flight that settings describe"):
        taken_over(record, RaceChoices())
