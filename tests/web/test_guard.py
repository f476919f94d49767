"""Claims about who may use the server, over raw sockets."""

import asyncio
import gc
import socket

import pytest
from viser import _messages as messages
from websockets.exceptions import InvalidStatus
from wire import CAMERA, connect, get

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


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "https://127.0.0.1", "null", "http://127.0.0.1:1"]
)
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


@pytest.mark.parametrize(
    "lines",
    [
        "Host: 127.0.0.1:{0}\r\nHost: evil.example",
        "Host: 127.0.0.1:{0}\r\nCookie: race{0}=\u00e9",
        "Host: \u00e9",
    ],
)
@pytest.mark.parametrize("server", ["open_server", "token_server"])
def test_headers_that_no_browser_sends_are_a_bad_request(server, lines, request):
    port = request.getfixturevalue(server).get_port()
    with socket.create_connection(("127.0.0.1", port), timeout=5) as raw:
        raw.sendall(f"GET / HTTP/1.1\r\n{lines.format(port)}\r\n\r\n".encode())
        assert raw.recv(100).startswith(b"HTTP/1.1 400 ")


def test_every_answer_forbids_frames_and_foreign_scripts(token_server):
    port = token_server.get_port()
    cookie = f"race{port}={TOKEN}"
    for path, headers in (
        ("/", {}),
        ("/", {"Cookie": cookie}),
        ("/nothing", {"Cookie": cookie}),
        (f"/?token={TOKEN}", {}),
    ):
        _, got = get(port, path=path, **headers)
        assert got["X-Frame-Options"] == "DENY"
        assert "frame-ancestors 'none'" in got["Content-Security-Policy"]
        assert "connect-src 'self'" in got["Content-Security-Policy"]
        assert (
            "unsafe-inline"
            not in got["Content-Security-Policy"].partition("script-src")[2].partition(";")[0]
        )


def test_no_two_pages_have_the_same_nonce(open_server):
    policies = {get(open_server.get_port())[1]["Content-Security-Policy"] for _ in range(2)}
    assert len(policies) == 2


@pytest.mark.parametrize(
    "message",
    [
        "a text",
        b"\xc1",
        b"\x80",
        b"\x81\xa4type\xa4none",
        b"\x81\xa4type\xb0GuiUpdateMessage",
        b"\x93\x01\x02\x03",
    ],
)
def test_a_malformed_message_ends_in_one_line(open_server, message, caplog):
    async def client_does():
        async with connect(open_server.get_port()) as client:
            await client._socket.send(message)
            await asyncio.wait_for(client._socket.wait_closed(), 5.0)

    asyncio.run(client_does())
    (record,) = caplog.records
    assert record.getMessage().startswith("race web: ")
    assert len(caplog.text.splitlines()) == 1


def test_a_camera_of_no_numbers_ends_in_one_line(open_server, caplog):
    async def client_does():
        async with connect(open_server.get_port()) as client:
            await client.send(**{**CAMERA, "fov": "wide", "position": "here", "wxyz": None})
            await asyncio.sleep(0.5)

    asyncio.run(client_does())
    gc.collect()  # what a task raised is reported when it is freed
    assert len(caplog.text.splitlines()) == len(caplog.records) > 0


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
        with pytest.raises(
            ValueError, match=rf"cannot listen on 127.0.0.1:{port}: address already in use"
        ):
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
