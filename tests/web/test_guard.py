"""Claims about who may use the server, over raw sockets."""

import asyncio
import socket

import pytest
from viser import _messages as messages
from websockets.exceptions import InvalidStatus
from wire import connect, get

from web.page.guard import new_token, probe, serve

TOKEN = "a-token-of-this-test"


@pytest.fixture(scope="module")
def open_server():
    server = serve("127.0.0.1", 0, None, "race")
    yield server
    server.stop()


@pytest.fixture(scope="module")
def token_server():
    server = serve("127.0.0.1", 0, TOKEN, "race")
    yield server
    server.stop()


def refused(port, **options):
    """The status a websocket is refused with, None if it is accepted."""

    async def attempt():
        async with connect(port, **options):
            return None

    try:
        return asyncio.run(attempt())
    except InvalidStatus as error:
        return error.response.status_code


def test_the_servers_own_page_may_connect(open_server):
    port = open_server.get_port()
    assert get(port)[0] == 200
    assert refused(port, origin=f"http://127.0.0.1:{port}") is None
    assert refused(port, origin=f"http://localhost:{port}", host="localhost") is None


@pytest.mark.parametrize("origin", ["http://evil.example", "https://127.0.0.1", "null", "http://127.0.0.1:1"])
def test_a_foreign_page_is_refused(open_server, origin):
    assert refused(open_server.get_port(), origin=origin) == 403


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1"])
def test_a_foreign_name_is_refused(open_server, host):
    """Else a foreign page could resolve a name of its own to this machine (DNS rebinding)."""
    assert get(open_server.get_port(), host=host)[0] == 403


def test_without_the_token_nothing_is_served(token_server):
    port = token_server.get_port()
    assert get(port)[0] == 401
    assert get(port, path="/?token=wrong")[0] == 401
    assert get(port, Cookie=f"race{port}=wrong")[0] == 401
    assert refused(port) == 401


def test_the_token_becomes_a_cookie_that_scripts_cannot_read(token_server):
    port = token_server.get_port()
    status, headers = get(port, path=f"/?token={TOKEN}")
    assert (status, headers["Location"]) == (303, "/")
    assert "HttpOnly" in headers["Set-Cookie"]
    assert "SameSite=Strict" in headers["Set-Cookie"]
    cookie = headers["Set-Cookie"].partition(";")[0]
    assert get(port, Cookie=cookie)[0] == 200
    assert refused(port, additional_headers={"Cookie": cookie}) is None


def test_a_foreign_page_is_refused_even_with_the_token(token_server):
    port = token_server.get_port()
    cookie = {"Cookie": f"race{port}={TOKEN}"}
    assert refused(port, additional_headers=cookie, origin="http://evil.example") == 403


def test_only_other_machines_need_a_token():
    assert new_token("127.0.0.1") is None
    assert new_token("localhost") is None
    assert len(new_token("0.0.0.0")) >= 20
    assert new_token("192.168.1.7") != new_token("192.168.1.7")


def test_a_server_for_everybody_checks_origin_against_host():
    server = serve("0.0.0.0", 0, TOKEN, "race")
    try:
        port = server.get_port()
        cookie = {"Cookie": f"race{port}={TOKEN}"}
        assert refused(port, additional_headers=cookie, origin=f"http://127.0.0.1:{port}") is None
        assert refused(port, additional_headers=cookie, origin="http://evil.example") == 403
        assert refused(port) == 401
    finally:
        server.stop()


def test_a_busy_port_is_one_clear_error():
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        port = busy.getsockname()[1]
        with pytest.raises(ValueError, match=rf"cannot listen on 127.0.0.1:{port}: address already in use"):
            serve("127.0.0.1", port, None, "race")


@pytest.mark.parametrize(
    ("host", "port", "said"),
    [
        ("127.0.0.1", 99999, "port: expected 0 to 65535, got 99999"),
        ("127.0.0.1", -1, "port: expected 0 to 65535, got -1"),
        ("203.0.113.7", 0, "cannot listen on 203.0.113.7:0"),
        ("no.such.host.invalid", 0, "cannot listen on no.such.host.invalid:0"),
    ],
)
def test_a_wrong_host_or_port_is_one_clear_error(host, port, said):
    with pytest.raises(ValueError, match=said) as error:
        probe(host, port)
    assert "\n" not in str(error.value)


def test_tunnel_and_uploads_are_switched_off(open_server):
    handlers = open_server._websock_server._incoming_handlers
    assert messages.ShareUrlRequest not in handlers
    assert messages.FileTransferStartUpload not in handlers
    assert messages.GuiUpdateMessage in handlers  # the dictionary holds what is looked for above
    assert open_server.request_share_url() is None


def test_nothing_is_printed_on_stdout(capfd):
    serve("127.0.0.1", 0, None, "race").stop()
    assert capfd.readouterr().out == ""
