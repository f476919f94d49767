"""Claims about the same line-up over several seeds, over flights without physics."""

from threading import Event

from web_cases import Gliders, choices, until

from quadsim.statistics import mean_interval
from quadsim.web.page.parts.seeds_table import seeds_of
from quadsim.web.race.page_race import PageRace
from quadsim.web.race.series import FlownSeed, Series, SeriesRow
from quadsim.web.race.session import Session


def series_of(tmp_path, gliders):
    session = Session(str(tmp_path), gliders)
    session.tell(PageRace.set_speed, 20.0)
    return session, Series(session)


def flown(session, series):
    """Return whether the series ends, asked as a page asks."""

    def is_over():
        series.turn(session.snapshot)
        return not series.is_on

    return until(is_over)


def test_every_seed_is_flown_once_and_kept(tmp_path):
    gliders = Gliders()
    session, series = series_of(tmp_path, gliders)
    series.begin([choices("colored", seed=3), choices("gaussian", seed=3)], [], 3)
    assert flown(session, series)
    assert [one.choices.seed for one in gliders.built] == [3, 3, 4, 4, 5, 5]
    assert [row.name for row in series.rows] == ["colored", "gaussian"]
    colored, gaussian = (row.times for row in series.rows)
    assert len(colored) == len(gaussian) == series.done == 3
    (pair,) = series.pairs
    paired = [b - a for a, b in zip(colored, gaussian, strict=True)]
    assert pair.difference == mean_interval(paired)
    assert seeds_of(series).said == "3 of 3 seeds flown"
    session.close()


def test_one_seed_is_no_series_and_stop_ends_one(tmp_path):
    session, series = series_of(tmp_path, Gliders())
    series.begin([choices("colored")], [], 1)
    assert not series.is_on
    assert seeds_of(series).said == ""
    session.tell(PageRace.set_speed, 0.1)
    series.begin([choices("colored", laps=9)], [], 5)
    assert until(lambda: series.turn(session.snapshot) or session.snapshot.t > 0.0)
    race = session.snapshot.race
    session.tell(PageRace.end_flights)
    assert flown(session, series)
    assert (session.snapshot.race, series.done) == (race, 0)
    session.close()


def test_a_series_that_ends_between_two_seeds_flies_no_other(tmp_path):
    gliders = Gliders()
    session, series = series_of(tmp_path, gliders)
    series.begin([choices("colored")], [], 5)
    assert until(lambda: session.snapshot.race == 1 and not session.snapshot.flying)
    series.turn(session.snapshot)  # keeps the first seed and starts the second
    assert series.is_on
    series.end()
    assert until(lambda: session.snapshot.race == 2 and not session.snapshot.flying)
    series.turn(session.snapshot)
    assert (series.is_on, series.done, len(gliders.built)) == (False, 1, 2)
    session.close()


def test_a_race_that_restart_begins_is_not_the_first_of_a_series(tmp_path):
    """START is pressed while the race's thread has still to carry out Restart."""
    gliders = Gliders()
    session, series = series_of(tmp_path, gliders)
    session.start([choices("colored", laps=9)])
    assert until(lambda: session.snapshot.t > 0.0)
    seen = Event()
    session.tell(PageRace.restart)
    session.tell(lambda race: seen.wait(60) and None)
    series.begin([choices("gaussian", seed=3)], [], 2)
    assert until(lambda: session.snapshot.race == 2)
    series.turn(session.snapshot)  # the page sees the race of Restart
    seen.set()
    assert flown(session, series)
    assert series.done == 2
    assert [one.choices.seed for one in gliders.built[2:]] == [3, 4]
    session.close()


def test_a_second_press_of_start_leaves_the_series_whole(tmp_path):
    gliders = Gliders()
    gliders.compiled = Event()
    session, series = series_of(tmp_path, gliders)
    for _ in range(2):
        series.begin([choices("colored", seed=3)], [], 2)
        assert until(lambda: session.snapshot.is_taking_off)
        series.turn(session.snapshot)
    gliders.compiled.set()
    assert flown(session, series)
    assert [one.choices.seed for one in gliders.built] == [3, 4]
    session.close()


def test_a_refused_start_ends_the_series(tmp_path):
    session, series = series_of(tmp_path, Gliders())
    series.begin([choices("colored", laps=10**6)], [], 2)
    assert flown(session, series)
    assert (session.snapshot.race, series.done) == (0, 0)
    session.close()


def test_a_flight_that_did_not_finish_has_no_time_and_pairs_with_none(tmp_path):
    session, series = series_of(tmp_path, Gliders())
    series.count = 3
    first = SeriesRow("a", "red", [FlownSeed(5.0, 1.0), FlownSeed(None, 2.0), FlownSeed(5.2, 3.0)])
    second = SeriesRow("b", "blue", [FlownSeed(5.5, 1.0), FlownSeed(5.6, 2.0), FlownSeed(5.9, 3.0)])
    series.rows = [first, second]
    shown = seeds_of(series)
    assert [row.finished for row in shown.rows] == ["2/3", "3/3"]
    assert shown.rows[0].times == ["5.000", "-", "5.200"]
    # two differences of 0.5 and 0.7: mean 0.6, half 12.706 x 0.1414 / sqrt(2)
    assert shown.pairs[0].difference == "+0.600 \u00b1 1.271"
    session.close()
