"""Claims about several visitors of one page, over its protocol: nobody disturbs another one."""

import time
from dataclasses import replace

import numpy as np
import pytest
from web_cases import choices, competitor, stored, until
from wire import link, visit

from quadsim.web.page.forms.playback import FLIES
from quadsim.web.page.parts.elements import EMPTY
from quadsim.web.page.parts.head import Head
from quadsim.web.page.parts.moment import Moments
from quadsim.web.page.screen import Beats, ForAll, Screen, Seen
from quadsim.web.page.stages import Stage
from quadsim.web.race.competitor import POSITION
from quadsim.web.race.notices import Notices
from quadsim.web.race.page_race import PageRace
from quadsim.web.race.playhead import seek, watched
from quadsim.web.race.snapshot import Preparing, Snapshot
from quadsim.web.state.page_state import Playhead
from quadsim.web.state.view import View

TWO = [choices("colored", laps=9), choices("gaussian", laps=9)]


def positions(client, node):
    """Where a visitor has last been shown each node, by the messages that wait for it."""
    moved = [one for one in client.waiting() if one["type"] == "SetPositionMessage"]
    return [one["position"] for one in moved if one["name"] == node]


def moves_on(client):
    """Whether a visitor is shown the first drone at three more places."""
    client.waiting()
    seen = set()

    def is_so():
        seen.update(map(tuple, positions(client, "/competitor/0")))
        return len(seen) > 2

    return until(is_so)


@pytest.mark.socket
def test_who_looks_back_sees_that_time_and_others_see_the_flight_go_on(page):
    session = page.session
    with visit(page.port) as (client, one), visit(page.port) as (other_client, other):
        session.tell(PageRace.set_speed, 0.2)
        session.tell(PageRace.start, TWO)
        assert until(lambda: session.snapshot.t > 0.1)
        assert one.part("now")["is_live"]
        one.send("seek", t=0.05)
        assert until(lambda: one.part("now")["t"] == 0.05)
        entry = session.snapshot.competitors[0]
        wanted = entry.rows(POSITION, entry.at(0.05))
        seen = []

        def is_there():
            seen.extend(positions(client, "/competitor/0"))
            return seen and np.allclose(seen[-1], wanted)

        assert until(is_there)
        t = session.snapshot.t
        assert moves_on(other_client)
        assert positions(client, "/competitor/0") == []
        assert one.part("head")["phase"] == "paused"
        assert other.part("head")["phase"] == "flying"
        now = other.part("now")
        assert (now["is_live"], now["playing"]) == (True, True)
        assert now["t"] >= t
        one.send("live")
        assert until(lambda: one.part("now")["is_live"])
        assert until(lambda: positions(client, "/competitor/0"))


@pytest.mark.socket
def test_a_view_is_one_visitors_own(page, root):
    """Ghosts by place for one, by time for the other, of the same replay at the same time."""
    runs = [stored(root, sampler, laps=2) for sampler in ("colored", "gaussian")]
    with visit(page.port) as (client, one), visit(page.port) as (other_client, other):
        page.session.tell(PageRace.start, [], runs)
        assert until(lambda: page.session.snapshot.competitors)
        assert one.set("view", "ghosts", "by place") == ""
        for linked in (one, other):
            linked.send("seek", t=1.0)
        first, second = page.session.snapshot.competitors
        there = float(first.progress[first.at(1.0)])
        frames = (second.at_place(there), second.at(1.0))
        for each, frame in zip((client, other_client), frames, strict=True):
            wanted = second.rows(POSITION, frame)
            seen = []

            def is_there(each=each, wanted=wanted, seen=seen):
                seen.extend(positions(each, "/competitor/1"))
                return seen and np.allclose(seen[-1], wanted)

            assert until(is_there)
        assert frames[0] != frames[1]
        assert other.form("view")[0]["ghosts"]["value"] == "by time"


@pytest.mark.socket
def test_a_visitor_who_is_sent_less_takes_nothing_from_others(page, monkeypatch):
    monkeypatch.setattr("quadsim.web.page.visitor_scene.LIGHT", 1e9)  # one picture alone
    session = page.session
    with visit(page.port) as (client, one), visit(page.port) as (other_client, _):
        assert one.set("view", "light", True) == ""
        session.tell(PageRace.set_speed, 0.2)
        session.tell(PageRace.start, TWO)
        assert until(lambda: session.snapshot.t > 0.05)
        assert moves_on(other_client)
        assert len(positions(client, "/competitor/0")) == 1


@pytest.mark.socket
def test_who_chooses_a_course_or_edits_one_takes_no_race_from_others(page, root):
    run = stored(root, laps=2)
    with visit(page.port) as (_, one), visit(page.port) as (client, other):
        page.session.tell(PageRace.start, [], [run])
        for linked in (one, other):
            assert until(lambda one=linked: one.part("tower")["rows"])
            linked.send("seek", t=0.1)
            assert until(lambda one=linked: one.part("head")["phase"] == "paused")
        race = other.part("map")
        assert until(lambda: one.part("map") == race)
        assert one.set("race", "course", "paper_flat") == ""
        assert until(lambda: one.part("tower")["rows"] == [])
        assert until(lambda: one.part("map") != race)
        # the head is of the course that is shown, too, until the visitor goes back to the race
        assert until(lambda: one.part("head")["phase"] == "rest")
        assert other.part("head")["phase"] == "paused"
        one.send("seek", t=0.2)
        assert until(lambda: one.part("tower")["rows"])
        assert until(lambda: one.part("head")["phase"] == "paused")
        assert one.part("next")["sentence"][-1]["text"] == " on paper_flat"
        assert one.press("editor", "new") == ""
        assert until(lambda: one.part("head")["phase"] == "editing")
        client.waiting()
        other.send("seek", t=0.3)
        assert until(lambda: positions(client, "/competitor/0"))
        assert other.part("tower")["rows"]
        # a new race is everybody's
        page.session.tell(PageRace.start, TWO)
        assert until(lambda: len(one.part("tower")["rows"]) == 2)


@pytest.mark.socket
def test_who_flies_by_hand_sees_what_is(page, monkeypatch):
    monkeypatch.setattr(page.session, "flies", lambda visitor: True)
    with link(page.port) as linked:
        assert linked.ask("shown", "seek", t=1.0)["title"] == FLIES
        assert not linked.part("now")["can_seek"]


class Sent:
    """A visitor and the board of a screen: all that they are given. shows: the open parts."""

    number = 1

    def __init__(self, shows=()):
        self.shows = shows
        self.titles = []
        self.parts = {}

    def send(self, message):
        self.titles.append(message.title)

    def put(self, name, content, _):
        self.parts[name] = content

    def is_wanted(self, name, _):
        return name in self.shows


def test_a_notice_of_an_event_comes_when_its_time_is_watched():
    entry = competitor(laps=2)
    notices = Notices()
    notices.race = 1
    s = Snapshot(t=entry.last_t, end=entry.last_t, flown=entry.last_t, competitors=(entry,), race=1)
    sent = Sent()
    moments = Moments()
    screen = Screen(sent, sent, s)
    for_all = ForAll(Head("rest", []), Head("editing", []), EMPTY)
    notices.add("error", "at once", "")
    notices.add("lap", "of one second", "", 1.0)
    s = replace(s, notices=notices.recent)

    def watch(s, t):
        seen = watched(seek(Playhead(), s, 0.0, t), s, 0.0)
        screen.update(Seen(moments.of(seen), View(), Stage(), False), for_all, Beats(True, True))
        return sent.titles

    assert watch(s, 0.5) == ["at once"]
    assert sent.parts["now"].t == 0.5
    assert watch(s, 1.0) == ["at once", "of one second"]
    assert watch(s, 0.5) == watch(s, 2.0) == ["at once", "of one second"]
    # in another race it is told no more
    late = Screen(sent, sent, Snapshot())
    screen, sent.titles = late, []
    assert watch(replace(s, race=2), 2.0) == ["at once"]


def test_who_is_sent_less_gets_tables_with_the_slow_beat():
    entry = competitor(laps=2)
    sent = Sent()
    moments = Moments()
    s = Snapshot(t=1.0, end=entry.last_t, flown=entry.last_t, competitors=(entry,), race=1)
    screen = Screen(sent, sent, s)
    for_all = ForAll(Head("rest", []), Head("editing", []), EMPTY)

    def parts(light, beats):
        sent.parts.clear()
        screen.update(Seen(moments.of(s), View(light=light), Stage(), False), for_all, beats)
        return set(sent.parts)

    between = Beats(tables=True, slow=False)
    assert parts(True, between) == {"now"}
    assert "head" in parts(True, Beats(tables=True, slow=True))
    assert "head" in parts(False, between)


@pytest.mark.parametrize(
    ("shows", "made"),
    [((), set()), (("laps",), {"laps"}), (("curves", "chatter"), {"curves", "chatter"})],
)
def test_what_stands_in_a_hidden_tab_is_neither_made_nor_sent(shows, made):
    entry = competitor(laps=2)
    sent = Sent(shows)
    s = Snapshot(t=1.0, end=entry.last_t, flown=entry.last_t, competitors=(entry,), race=1)
    screen = Screen(sent, sent, s)
    for_all = ForAll(Head("rest", []), Head("editing", []), EMPTY)
    moment = Moments().of(s)
    stage = Stage(entry.course, 1, (entry,))
    # a tab that has just been opened waits for no slow beat
    screen.update(Seen(moment, View(), stage, False), for_all, Beats(tables=True, slow=False))
    assert set(sent.parts) == {"now", "head", "map", "tower"} | made
    assert ("curves" in vars(moment)) == ("curves" in made)


def test_while_a_start_is_prepared_the_tower_has_no_row_of_the_race_before():
    entry = competitor(laps=2)
    sent = Sent()
    s = Snapshot(t=1.0, end=entry.last_t, flown=entry.last_t, competitors=(entry,), race=1)
    screen = Screen(sent, sent, s)
    for_all = ForAll(Head("rest", []), Head("editing", []), EMPTY)
    stage = Stage(entry.course, 1, (entry,))
    prepared = replace(s, preparing=Preparing("building", 1, 2))
    awaited = replace(s, race=2)  # has no frame yet
    for shown, rows in ((s, 1), (prepared, 0), (s, 1), (awaited, 0)):
        seen = Seen(Moments().of(shown), View(), stage, False)
        screen.update(seen, for_all, Beats(tables=True, slow=False))
        assert len(sent.parts["tower"].rows) == rows


@pytest.mark.socket
def test_a_page_gets_what_it_asks_for_and_no_more(page, root):
    """In flight, with the tab Laps open: answers alone, and nothing of a flight by hand."""
    session = page.session
    with visit(page.port) as (_, linked):
        session.tell(PageRace.set_speed, 0.2)
        session.tell(PageRace.start, TWO)
        assert until(lambda: session.snapshot.t > 0.05)
        kinds = []
        for _ in range(12):
            linked.send("ask", have={}, shows=["laps"])
            kinds += linked.types_until("parts")
            time.sleep(0.1)
        # beside the answers: notices, and the table of runs when it has changed
        assert set(kinds) <= {"parts", "shown", "runs"}
        assert kinds.count("parts") == 12
