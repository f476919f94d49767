"""A race of several drones on the page is the race of the command, stored as one."""

import pytest

import quadsim
from quadsim.heat.archive import load_heat
from quadsim.heat.result import heat_digest
from web.choices import Choices, HeatChoices
from web.live_heat import LiveHeat
from web.race import PageRace

SMALL = {"samples": 128, "horizon": 60, "first_iterations": 10, "timeout": 0.8}
ENTRANTS = ("colored", "gaussian")


def choices(**settings):
    flight = Choices(course="figure8", laps=1, settings=SMALL | settings)
    return HeatChoices(flight, ENTRANTS)


@pytest.mark.flight
def test_the_page_flies_and_stores_the_race_of_the_command(tmp_path):
    heat = LiveHeat(choices())
    heat.keep_in(str(tmp_path))
    expected = []
    while not heat.is_over:
        flown = heat.turn()
        # all vehicles fly the same period
        assert {one.frame.t for one in flown} == {heat.t}
        expected.append([len(entry.expected) for entry in heat.entries])
    heat.end()

    # each expects the other somewhere, until it has ended
    assert expected[1] == [1, 1]
    assert expected[-1] == [0, 0]
    (folder,) = {entry.folder.parent for entry in heat.entries}
    stored = load_heat(folder)
    assert stored.names == ENTRANTS
    same = quadsim.race(list(ENTRANTS), "figure8", laps=1, vehicle="swift", **SMALL)
    assert heat_digest(stored.runs) == same.digest()
    other = quadsim.race(list(ENTRANTS), "figure8", laps=1, seed=1, randomize=1, **SMALL)
    assert heat_digest(stored.runs) != other.digest()


@pytest.mark.flight
def test_a_race_that_is_stopped_before_a_gate_leaves_nothing(tmp_path):
    race = PageRace(str(tmp_path))
    race.start([choices()])
    race.turn()
    names = [entry.name for entry in race.snapshot().competitors]
    assert names == list(ENTRANTS)
    race.end_flights()
    assert not list(tmp_path.glob("*heat*"))
    assert {entry.outcome for entry in race.snapshot().competitors} == {"interrupted"}


def test_entrants_that_do_not_exist_are_one_line():
    with pytest.raises(ValueError, match="no sampler or preset 'colred'") as caught:
        HeatChoices(Choices(course="figure8"), ("colred", "gaussian")).spec()
    assert "\n" not in str(caught.value)
