"""Claims about clients of the page, over its protocol: what they send, how many they are, how they
leave."""

import asyncio
import math
import socket
from contextlib import suppress

import pytest
from web_cases import panels_of, until
from websockets.exceptions import ConnectionClosed
from wire import connect, open_socket, press_start

from quadsim.web.page.dashboard import PAUSE, SCENE, SHARE, pause_after
from quadsim.web.page.messages import MAX_BYTES
from quadsim.web.page.server import LoopEvent
from quadsim.web.race import PageRace

WRONG = (math.nan, math.inf, 1e9, -5.0, "much", None, True, [1.0], {"a": 1})


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
def test_a_value_out_of_range_or_of_another_type_changes_nothing(page):
    with connect(page.port) as client:
        (panels,) = panels_of(page)
        sliders = panels.competitors.numbers.sliders
        for value in WRONG:
            client.set(sliders["temperature"], value)
        client.set(sliders["sigma"], 1.5)  # a valid value is still accepted, and comes after them
        assert until(lambda: page.dashboard.desk.state.rows[0].choices.numbers), page.dashboard
        assert page.dashboard.desk.state.rows[0].choices.numbers == {"sigma": 1.5}


@pytest.mark.socket
def test_only_values_can_be_set(page):
    names = ("removed", "update_cb", "gui_api", "uuid", "nonsense")
    with connect(page.port) as client:
        (panels,) = panels_of(page)
        slider = panels.competitors.numbers.sliders["sigma"]
        before = [getattr(slider._impl, name, None) for name in names]
        for name in names:
            client.set(slider, "x", name=name)
        client.set(slider, 1.5)
        assert until(lambda: slider.value == 1.5)
        assert [getattr(slider._impl, name, None) for name in names] == before


@pytest.mark.socket
def test_a_course_that_is_not_on_the_menu_is_not_chosen(page):
    course = page.dashboard.race.course
    seen = []
    course.on_update(lambda event: seen.append(course.value) if event.client else None)
    with connect(page.port) as client:
        client.set(course, "/etc/passwd")
        client.set(course, "paper_flat")
        assert until(lambda: seen)
    assert seen == ["paper_flat"]


@pytest.mark.socket
def test_moving_gamma_in_flight_is_an_event(page):
    def entry():
        return page.session.snapshot.competitors[0]

    page.session.tell(PageRace.set_speed, 0.1)  # the flight lasts while the scene is drawn
    with connect(page.port) as client:
        press_start(page.port)
        assert until(lambda: page.session.snapshot.t > 0.02)
        (panels,) = panels_of(page)
        slider = panels.in_flight.sliders["gamma_rates"]
        assert until(lambda: not slider.disabled and panels.in_flight.folder.visible)
        client.set(slider, 1.25)
        assert until(lambda: entry().changes)
    (change,) = entry().changes
    assert (change["name"], change["to"]) == ("gamma_rates", 1.25)


@pytest.mark.socket
def test_a_number_that_is_typed_lands_on_the_row_of_its_visitor_and_both_see_it(page):
    """A edits the first row; B adds another one and edits that."""
    with connect(page.port) as one, connect(page.port) as two:
        a, b = panels_of(page, 2)
        two.set(b.competitors.choose, "add")
        assert until(lambda: "2" in a.competitors.choose.options)
        slider = a.competitors.numbers.sliders["temperature"]
        one.set(slider, 0.3)
        assert until(
            lambda: [row.choices.numbers for row in rows(page)] == [{"temperature": 0.3}, {}]
        )
        assert b.competitors.numbers.sliders["temperature"].value == 1.0
        # B looks at the first row, and sees what A has typed.
        two.set(b.competitors.choose, "1")
        assert until(lambda: b.competitors.numbers.sliders["temperature"].value == 0.3)
        two.set(b.competitors.numbers.sliders["temperature"], 0.5)
        assert until(lambda: slider.value == 0.5)
        two.set(b.competitors.choose, "2")
        two.set(b.competitors.choose, "remove")
        assert until(lambda: len(rows(page)) == 1)
        two.click(b.competitors.reset)
        assert until(lambda: rows(page)[0].choices.numbers == {})


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
def test_a_control_that_is_disabled_cannot_be_used(page):
    tick, other = page.dashboard._options.limit, page.dashboard._options.true_size
    with connect(page.port) as client:
        tick.disabled = True
        client.set(tick, True)
        client.set(other, True)  # comes after it
        assert until(lambda: other.value)
        assert not tick.value
        tick.disabled = False
        client.set(tick, True)
        assert until(lambda: tick.value)
        for one in (tick, other):
            client.set(one, False)
        assert until(lambda: not tick.value and not other.value)


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
