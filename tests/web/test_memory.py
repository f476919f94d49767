"""Claims about what a page and its server free when another race begins."""

import os
import platform
from pathlib import Path
from time import perf_counter, sleep

import numpy as np
import pytest
from web_cases import COURSE, MENU, Gliders, choices, served, until
from wire import connect, visit

from quadsim.web.race.page_race import PageRace, give_back
from quadsim.web.state.choices import Choices

GHOST = [choices("colored"), choices("gaussian")]
FASTER = 20.0  # than the wall clock, for waits of seconds


def kept(page):
    """Names of the nodes in messages that the server keeps, for new clients and for each one."""
    server = page.server._websock_server
    clients = page.server.get_clients().values()
    buffers = [
        server._broadcast_buffer,
        *(one._websock_connection.get_message_buffer() for one in clients),
    ]
    messages = [message for one in buffers for message in one.message_from_id.values()]
    return {getattr(message, "name", "") for message in messages} - {"", "/WorldAxes"}


def race(page, flights):
    """Begin another race and wait until the page shows it."""
    number = page.session.snapshot.race + 1
    page.session.tell(PageRace.start, flights)
    assert until(lambda: page.dashboard.stages.raced.race == number)


@pytest.mark.socket
def test_an_open_page_is_told_to_remove_the_ghost_of_the_last_race(page):
    seen = []

    def told(kind):
        """Names in all messages of a kind so far."""
        seen.extend(client.waiting())
        return [message["name"] for message in seen if message["type"] == kind]

    with connect(page.port) as client:
        # A node that is removed before it is sent is never sent, so each race waits for its gates.
        for flights in (GHOST, GHOST[:1], GHOST[:1]):
            before = len(told("BatchedMeshesMessage"))
            race(page, flights)
            assert until(lambda before=before: len(told("BatchedMeshesMessage")) > before)
        assert {"/competitor/1", "/trail/1"} <= set(told("RemoveSceneNodeMessage"))
        gates = told("BatchedMeshesMessage")
        # a name again would be the old node with new arrays
        assert len(set(gates)) == len(gates)


@pytest.mark.socket
def test_the_server_keeps_no_scene_for_its_visitors(page):
    """A scene is sent once; a visitor who comes later gets one of its own."""
    with connect(page.port) as client:
        for _ in range(3):
            race(page, GHOST[:1])
        page.session.tell(PageRace.end_flights)
        assert until(lambda: client.waiting() == [] and not kept(page))


@pytest.fixture
def hurried(tmp_path, monkeypatch):
    """A page whose own clock runs faster than the wall clock."""
    monkeypatch.setattr("quadsim.web.page.due.perf_counter", lambda: FASTER * perf_counter())
    with served(tmp_path, Gliders(), MENU, Choices(course=COURSE, laps=2)) as page:
        yield page


@pytest.mark.socket
def test_who_watches_what_stands_still_is_sent_nothing(hurried):
    """While it flies, those who watch it are sent the drone and the tables."""

    def falls_silent():
        """Return whether nothing comes for longer than the page's longest period."""
        client.waiting()
        sleep(6.0 / FASTER)
        return not client.waiting()

    with visit(hurried.port) as (client, linked):
        race(hurried, GHOST)
        assert until(lambda: len(client.waiting()) > 10)
        # paused, although the flight goes on
        linked.send("play", on=False)
        assert until(falls_silent)
        assert hurried.session.snapshot.flying
        linked.send("live")
        hurried.session.tell(PageRace.set_speed, 1e6)
        assert until(lambda: not hurried.session.snapshot.flying)
        assert until(client.waiting)
        assert until(falls_silent)


def resident():
    """The memory of this process [MB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="malloc_trim belongs to glibc")
def test_memory_between_arrays_in_use_goes_back():
    arrays = [np.ones(4000) for _ in range(2000)]  # of 32 kB
    in_use = arrays[::100]
    del arrays
    before = resident()
    give_back()
    assert resident() < before - 40
    assert all(array.sum() == 4000 for array in in_use)
