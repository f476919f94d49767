"""Claims about what charts are given: every frame once, gaps to the limit, sectors."""

import weakref
from dataclasses import replace

import numpy as np
import pytest
from web_cases import choices, competitor, stored, until
from wire import link

from quadsim.web.page.parts import charts
from quadsim.web.page.parts.charts import AskSignals, answer
from quadsim.web.page.parts.sectors import sector_ends, sectors, times_of
from quadsim.web.race.competitor import POSITION, VELOCITY, named
from quadsim.web.race.lap_timing import lap_timings
from quadsim.web.race.limit_race import limit_race
from quadsim.web.race.page_race import PageRace
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.race.standings import Way, gap

NOTHING = AskSignals(race=0, frames=[])


@pytest.fixture(scope="module")
def competitors():
    return named([competitor("colored"), competitor("gaussian")])


def race_of(competitors, t=1.0):
    return Snapshot(t=t, end=9.0, competitors=tuple(competitors), race=1)


def limited(entry):
    """The same flight with the best known limit of its race."""
    from quadsim.limit.limits import limit_of

    return replace(entry, limit=limit_of(entry.record))


def test_a_page_gets_every_frame_once_in_its_own_time(competitors, monkeypatch):
    monkeypatch.setattr(charts, "CHUNK", 70)
    s = race_of(competitors)
    got = [[] for _ in competitors]
    asked = NOTHING
    for _ in range(50):
        given = answer(s, asked)
        for have, frames in zip(got, given.frames, strict=True):
            assert frames.start == len(have)
            have += frames.columns["a_cmd"]
        asked = AskSignals(race=given.race, frames=[len(have) for have in got])
    for have, entry in zip(got, competitors, strict=True):
        assert np.allclose(have, entry.x["a_cmd"], atol=6e-4)
    # the race is another one: from the first frame on
    again = answer(replace(s, race=2), asked)
    assert [frames.start for frames in again.frames] == [0, 0]
    assert again.signals


def test_commanded_and_delivered_are_different_columns(competitors):
    given = answer(race_of(competitors), NOTHING)
    for signal in given.signals[:4]:
        assert signal.command != signal.column
        assert {signal.column, signal.command} <= set(given.frames[0].columns)


@pytest.mark.socket
def test_the_time_moves_by_a_press_for_who_presses_alone(page, root):
    """Also while a flight is on, which goes on."""
    session = page.session
    with link(page.port) as linked, link(page.port) as other:

        def shown(one):
            return one.ask("signals", "ask_signals", race=0, frames=[])["t"]

        session.tell(PageRace.start, [], [stored(root, laps=3)])
        assert until(lambda: session.snapshot.competitors)
        entry = session.snapshot.competitors[0]
        place = float(entry.progress[150])
        other.send("seek", t=0.25)
        linked.send("seek", t=2.0)
        assert shown(linked) == 2.0
        linked.send("seek_place", place=place)
        assert shown(linked) == entry.t[entry.at_place(place)]
        assert shown(other) == 0.25
        session.tell(PageRace.set_speed, 0.1)
        session.tell(PageRace.start, [choices(laps=3)])
        assert until(lambda: session.snapshot.flying and session.snapshot.t > 0.05)
        linked.send("seek", t=0.02)
        t = session.snapshot.t
        assert shown(linked) == 0.02
        assert shown(other) >= t
        assert until(lambda: session.snapshot.t > t)
        assert shown(linked) == 0.02


def test_the_limit_is_a_race_through_all_gates_in_its_time(competitors):
    entry = limited(competitors[0])
    limit = limit_race(entry)
    assert limit is limit_race(entry)
    assert limit.last_t == pytest.approx(entry.limit.time, abs=0.02)
    assert limit.laps == tuple(entry.limit.lap_times)
    assert sum(map(sum, times_of(limit, sector_ends(entry.legs)))) == pytest.approx(
        limit.last_t, abs=0.02
    )
    centres = [gate.position for gate in entry.course.gates] * entry.laps_to_fly
    passed = np.array([event.position for event in limit.events])
    assert np.linalg.norm(passed - centres, axis=1).max() < 1.5
    assert limit.progress[-1] == pytest.approx(entry.legs.length, abs=0.5)
    # its velocity is that of its path
    step = np.diff(limit.rows(POSITION), axis=0) / np.diff(limit.t)[:, None]
    assert np.abs(step - limit.rows(VELOCITY)[:-1]).max() < 2.0
    assert limit_race(replace(entry, limit=None)) is None


def test_the_limit_is_freed_with_the_last_flight_of_its_race(competitors):
    entry = limited(competitors[0])
    solution = weakref.ref(entry.limit)
    race = limit_race(entry)
    assert solution() is not None
    del entry, race
    assert solution() is None


def test_a_chart_shows_the_seconds_behind_the_limit(competitors):
    entries = [limited(one) for one in competitors]
    s = race_of(entries, t=3.0)
    timings = lap_timings(s)
    curves = charts._gaps(timings, limit_race(entries[0]))
    (behind,) = [one for one in curves if "behind the limit" in one.title]
    limit = limit_race(entries[0])
    place = np.array(behind.x)
    first = timings[0]
    way = Way(first.entry.t[: first.i + 1], first.entry.progress[: first.i + 1])
    wanted = gap(place, way, Way(limit.t, limit.progress))
    assert np.allclose(np.array(behind.y[0], float), wanted, atol=0.02, equal_nan=True)
    assert np.isfinite(wanted).sum() > 50
    without = charts._gaps(timings, None)
    assert not any("limit" in one.title for one in without)


def test_sectors_end_at_gates_and_sum_to_the_lap(competitors):
    entry = competitors[0]
    ends = sector_ends(entry.legs)
    assert ends == sorted(set(ends))
    assert len(ends) == 3
    assert ends[-1] == entry.legs.gates
    for row, lap in zip(times_of(entry, ends), entry.laps, strict=True):
        assert len(row) == 3
        assert sum(row) == pytest.approx(lap)


def test_the_best_sectors_of_all_stand_in_a_row_and_the_limit_is_not_one_of_them(competitors):
    ends = sector_ends(competitors[0].legs)
    rows = [row for entry in competitors for row in times_of(entry, ends)]
    best = np.min(rows, axis=0)
    limit = limit_race(limited(competitors[0]))
    limit = replace(limit, events=tuple(replace(e, t=0.1 * e.t) for e in limit.events))
    assert (np.min(times_of(limit, ends), axis=0) < best).all()
    for shown in (sectors(competitors, None), sectors(competitors, limit)):
        table = [cell.children for row in shown[1].children for cell in row.children]
        wanted = [["best of all"], [], *([f"{t:.3f}"] for t in (*best, best.sum()))]
        assert any(table[k : k + len(wanted)] == wanted for k in range(len(table)))
