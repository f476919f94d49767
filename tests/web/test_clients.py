"""Claims about clients of the page, over its protocol: what they send, how many they are, how they
leave."""

import asyncio
import math
from contextlib import suppress

import pytest
from web_cases import until
from websockets.exceptions import ConnectionClosed
from wire import connect, open_socket

from web.page.dashboard import PAUSE, SCENE, SHARE, pause_after
from web.page.messages import MAX_BYTES
from web.page.server import LoopEvent
from web.race import PageRace


async def settled(claim, seconds=5.0):
    """Return whether the claim comes true while messages are handled."""
    for _ in range(int(seconds / 0.01)):
        if claim():
            return True
        await asyncio.sleep(0.01)
    return False


def test_what_another_thread_sends_wakes_pages_on_the_loop_alone(page):
    """There alone is the list of who waits safe to read."""
    _, server = page

    async def other_thread_does():
        event = LoopEvent()
        waiting = asyncio.create_task(event.wait())
        await asyncio.sleep(0)
        await asyncio.to_thread(event.set)
        await asyncio.sleep(0)
        assert not waiting.done()
        event.set()
        assert await asyncio.wait_for(waiting, 1.0)
        async with connect(server.get_port()):
            assert await settled(lambda: len(server.get_clients()) == 1)
            (client,) = server.get_clients().values()
            buffers = (
                server._websock_server._broadcast_buffer,
                client._websock_connection.get_message_buffer(),
            )
            assert [type(buffer.message_event) for buffer in buffers] == [LoopEvent, LoopEvent]

    asyncio.run(other_thread_does())


def test_one_click_starts_a_flight(page, session):
    dashboard, server = page

    async def client_does():
        async with connect(server.get_port()) as client:
            assert await settled(lambda: len(server.get_clients()) == 1)
            await client.click(dashboard.race.start)
            assert await settled(lambda: session.snapshot.flying)

    asyncio.run(client_does())


@pytest.mark.parametrize(
    "value", [math.nan, math.inf, 1e9, -5.0, "much", None, True, [1.0], {"a": 1}]
)
def test_a_value_out_of_range_or_of_another_type_changes_nothing(page, value):
    dashboard, server = page
    slider = dashboard.race.table.numbers.sliders["temperature"]
    before = slider.value

    async def client_does():
        async with connect(server.get_port()) as client:
            await client.set(slider, value)
            await client.set(slider, 2.5)  # a valid value is still accepted
            assert await settled(lambda: slider.value == 2.5)
            assert await settled(lambda: seen)

    seen = []
    slider.on_update(lambda _: seen.append(slider.value))
    asyncio.run(client_does())
    assert before != 2.5
    assert set(seen) == {2.5}


@pytest.mark.parametrize("name", ["removed", "update_cb", "gui_api", "uuid", "nonsense"])
def test_only_values_can_be_set(page, name):
    dashboard, server = page
    slider = dashboard.race.table.numbers.sliders["sigma"]
    before = getattr(slider._impl, name, None)

    async def client_does():
        async with connect(server.get_port()) as client:
            await client.set(slider, "x", name=name)
            await client.set(slider, 1.5)
            assert await settled(lambda: slider.value == 1.5)

    asyncio.run(client_does())
    assert getattr(slider._impl, name, None) == before


def test_a_course_that_is_not_on_the_menu_is_not_chosen(page):
    dashboard, server = page
    course = dashboard.race.course

    async def client_does():
        async with connect(server.get_port()) as client:
            await client.set(course, "/etc/passwd")
            await client.set(course, "paper_flat")
            assert await settled(lambda: course.value == "paper_flat")

    seen = []
    course.on_update(lambda _: seen.append(course.value))
    asyncio.run(client_does())
    assert seen == ["paper_flat"]


def test_moving_gamma_in_flight_is_an_event(page, session):
    dashboard, server = page

    async def client_does():
        async with connect(server.get_port()) as client:
            await client.click(dashboard.race.start)
            assert await settled(
                lambda: (
                    session.snapshot.competitors
                    and max(session.snapshot.competitors[0].t, default=0.0) > 0.02
                    and dashboard.numbers.folder.visible
                )
            )
            await client.set(dashboard.numbers.sliders["gamma_rates"], 1.25)
            assert await settled(lambda: session.snapshot.competitors[0].changes)

    asyncio.run(client_does())
    assert session.snapshot.competitors[0].changes[0]["to"] == 1.25


def test_two_clients_see_each_others_changes(page):
    dashboard, server = page
    slider = dashboard.race.table.numbers.sliders["sigma"]

    async def clients_do():
        async with connect(server.get_port()) as one, connect(server.get_port()) as two:
            assert await settled(lambda: len(server.get_clients()) == 2)
            await one.set(slider, 1.5)
            assert await settled(lambda: slider.value == 1.5)
            await two.set(slider, 0.5)
            assert await settled(lambda: slider.value == 0.5)

    asyncio.run(clients_do())


def test_the_flight_goes_on_when_the_last_client_vanishes(page, session):
    dashboard, server = page

    async def client_does():
        async with connect(server.get_port()) as client:
            await client.click(dashboard.race.start)
            assert await settled(lambda: session.snapshot.flying)
            client._socket.transport.abort()  # no goodbye

    asyncio.run(client_does())
    assert until(lambda: not server.get_clients())
    t = session.snapshot.t
    assert until(lambda: session.snapshot.t > t + 0.05 or not session.snapshot.flying)


def test_start_while_flying_begins_another_race(page, session, gliders):
    dashboard, server = page

    async def client_does():
        async with connect(server.get_port()) as client:
            for race in (1, 2, 3):
                await client.click(dashboard.race.start)
                assert await settled(lambda n=race: session.snapshot.race == n)

    asyncio.run(client_does())
    assert [glider.closed for glider in gliders.built[:2]] == [True, True]


def test_a_control_that_is_disabled_cannot_be_used(page, session):
    dashboard, server = page

    async def client_does():
        async with connect(server.get_port()) as client:
            await client.click(dashboard.race.stop)
            await client.click(dashboard.race.start)
            assert await settled(lambda: session.snapshot.flying)

    seen = []
    dashboard.race.stop.on_click(seen.append)
    asyncio.run(client_does())
    assert seen == []


def test_a_message_that_is_too_long_ends_its_own_connection_alone(page):
    _, server = page

    async def clients_do():
        async with connect(server.get_port()):
            one = await open_socket(server.get_port())
            with suppress(ConnectionClosed):  # closed while it still sends
                await one.send(bytes(MAX_BYTES + 1))
            await asyncio.wait_for(one.wait_closed(), 5.0)
            assert await settled(lambda: len(server.get_clients()) == 1)

    asyncio.run(clients_do())


def test_nonsense_messages_leave_the_page_working(page, session):
    _, server = page

    async def client_does():
        async with connect(server.get_port()) as client:
            await client.send(type="GuiUpdateMessage", uuid="no such control", updates={"value": 1})
            await client.send(type="ShareUrlRequest")
        async with connect(server.get_port()):
            assert await settled(lambda: len(server.get_clients()) == 1)

    asyncio.run(client_does())
    session.tell(PageRace.play)
    assert until(lambda: session.snapshot.playing is not None)


@pytest.mark.parametrize("spent", [0.0, 0.001, 0.005, 0.01, 0.014])
def test_updates_of_the_page_leave_most_of_the_time_to_the_planners(spent):
    pause = pause_after(spent)
    assert pause >= SCENE
    assert spent <= SHARE * (spent + pause) + 1e-12


def test_a_long_update_of_the_page_does_not_stop_it():
    assert pause_after(1.0) == PAUSE
