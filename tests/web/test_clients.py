"""Claims about clients of the page, over its protocol: what they send, how many they are, how they
leave."""

import asyncio
import socket
from contextlib import suppress

import pytest
from web_cases import COURSE, until
from websockets.exceptions import ConnectionClosed
from wire import connect, link, open_socket, press_start

from quadsim.course import load_course, parse_course
from quadsim.course.course import course_errors
from quadsim.web.page.dashboard import PAUSE, SCENE, SHARE, pause_after
from quadsim.web.page.server.messages import MAX_BYTES
from quadsim.web.page.server.viser_private import LoopEvent
from quadsim.web.race.page_race import PageRace

WRONG = (1e9, -5.0, "much", "nan", "inf", "", True)


def test_an_event_that_another_thread_sets_wakes_nobody_until_the_loop_sets_it():
    """There alone is the list of who waits safe to read."""

    async def other_thread_sets():
        event = LoopEvent()
        waiting = asyncio.create_task(event.wait())
        await asyncio.sleep(0)
        await asyncio.to_thread(event.set)
        await asyncio.sleep(0)
        assert not waiting.done()
        event.set()
        assert await asyncio.wait_for(waiting, 1.0)

    asyncio.run(other_thread_sets())


@pytest.mark.socket
def test_all_buffers_of_messages_wake_pages_on_the_loop_alone(page):
    with connect(page.port):
        assert until(lambda: len(page.server.get_clients()) == 1)
        (client,) = page.server.get_clients().values()
        buffers = (
            page.server._websock_server._broadcast_buffer,
            client._websock_connection.get_message_buffer(),
        )
        assert [type(buffer.message_event) for buffer in buffers] == [LoopEvent, LoopEvent]


@pytest.mark.socket
def test_one_click_starts_a_flight(page):
    with connect(page.port):
        press_start(page.port)
        assert until(lambda: page.session.snapshot.flying)


@pytest.mark.socket
def test_a_value_out_of_range_or_of_another_type_changes_nothing_and_is_said(page):
    with link(page.port) as linked:
        for value in WRONG:
            said = linked.set("competitors", "temperature", value)
            assert said.startswith("Temperature: expected a number from 0.01 to 10, got"), value
        assert linked.set("competitors", "sigma", 1.5) == ""
        assert rows(page)[0].choices.numbers == {"sigma": 1.5}
        # and what has no form of a message is dropped
        for value in (None, [1.0], {"a": 1}, "x" * 1000):
            linked.send("set_field", form="competitors", field="sigma", value=value)
        assert linked.set("competitors", "nonsense", 1.0) != ""
        assert linked.set("nonsense", "sigma", 1.0, of=0) == "expected a form of this page"
        assert rows(page)[0].choices.numbers == {"sigma": 1.5}


@pytest.mark.socket
def test_a_course_that_is_not_on_the_menu_is_not_chosen(page):
    with link(page.port) as linked:
        before = page.dashboard.desk.state.race.course
        assert "expected one of figure8, paper_flat" in linked.set("race", "course", "/etc/passwd")
        assert page.dashboard.desk.state.race.course == before
        assert linked.set("race", "course", "paper_flat") == ""
        assert page.dashboard.desk.state.race.course == "paper_flat"


@pytest.mark.socket
def test_a_course_comes_from_a_file_with_its_faults_by_line_and_goes_into_one(page):
    text = load_course(COURSE).text
    wrong = text.replace("yaw_deg: 45}", "yaw: 45}", 1)

    def bring(linked, text, name="theirs.yaml"):
        file = {"name": name, "text": text}
        return linked.ask("answered", "bring_file", form="editor", field="bring", **file)["problem"]

    with link(page.port) as linked:
        problem = bring(linked, wrong)
        line = next(line for line in wrong.splitlines() if "yaw: 45" in line)
        assert problem.startswith("theirs.yaml")
        assert line.strip() in problem
        assert str(course_errors(wrong, "theirs.yaml")[0]) in problem
        assert linked.part("head")["phase"] == "rest"
        assert bring(linked, text) == ""
        assert until(lambda: linked.part("head")["phase"] == "editing")
        assert linked.form("editor")[0]["file"]["value"] == "theirs"
        linked.send("press", form="editor", field="take")
        found = linked.got("download")
        assert found["name"] == "theirs.yaml"
        data = page.server.downloads.response(found["address"]).body
        assert parse_course(data.decode(), "theirs").gates == load_course(COURSE).gates
        assert linked.press("editor", "done") == ""


@pytest.mark.socket
def test_every_field_has_a_label_and_says_what_it_does(page):
    with link(page.port) as linked:
        for form in ("race", "competitors", "numbers", "view"):
            fields, _ = linked.form(form)
            chosen = [one for one in fields.values() if one["kind"] not in ("note", "button")]
            assert chosen, form
            for one in chosen:
                assert one["label"], (form, one)
                assert len(one["help"]) > 5, (form, one)


@pytest.mark.socket
def test_what_is_typed_counts_before_a_start_that_follows_it(page, shared_gliders):
    """The link keeps the order of messages: nobody has to wait."""
    with link(page.port) as linked:
        _, of = linked.form("competitors")
        value = {"form": "competitors", "field": "temperature", "value": "0.25", "of": of}
        linked.send("set_field", **value)
        linked.send("start")
        assert until(lambda: page.session.snapshot.flying)
    assert shared_gliders.built[-1].choices.numbers == {"temperature": 0.25}


@pytest.mark.socket
def test_moving_gamma_in_flight_is_an_event(page):
    def entry():
        return page.session.snapshot.competitors[0]

    page.session.tell(PageRace.set_speed, 0.1)  # the flight lasts while the scene is drawn
    with link(page.port) as linked:
        linked.send("start")
        assert until(lambda: page.session.snapshot.t > 0.02)
        assert linked.set("in_flight", "gamma_rates", 1.25) == ""
        assert until(lambda: entry().changes)
    (change,) = entry().changes
    assert (change.name, change.after) == ("gamma_rates", 1.25)


@pytest.mark.socket
def test_a_number_that_is_typed_lands_on_the_row_of_its_visitor_and_both_see_it(page):
    """A edits the first row; B adds another one and edits that."""

    def temperature(linked):
        return linked.form("competitors")[0]["temperature"]["value"]

    with link(page.port) as one, link(page.port) as two:
        assert two.press("competitors", "add") == ""
        assert one.set("competitors", "temperature", "0.3") == ""
        assert [row.choices.numbers for row in rows(page)] == [{"temperature": 0.3}, {}]
        assert temperature(two) == 1.0
        # B looks at the first row, and sees what A has typed.
        first, second = (row.number for row in rows(page))
        two.send("edit_row", row=first)
        assert temperature(two) == 0.3
        assert two.set("competitors", "temperature", 0.5) == ""
        assert temperature(one) == 0.5
        two.send("edit_row", row=second)
        assert two.press("competitors", "remove") == ""
        # what was typed into a row that is gone lands nowhere
        assert "now removed" in two.set("competitors", "temperature", 0.7, of=second)
        assert two.press("competitors", "reset") == ""
        assert rows(page)[0].choices.numbers == {}


def rows(page):
    return page.dashboard.desk.state.rows


@pytest.mark.socket
def test_the_flight_goes_on_when_the_last_client_vanishes(page):
    with connect(page.port) as client:
        press_start(page.port)
        assert until(lambda: page.session.snapshot.flying)
        client.socket.socket.shutdown(socket.SHUT_RDWR)  # no goodbye
        assert until(lambda: not page.server.get_clients())
    t = page.session.snapshot.t
    assert until(lambda: page.session.snapshot.t > t + 0.05)


@pytest.mark.socket
def test_start_while_flying_begins_another_race(page, shared_gliders):
    races, flights = page.session.snapshot.race, len(shared_gliders.built)
    with connect(page.port):
        for race in (1, 2, 3):
            press_start(page.port)
            assert until(lambda n=races + race: page.session.snapshot.race == n)
    assert [glider.closed for glider in shared_gliders.built[flights:]] == [True, True, False]


@pytest.mark.socket
def test_a_field_that_is_disabled_cannot_be_used(page):
    """Gaussian sampling has no gamma."""
    with link(page.port) as linked:
        assert linked.set("competitors", "sampler", "gaussian") == ""
        said = linked.set("competitors", "gamma_rates", 2.0)
        assert said == "Gamma rates cannot be changed now; it stays 0"
        assert linked.set("competitors", "sampler", "colored") == ""
        assert linked.set("competitors", "gamma_rates", 2.0) == ""


@pytest.mark.socket
def test_a_message_that_is_too_long_ends_its_own_connection_alone(page):
    with connect(page.port), open_socket(page.port) as one:
        assert until(lambda: len(page.server.get_clients()) == 1)
        with suppress(ConnectionClosed):  # closed while it still sends
            one.send(bytes(MAX_BYTES + 1))
        assert until(lambda: one.close_code is not None)
        press_start(page.port)
        assert until(lambda: page.session.snapshot.flying)


@pytest.mark.socket
def test_nonsense_messages_leave_the_page_working(page):
    with connect(page.port) as client:
        client.send(type="GuiUpdateMessage", uuid="no such control", updates={"value": 1})
        client.send(type="ShareUrlRequest")
        press_start(page.port)
        assert until(lambda: page.session.snapshot.flying)


@pytest.mark.parametrize("spent", [0.0, 0.001, 0.005, 0.01, 0.014])
def test_updates_of_the_page_leave_most_of_the_time_to_the_planners(spent):
    pause = pause_after(spent)
    assert pause >= SCENE
    assert spent <= SHARE * (spent + pause) + 1e-12


def test_a_long_update_of_the_page_does_not_stop_it():
    assert pause_after(1.0) == PAUSE
