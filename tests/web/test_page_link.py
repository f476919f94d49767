"""Claims about the link between the page's own scripts and the server."""

import logging

import pytest
from web_cases import until
from websockets.exceptions import InvalidStatus
from wire import link, open_socket

from quadsim.web.page.server.link import MAX_LINK_BYTES, Message
from quadsim.web.page.server.page_server import serve


class Ping(Message, tag="ping"):
    count: int


class Pong(Message, tag="pong"):
    count: int


class Fails(Message, tag="fails"):
    pass


pytestmark = pytest.mark.socket


@pytest.fixture
def server():
    server = serve("127.0.0.1", 0, None, "race")
    server.link.open()
    yield server
    server.stop()


def answer(visitor, ping):
    visitor.send(Pong(ping.count + 1))


def fail(visitor, message):
    raise ValueError("on purpose")


def test_a_message_is_answered(server):
    server.link.on(Ping, answer)
    with link(server.get_port()) as linked:
        assert linked.ask("pong", "ping", count=1) == {"type": "pong", "count": 2}


def test_a_message_that_comes_before_the_page_is_built_is_answered_then():
    server = serve("127.0.0.1", 0, None, "race")
    with link(server.get_port()) as linked:
        linked.send("ping", count=1)
        server.link.on(Ping, answer)
        server.link.open()
        assert linked.got("pong") == {"type": "pong", "count": 2}
    server.stop()


def test_the_links_text_is_compressed_and_the_scenes_arrays_are_not(server):
    with link(server.get_port()) as linked, open_socket(server.get_port()) as scene:
        assert [each.name for each in linked.socket.protocol.extensions] == ["permessage-deflate"]
        assert scene.protocol.extensions == []


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
    with (
        caplog.at_level(logging.WARNING, logger="race web"),
        link(server.get_port()) as linked,
    ):
        for message in nonsense:
            linked.socket.send(message)
        assert linked.ask("pong", "ping", count=4)["count"] == 5
    dropped = [record for record in caplog.records if "was dropped" in record.getMessage()]
    assert len(dropped) == 1


def test_a_page_that_leaves_is_known_and_gets_no_more(server):
    left = []
    visitors = []
    server.link.on(Ping, lambda visitor, ping: (visitors.append(visitor), answer(visitor, ping)))
    server.link.on_leave(left.append)
    with link(server.get_port()) as linked:
        linked.ask("pong", "ping", count=0)
        assert left == []
    assert until(lambda: left)
    assert left == visitors
    # neither of these fails
    visitors[0].send(Pong(0))
    server.link.send_all(Pong(0))


def test_the_server_reaches_every_page(server):
    with link(server.get_port()) as one, link(server.get_port()) as two:
        assert until(lambda: len(server.link._visitors) == 2)
        server.link.send_all(Pong(7))
        assert [linked.got("pong")["count"] for linked in (one, two)] == [7, 7]


def test_the_link_is_guarded_like_the_page():
    guarded = serve("127.0.0.1", 0, "a-token-of-this-test", "race")
    guarded.link.open()
    port = guarded.get_port()

    def status(**options):
        try:
            with link(port, **options):
                return None
        except InvalidStatus as error:
            return error.response.status_code

    cookie = {"Cookie": f"race{port}=a-token-of-this-test"}
    try:
        assert status() == 401
        assert status(additional_headers=cookie, origin="http://evil.example") == 403
        assert status(additional_headers=cookie) is None
    finally:
        guarded.stop()
