"""Claims about the link between the page's own scripts and the server."""

import asyncio
import json
import logging
import threading

import pytest
import websockets
from web_cases import until
from websockets.exceptions import InvalidStatus

from web.page.link import MAX_LINK_BYTES, Message
from web.page.server import serve


class Ping(Message, tag="ping"):
    count: int


class Pong(Message, tag="pong"):
    count: int


class Fails(Message, tag="fails"):
    pass


@pytest.fixture
def server():
    server = serve("127.0.0.1", 0, None, "race")
    yield server
    server.stop()


def answer(visitor, ping):
    visitor.send(Pong(ping.count + 1))


def fail(visitor, message):
    raise ValueError("on purpose")


def talk(server, *messages):
    """Send messages; return the first answer."""

    async def talks():
        address = f"ws://127.0.0.1:{server.get_port()}/link"
        async with websockets.connect(address) as socket:
            for message in messages:
                await socket.send(message)
            return json.loads(await asyncio.wait_for(socket.recv(), 5))

    return asyncio.run(talks())


def test_a_message_is_answered(server):
    server.link.on(Ping, answer)
    assert talk(server, json.dumps({"type": "ping", "count": 1})) == {"type": "pong", "count": 2}


def test_nonsense_is_dropped_and_logged_once(server, caplog):
    server.link.on(Ping, answer)
    server.link.on(Fails, fail)
    nonsense = (
        b"\xff\x00",
        "",
        "[" * 2000,
        '{"type": "ping"}',
        '{"type": "ping", "count": "many"}',
        '{"type": "ping", "count": 1, "more": 1}',
        '{"type": "seek", "t": 1}',
        " " * (MAX_LINK_BYTES + 1),
        '{"type": "fails"}',
    )
    with caplog.at_level(logging.WARNING, logger="race web"):
        assert talk(server, *nonsense, '{"type": "ping", "count": 4}')["count"] == 5
    dropped = [record for record in caplog.records if "was dropped" in record.getMessage()]
    assert len(dropped) == 1


def test_a_page_that_leaves_is_known_and_gets_no_more(server):
    left = []
    gone = threading.Event()

    def leave(visitor):
        left.append(visitor)
        gone.set()

    visitors = []
    server.link.on(Ping, lambda visitor, ping: (visitors.append(visitor), answer(visitor, ping)))
    server.link.on_leave(leave)
    talk(server, '{"type": "ping", "count": 0}')
    assert gone.wait(5)
    assert left == visitors
    # neither of these fails
    visitors[0].send(Pong(0))
    server.link.send_all(Pong(0))


def test_the_server_reaches_every_page(server):
    got = []

    async def listens():
        address = f"ws://127.0.0.1:{server.get_port()}/link"
        async with websockets.connect(address) as socket:
            got.append(json.loads(await asyncio.wait_for(socket.recv(), 5)))

    threads = [threading.Thread(target=asyncio.run, args=(listens(),)) for _ in range(2)]
    for thread in threads:
        thread.start()
    assert until(lambda: len(server.link._visitors) == 2)
    server.link.send_all(Pong(7))
    for thread in threads:
        thread.join()
    assert got == [{"type": "pong", "count": 7}] * 2


def test_the_link_is_guarded_like_the_page():
    guarded = serve("127.0.0.1", 0, "a-token-of-this-test", "race")
    port = guarded.get_port()

    def status(**options):
        async def attempt():
            async with websockets.connect(f"ws://127.0.0.1:{port}/link", **options):
                return None

        try:
            return asyncio.run(attempt())
        except InvalidStatus as error:
            return error.response.status_code

    cookie = {"Cookie": f"race{port}=a-token-of-this-test"}
    try:
        assert status() == 401
        assert status(additional_headers=cookie, origin="http://evil.example") == 403
        assert status(additional_headers=cookie) is None
    finally:
        guarded.stop()
