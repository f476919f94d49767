"""Claims about the parts of the page that a visitor fetches, its camera, and its questions."""

import threading
import time

import pytest
from web_cases import until
from wire import connect, link

from quadsim.web.page.server.messages import MAX_TEXT
from quadsim.web.race.page_race import PageRace

pytestmark = pytest.mark.socket


def ask(linked, have=None, seat=""):
    """The answer to a page that has parts of these versions."""
    return linked.ask("parts", "ask", have=have or {}, seat=seat)


def test_a_page_gets_what_has_changed_since_it_asked_and_nothing_twice(page):
    with link(page.port) as linked:
        wanted = {"head", "now", "tower", "time_line", "map"}
        assert until(lambda: wanted <= set(ask(linked)["parts"]))
        shown = ask(linked)["parts"]
        have = {name: part["version"] for name, part in shown.items()}
        assert ask(linked, have)["parts"] == {}
        assert shown["head"]["content"]["phase"] == "rest"
        linked.send("start")
        assert until(lambda: page.session.snapshot.t > 0.1)
        linked.send("play", on=False)
        assert until(lambda: "head" in ask(linked, have)["parts"])
        assert until(lambda: ask(linked)["parts"]["head"]["content"]["phase"] == "paused")


def test_the_first_answer_to_a_page_has_all_of_its_parts(page, monkeypatch):
    """It is drawn once, and START can be pressed; parts that are made late are waited for."""
    update, began = page.dashboard._update, time.monotonic()
    late = lambda: update() if time.monotonic() - began > 0.5 else None  # noqa: E731
    monkeypatch.setattr(page.dashboard, "_update", late)
    with link(page.port) as linked:
        assert {"head", "next", "now", "tower", "map", "groups"} <= set(ask(linked)["parts"])


def test_a_part_that_cannot_be_made_keeps_no_page_from_the_others(page, monkeypatch, capfd):
    def fails(visitor):
        raise ValueError("on purpose")

    board = page.dashboard.board
    key, _ = board._offered["view"]
    monkeypatch.setitem(board._offered, "view", (key, fails))
    with link(page.port) as linked:
        for _ in range(3):
            parts = linked.ask("parts", "ask", have={}, shows=["view", "race"])["parts"]
            assert "race" in parts
            assert "view" not in parts
    assert capfd.readouterr().err.count("ValueError: on purpose") == 1


def test_a_camera_is_moved_by_who_knows_its_seat_alone(page):
    seat = "a_seat_of_this_test"
    with connect(page.port, seat=seat), link(page.port) as linked:
        assert until(lambda: ask(linked, seat=seat)["camera"])
        linked.send("camera", seat=seat[:-1] + "_", mode="top")
        assert ask(linked, seat=seat)["camera"] == "free"
        linked.send("camera", seat=seat, mode="top")
        assert ask(linked, seat=seat)["camera"] == "top"
        assert ask(linked)["camera"] == ""


def test_a_question_is_answered_by_whom_it_was_put_to(page):
    session = page.session
    with link(page.port) as pilot, link(page.port) as other, link(page.port) as third:
        pilot.send("start")
        assert until(lambda: session.snapshot.flying)
        session.tell(PageRace.set_speed, 0.1)
        asked = other.ask("question", "stop")
        for one, number in ((third, asked["number"]), (other, asked["number"] + 1)):
            one.send("confirm", number=number)
        other.ask("runs", "list_runs")  # is answered after what was sent before it
        assert session.snapshot.flying
        again = other.ask("question", "stop")
        other.send("confirm", number=again["number"])
        assert until(lambda: not session.snapshot.flying)


def test_a_flight_stays_its_visitors_after_a_reload_and_others_are_asked_meanwhile(page):
    session, seat = page.session, "the_seat_of_who_flies"
    with link(page.port) as other:
        with link(page.port, seat=seat) as pilot:
            pilot.send("start")
            assert until(lambda: session.snapshot.flying)
            session.tell(PageRace.set_speed, 0.1)
            ask(pilot, seat=seat)
        assert until(lambda: len(page.server.link.visitors) == 1)
        assert other.ask("question", "stop")["title"] == "Another visitor's flight is on"
        with link(page.port) as again:
            again.send("come_back", seat=seat)
            assert other.ask("question", "stop")
            again.send("stop")
            assert until(lambda: not session.snapshot.flying)


def test_a_question_waits_until_something_has_changed(page):
    """But for a second at most: a page has to know that the server lives."""
    with link(page.port) as linked:
        versions = {name: part["version"] for name, part in settled(linked).items()}
        began = time.monotonic()
        assert ask(linked, versions)["parts"] == {}
        assert 0.9 < time.monotonic() - began < 3.0
        linked.send("ask", have=versions)
        with link(page.port) as other:
            assert other.set("race", "course", "paper_flat") == ""
        next_start = linked.got("parts")["parts"]["next"]["content"]
        assert next_start["sentence"][-1]["text"] == " on paper_flat"


def settled(linked):
    """The parts of a page, once nothing changes any more."""
    parts = {}
    while True:
        more = ask(linked, {name: part["version"] for name, part in parts.items()})["parts"]
        if not more:
            return parts
        parts |= more


def test_stop_between_two_seeds_ends_the_series_of_its_visitor(page):
    """The next seed has been asked for, and does not fly yet."""
    session, series = page.session, page.dashboard.controls.series
    before = session.snapshot.race
    with link(page.port) as pilot:
        held = threading.Event()
        session.tell(lambda race: held.wait(10) and None)
        try:
            pilot.send("start", seeds=5)
            pilot.send("stop")
            pilot.ask("runs", "list_runs")  # is answered after what was sent before it
            assert not series.is_on
        finally:
            held.set()
        assert until(lambda: session.snapshot.race > before and not session.snapshot.flying)
        assert session.snapshot.race == before + 1


@pytest.mark.parametrize(
    "wrong",
    [
        {"type": "start", "seeds": 0},
        {"type": "start", "seeds": 10**6},
        {"type": "start", "seeds": "2; 3"},
        {"type": "set_speed", "speed": 1e9},
        {"type": "step", "steps": 100},
        {"type": "camera", "seat": "x", "mode": "/etc"},
        {"type": "camera", "seat": "x" * MAX_TEXT, "mode": "top"},
        {"type": "ask", "have": {"secrets": 1}},
        {"type": "ask", "have": {"head": -1}},
        {"type": "confirm", "number": None},
    ],
)
def test_a_message_out_of_its_bounds_is_dropped_in_one_line(page, wrong, caplog):
    race = page.session.snapshot.race
    fields = {name: value for name, value in wrong.items() if name != "type"}
    with link(page.port) as linked:
        linked.send(wrong["type"], **fields)
        assert ask(linked)["camera"] == ""
    assert len(caplog.records) == 1
    assert len(caplog.text.splitlines()) == 1
    assert page.session.snapshot.race == race
