"""Claims about what a page and its server free when another race begins."""

import asyncio
import os
import platform
from contextlib import asynccontextmanager
from pathlib import Path

import numpy as np
import pytest
import viser
from web_cases import choices, until
from wire import connect, received

from web.memory import give_back
from web.race import PageRace

pytestmark = pytest.mark.flight  # races of some seconds
GHOST = [choices("colored"), choices("gaussian")]


def kept(server):
    """Messages that the server keeps for new clients."""
    return server._websock_server._broadcast_buffer.message_from_id


def gates_kept(server):
    """Number of kept messages about the gates, which are another node in each race."""
    names = [getattr(message, "name", "") for message in kept(server).values()]
    return sum(name.startswith("/course/gates/") for name in names)


async def race(page, session, flights):
    """Begin another race and wait until the page shows it."""
    dashboard, _ = page
    before, view = session.snapshot.race, dashboard._view
    session.tell(PageRace.start, flights)
    for _ in range(500):
        await asyncio.sleep(0.02)
        if session.snapshot.race > before and dashboard._view is not view:
            await asyncio.sleep(0.3)  # its messages are on their way
            return
    raise TimeoutError("no new race on the page")


async def arrived(claim):
    assert await asyncio.to_thread(until, claim)


@asynccontextmanager
async def onlooker(server):
    """The list of what an open page is sent."""
    seen = []

    async def listen(client):
        while True:
            seen.extend(await received(client))

    async with connect(server.get_port()) as client:
        listening = asyncio.create_task(listen(client))
        yield seen
        listening.cancel()


def test_viser_has_what_lets_the_server_forget_removed_things():
    """It is private, so any version may take it away: then read
    web.page.server.forget_removed."""
    assert callable(getattr(viser.ViserServer, "_run_garbage_collector", None))


def test_an_open_page_is_told_to_remove_the_ghost_of_the_last_race(page, session):
    _, server = page

    async def client_does():
        async with onlooker(server) as seen:

            def told(kind, key):
                return {m[key] for m in seen if m["type"] == kind}

            await race(page, session, GHOST)
            await race(page, session, GHOST[:1])
            await arrived(
                lambda: {"/competitor/1", "/trail/1"} <= told("RemoveSceneNodeMessage", "name")
            )
            await race(page, session, GHOST[:1])
            gates = [m["name"] for m in seen if m["type"] == "BatchedMeshesMessage"]
            # a name again would be the old node with new arrays
            assert len(set(gates)) == len(gates) > 2

    asyncio.run(client_does())


@pytest.mark.parametrize("frees", [True, False])
def test_the_server_keeps_no_more_after_many_races_than_after_three(
    page, session, frees, monkeypatch
):
    """And it would, without what frees it."""
    _, server = page
    if not frees:
        monkeypatch.setattr("web.page.dashboard.forget_removed", lambda _: None)

    async def client_does():
        async with onlooker(server) as seen:
            assert await asyncio.to_thread(until, lambda: len(seen) > 0)
            sizes = []
            for _ in range(5):
                await race(page, session, GHOST)
                sizes.append(gates_kept(server))
        assert (sizes[-1] <= sizes[2]) == frees, sizes

    asyncio.run(client_does())


async def falls_silent(seen):
    """Return whether a second without a message comes, longer than the page's longest period."""
    for _ in range(30):
        before = len(seen)
        await asyncio.sleep(1.2)
        if len(seen) == before:
            return True
    return False


def test_a_race_that_has_ended_or_stands_still_sends_nothing(page, session):
    """While it flies, pages are sent the drone and the tables."""
    _, server = page

    async def client_does():
        async with onlooker(server) as seen:
            await race(page, session, GHOST)
            session.tell(PageRace.play, False)
            assert await falls_silent(seen), seen[-1]["type"]
            standing = len(seen)
            session.tell(PageRace.play, True)
            session.tell(PageRace.set_speed, 1e6)
            assert await asyncio.to_thread(until, lambda: not session.snapshot.flying, 60.0)
            assert await falls_silent(seen), seen[-1]["type"]
            assert len(seen) > standing

    asyncio.run(client_does())


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
