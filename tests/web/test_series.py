"""Claims about the same line-up over several seeds, over flights without physics."""

from dataclasses import replace
from threading import Event

from web_cases import Gliders, choices, until

from quadsim.statistics import mean_interval
from quadsim.web.page.parts.head import Head, SeedsResult, head_of
from quadsim.web.page.parts.seeds_table import ALIKE, seeds_of
from quadsim.web.race.lap_timing import lap_timings
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
    # The gliders have no noise.
    assert seeds_of(series).said == f"3 of 3 seeds flown; {ALIKE}"
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


def row(name, *times, chatter=10.0):
    """A competitor with these times from seed 4 on; a flight without a time has much chatter."""
    flights = [
        FlownSeed(4 + k, t, 400.0 if t is None else chatter + k) for k, t in enumerate(times)
    ]
    return SeriesRow(name, "red", flights)


def said(words):
    return "".join(word.text for word in words)


def test_the_chatter_is_that_of_the_flights_that_finished(tmp_path):
    assert row("a", 5.0, 5.1, None).chatter.mean == 10.5
    assert row("a", None).chatter.n == 0


def test_the_headline_names_the_faster_of_the_two_fastest(tmp_path):
    session, series = series_of(tmp_path, Gliders())
    series.count = 3
    slow, fast = row("slow", 5.52, 5.5, 5.51), row("fast", 5.0, 5.0, 5.0)
    series.rows = [row("slowest", 9.0, 9.0, 9.0), slow, fast]
    shown = seeds_of(series)
    # differences of 0.52, 0.50 and 0.51: half 4.303 x 0.01 / sqrt(3)
    assert said(shown.headline) == "fast is faster by 0.51 \u00b1 0.02 s over 3 seeds"
    assert shown.seeds == [4, 5, 6]
    assert ALIKE not in shown.said
    series.rows = [row("a", 5.0, None, 5.1), row("b", 5.1, 5.2, 5.0)]
    told = said(seeds_of(series).headline)
    assert told.startswith("a and b are not told apart: 0.00 \u00b1")
    assert told.endswith(" s over the 2 of 3 seeds that both finished")
    for rows in ([], [row("a", 5.0, 5.1)], [row("a", 5.0), row("b", 5.1)]):
        series.rows = rows
        assert seeds_of(series).headline == []
    session.close()


def test_the_head_has_the_headline_at_the_end_of_the_last_seed_alone(tmp_path):
    session, series = series_of(tmp_path, Gliders())
    series.begin([choices("colored"), choices("gaussian")], [], 2)
    assert flown(session, series)
    s = session.snapshot
    found = SeedsResult(series.race, seeds_of(series).headline)
    coming = Head("rest", [])

    def sentence(s):
        return said(head_of(s, lap_timings(s), coming, found).sentence)

    assert "is faster by" in sentence(s)
    assert "is faster by" not in sentence(replace(s, t=0.5))
    assert "is faster by" not in sentence(replace(s, race=s.race + 1))
    session.close()


def test_a_flight_that_did_not_finish_has_no_time_and_pairs_with_none(tmp_path):
    session, series = series_of(tmp_path, Gliders())
    series.count = 3
    series.rows = [row("a", 5.0, None, 5.2), row("b", 5.5, 5.6, 5.9)]
    shown = seeds_of(series)
    assert [row.finished for row in shown.rows] == ["2/3", "3/3"]
    assert shown.rows[0].times == ["5.000", "-", "5.200"]
    # two differences of 0.5 and 0.7: mean 0.6, half 12.706 x 0.1414 / sqrt(2)
    assert shown.pairs[0].difference == "+0.600 \u00b1 1.271"
    session.close()
