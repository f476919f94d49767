"""A race of several drones on the page is the race of the command, stored as one."""

from dataclasses import replace

import pytest

import quadsim
from quadsim.heat.archive import read_heat
from quadsim.heat.result import heat_digest
from quadsim.web.race.live_heat import LiveHeat
from quadsim.web.race.page_race import PageRace
from quadsim.web.state.choices import Choices, HeatChoices
from quadsim.web.state.numbers import Change
from tests.small import SHORT

ENTRANTS = ("colored", "gaussian")
SETTINGS = {name: value for name, value in SHORT.items() if name != "laps"}


def choices(**settings):
    flights = [
        Choices(course="figure8", sampler=sampler, laps=1, settings=SETTINGS | settings)
        for sampler in ENTRANTS
    ]
    return HeatChoices(tuple(flights))


@pytest.mark.compiled
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
    stored = read_heat(folder)
    assert stored.names == ENTRANTS
    same = quadsim.race(list(ENTRANTS), "figure8", vehicle="swift", **SHORT)
    assert heat_digest(stored.runs) == same.digest()
    assert heat_digest(stored.runs[::-1]) != same.digest()


@pytest.mark.compiled
def test_a_race_keeps_its_numbers_and_leaves_nothing_where_it_is_stopped_before_a_gate(tmp_path):
    race = PageRace(str(tmp_path))
    race.start([choices()])
    race.turn()
    names = [entry.name for entry in race.snapshot().competitors]
    assert names == list(ENTRANTS)
    with pytest.raises(ValueError, match=r"Samples: in one world the numbers of START stay"):
        race.change(Change("samples", 512))
    race.end_flights()
    assert not list(tmp_path.glob("*heat*"))
    assert {entry.outcome for entry in race.snapshot().competitors} == {"interrupted"}


def test_an_entrant_that_cannot_fly_is_named_in_one_line():
    """Before anything is built."""
    good = Choices(course="figure8")
    with pytest.raises(ValueError, match=r"^colored 2: samples: expected") as caught:
        HeatChoices((good, replace(good, settings={"samples": "many"}))).spec()
    assert "\n" not in str(caught.value)


def test_each_entrant_has_numbers_of_its_own():
    flights = (
        Choices(course="figure8", numbers={"samples": 512}),
        Choices(course="figure8", settings={"horizon": 120}, vehicle="kolibri"),
        Choices(course="figure8", sampler="gaussian", numbers={"gamma_rates": 1.0}),
    )
    heat = HeatChoices(flights).spec()
    assert heat.names == ("colored", "colored 2", "gaussian")
    first, second, third = (entrant.spec for entrant in heat.entrants)
    assert (first.planner.mppi.samples, second.planner.mppi.samples) == (512, 1024)
    assert (first.planner.mppi.horizon, second.planner.mppi.horizon) == (100, 120)
    assert (first.vehicle.name, second.vehicle.name) == ("swift", "kolibri")
    assert third.sampler == "gaussian"  # which has no gamma
