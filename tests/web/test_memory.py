"""Claims about what a page and its server free when another race begins."""

import os
import platform
from pathlib import Path
from time import perf_counter, sleep

import numpy as np
import pytest
from web_cases import COURSE, MENU, Gliders, choices, served, until
from wire import connect

from quadsim.web.choices import Choices
from quadsim.web.memory import give_back
from quadsim.web.race import PageRace

GHOST = [choices("colored"), choices("gaussian")]
FASTER = 20.0  # than the wall clock, for waits of seconds


def gates_kept(page):
    """Names of the gates' nodes, of which each race has another, in messages for new clients."""
    kept = page.server._websock_server._broadcast_buffer.message_from_id
    names = {getattr(message, "name", "") for message in kept.values()}
    return {name for name in names if name.startswith("/course/gates/")}


def race(page, flights):
    """Begin another race and wait until the page shows it."""
    number = page.session.snapshot.race + 1
    page.session.tell(PageRace.start, flights)
    assert until(lambda: getattr(page.dashboard._view, "race", 0) == number)


@pytest.mark.socket
def test_an_open_page_is_told_to_remove_the_ghost_of_the_last_race(page):
    seen = []

    def told(kind):
        """Names in all messages of a kind so far."""
        seen.extend(client.waiting())
        return [message["name"] for message in seen if message["type"] == kind]

    with connect(page.port) as client:
        race(page, GHOST)
        race(page, GHOST[:1])
        ghost = {"/competitor/1", "/trail/1"}
        assert until(lambda: ghost <= set(told("RemoveSceneNodeMessage")))
        race(page, GHOST[:1])
        assert until(lambda: len(told("BatchedMeshesMessage")) > 2)
        gates = told("BatchedMeshesMessage")
        # a name again would be the old node with new arrays
        assert len(set(gates)) == len(gates)


@pytest.mark.socket
@pytest.mark.parametrize("frees", [True, False])
def test_the_server_keeps_the_scenes_of_the_last_races_alone(page, frees, monkeypatch):
    """And it would keep those of all, without what frees them."""
    if not frees:
        monkeypatch.setattr("quadsim.web.page.dashboard.forget_removed", lambda _: None)
    with connect(page.port):
        race(page, GHOST[:1])
        before = gates_kept(page)
        for _ in range(5):
            race(page, GHOST[:1])
    kept = gates_kept(page) - before
    assert (len(kept) <= 3) == frees, kept


@pytest.fixture
def hurried(tmp_path, monkeypatch):
    """A page whose own clock runs faster than the wall clock."""
    monkeypatch.setattr("quadsim.web.page.dashboard.perf_counter", lambda: FASTER * perf_counter())
    with served(tmp_path, Gliders(), MENU, Choices(course=COURSE, laps=2)) as page:
        yield page


@pytest.mark.socket
def test_a_race_that_has_ended_or_stands_still_sends_nothing(hurried):
    """While it flies, pages are sent the drone and the tables."""

    def falls_silent():
        """Return whether nothing comes for longer than the page's longest period."""
        client.waiting()
        sleep(6.0 / FASTER)
        return not client.waiting()

    with connect(hurried.port) as client:
        race(hurried, GHOST)
        assert until(lambda: len(client.waiting()) > 10)
        hurried.session.tell(PageRace.play, False)
        assert until(falls_silent)
        hurried.session.tell(PageRace.play, True)
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
