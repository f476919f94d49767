"""Claims about who may use the server, over raw sockets."""

import errno
import logging
import re
import socket
from pathlib import Path
from urllib.request import urlopen

import msgspec
import pytest
from web_cases import Clock
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect as connected
from wire import CAMERA, PATIENCE, PROTOCOL, connect, get

from quadsim.web.page.server import guard
from quadsim.web.page.server.behind import behind_of
from quadsim.web.page.server.guard import OneLineOfNoFiles
from quadsim.web.page.server.messages import MOST_WAITING, problem_of
from quadsim.web.page.server.page_server import kept_token, new_token, probe, serve
from quadsim.web.page.server.seats import SCENE as SCENES
from quadsim.web.page.server.shell_files import static_folder
from quadsim.web.page.server.viser_private import scene_page
from quadsim.web.page.server.wrong_tokens import MOST, MOST_ADDRESSES, SPAN, WrongTokens

TOKEN = "a-token-of-this-test"
SECURITY = Path(__file__).parents[2] / "SECURITY.md"
SHELL = Path(__file__).parents[2] / "web/page/shell"
OTHER_HEADERS = ("Referrer-Policy", "Cache-Control")
SCENE = f"{SCENES}a_seat_of_this_test"
SCRIPT = f"{static_folder()}app.js"


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
    try:
        with connect(port, **options):
            return None
    except InvalidStatus as error:
        return error.response.status_code


@pytest.mark.socket
def test_the_servers_own_page_may_connect(open_server):
    port = open_server.get_port()
    assert get(port)[0] == 200
    assert refused(port, origin=f"http://127.0.0.1:{port}") is None
    assert refused(port, origin=f"http://localhost:{port}", host="localhost") is None


@pytest.mark.socket
@pytest.mark.parametrize(
    "origin", ["http://evil.example", "https://127.0.0.1", "null", "http://127.0.0.1:1"]
)
def test_a_foreign_page_is_refused(open_server, origin):
    assert refused(open_server.get_port(), origin=origin) == 403


@pytest.mark.socket
@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1"])
def test_a_foreign_name_is_refused(open_server, host):
    """Else a foreign page could resolve a name of its own to this machine (DNS rebinding)."""
    assert get(open_server.get_port(), host=host)[0] == 403


@pytest.mark.socket
def test_without_the_token_nothing_is_served(token_server):
    port = token_server.get_port()
    assert get(port)[0] == 401
    assert get(port, path="/?token=wrong")[0] == 401
    assert get(port, Cookie=f"race{port}=wrong")[0] == 401
    assert refused(port) == 401


@pytest.mark.socket
def test_who_guesses_at_the_token_is_refused_but_not_who_has_the_cookie(caplog):
    """A laboratory may have one address."""
    server = serve("127.0.0.1", 0, TOKEN, "race")
    port = server.get_port()
    # An old page asks again and again with one token, which is no guess.
    for _ in range(2 * MOST):
        assert get(port, Cookie=f"race{port}=old")[0] == 401
    for k in range(MOST - 1):
        assert get(port, path=f"/?token=guess{k}")[0] == 401
    for path in ("/", SCENE, f"/?token={TOKEN}"):
        assert get(port, path=path)[0] == 429
    assert refused(port) == 429
    right = {"Cookie": f"race{port}={TOKEN}"}
    assert [get(port, path=path, **right)[0] for path in ("/", SCENE)] == [200, 200]
    assert refused(port, additional_headers=right) is None
    assert [record.getMessage() for record in caplog.records] == [
        f"race web: {MOST} wrong tokens from 127.0.0.1: it is refused for 60 s"
    ]
    server.stop()


def test_an_address_is_refused_for_a_minute_and_no_other_address_with_it():
    clock = Clock()
    wrong = WrongTokens(clock)
    for k in range(MOST):
        assert not wrong.is_refused("10.0.0.1")
        wrong.add("10.0.0.1", str(k))
    assert wrong.is_refused("10.0.0.1")
    assert not wrong.is_refused("10.0.0.2")
    clock.now += SPAN + 1
    assert not wrong.is_refused("10.0.0.1")
    wrong.add("10.0.0.1", "another")
    assert not wrong.is_refused("10.0.0.1")
    # No number of addresses takes more memory than so much.
    for k in range(2 * MOST_ADDRESSES):
        wrong.add(f"10.1.{k // 256}.{k % 256}", "x")
    assert len(wrong._found) == MOST_ADDRESSES


@pytest.mark.socket
def test_the_token_becomes_a_cookie_that_scripts_cannot_read(token_server):
    port = token_server.get_port()
    status, headers = get(port, path=f"/?token={TOKEN}")
    assert (status, headers["Location"]) == (303, "/")
    assert "HttpOnly" in headers["Set-Cookie"]
    assert "SameSite=Strict" in headers["Set-Cookie"]
    cookie = headers["Set-Cookie"].partition(";")[0]
    assert get(port, Cookie=cookie)[0] == 200
    assert refused(port, additional_headers={"Cookie": cookie}) is None


@pytest.mark.socket
def test_what_a_link_names_stays_in_the_address_without_the_token(token_server):
    asked = "run=a_b&t=3.2&camera=top%0d%0aX:y"
    status, headers = get(token_server.get_port(), path=f"/?run=c&token={TOKEN}&{asked}")
    assert (status, headers["Location"]) == (303, "/?run=c&run=a_b&t=3.2&camera=top%0D%0AX%3Ay")


@pytest.mark.socket
def test_no_cookie_holds_the_nonce_of_a_policy(token_server, open_server):
    """A script that runs with the nonce would know the cookie, and the reverse."""
    port = token_server.get_port()
    _, first = get(port, path=f"/?token={TOKEN}")
    value = first["Set-Cookie"].partition(";")[0].partition("=")[2]
    cookie = {"Cookie": first["Set-Cookie"].partition(";")[0]}
    _, scene = get(port, path=SCENE, **cookie)
    _, page = get(port, **cookie)
    assert "'nonce-" in scene["Content-Security-Policy"]
    for headers in (first, page, scene):
        assert value not in headers["Content-Security-Policy"]
    for headers in (page, scene, get(open_server.get_port())[1]):
        assert "Set-Cookie" not in headers


@pytest.mark.socket
def test_a_foreign_page_is_refused_even_with_the_token(token_server):
    port = token_server.get_port()
    cookie = {"Cookie": f"race{port}={TOKEN}"}
    assert refused(port, additional_headers=cookie, origin="http://evil.example") == 403


TWO_HOSTS = "Host: 127.0.0.1:{0}\r\nHost: evil.example"
FOREIGN_COOKIE = "Host: 127.0.0.1:{0}\r\nCookie: race{0}=\u00e9"


@pytest.mark.socket
@pytest.mark.parametrize(
    ("lines", "status"), [(TWO_HOSTS, 400), (FOREIGN_COOKIE, 401), ("Host: \u00e9", 403)]
)
def test_headers_that_no_browser_sends_are_refused(token_server, lines, status):
    port = token_server.get_port()
    with socket.create_connection(("127.0.0.1", port), timeout=5) as raw:
        raw.sendall(f"GET / HTTP/1.1\r\n{lines.format(port)}\r\n\r\n".encode())
        assert raw.recv(100).startswith(f"HTTP/1.1 {status} ".encode())


@pytest.mark.socket
def test_every_answer_forbids_frames_and_foreign_scripts(token_server):
    """The scene alone may be in a frame, of this page; only its document has styles in line."""
    port = token_server.get_port()
    cookie = {"Cookie": f"race{port}={TOKEN}"}
    for path, headers in (
        ("/", {}),
        (SCENE, {}),
        (SCRIPT, {}),
        (f"/?token={TOKEN}", {}),
        *((path, cookie) for path in ("/", SCENE, SCRIPT, "/nothing", "/link")),
    ):
        status, got = get(port, path=path, **headers)
        assert headers or status in (401, 303)
        policy = dict(part.split(" ", 1) for part in got["Content-Security-Policy"].split("; "))
        is_scene = status == 200 and path == SCENE
        around = ("'self'", "SAMEORIGIN") if is_scene else ("'none'", "DENY")
        assert (policy["frame-ancestors"], got["X-Frame-Options"]) == around
        assert policy["default-src"] == policy["base-uri"] == policy["form-action"] == "'none'"
        assert policy["connect-src"].split()[0] == "'self'"
        assert got["X-Content-Type-Options"] == "nosniff"
        if is_scene:
            assert policy["script-src"].startswith("'nonce-")
            assert "unsafe-inline" not in policy["script-src"]
        else:
            assert policy["script-src"] == policy["style-src"] == "'self'"


@pytest.mark.socket
def test_the_headers_are_those_of_the_table(open_server):
    lines = [line for line in SECURITY.read_text().splitlines() if line.startswith("| `")]
    rows = [[cell.strip(" `") for cell in line.strip("|").split("|")] for line in lines]
    documented = [row for row in rows if row[0].startswith("X-") or row[0] in OTHER_HEADERS]
    policies = [row for row in rows if row[0].endswith(("-src", "-uri", "-action", "-ancestors"))]
    for column, path in enumerate(("/", SCENE), 1):
        status, got = get(open_server.get_port(), path=path)
        assert status == 200
        shown = {row[0]: row[column] for row in documented}
        assert shown == {name: got[name] for name in shown}
        policy = re.sub("nonce-[^']+", "nonce-NONCE", got["Content-Security-Policy"])
        parts = dict(part.split(" ", 1) for part in policy.split("; "))
        assert parts == {row[0]: row[column] for row in policies if row[column]}
        assert set(got) - {"Date", "Server", "Connection", "ETag"} == {
            *shown,
            "Content-Type",
            "Content-Length",
            "Content-Security-Policy",
        }
    assert len(documented) == 4


@pytest.mark.socket
def test_only_files_of_the_page_are_served(open_server):
    """Neither the server's code, nor viser's other files, nor anything above the folder."""
    port = open_server.get_port()
    assert get(port, path=SCRIPT)[0] == 200
    for path in (
        "/static/",
        "/static/app.js",
        SCRIPT.replace("app.js", ""),
        SCRIPT.replace("app.js", "index.html"),
        SCRIPT.replace("app.js", "../index.html"),
        "/static/00000000000000000000000000000000/app.js",
        "/static/index.html",
        "/static/../guard.py",
        "/static/%2e%2e/guard.py",
        "/app.js",
        "/guard.py",
        "/scene",
        "/scene/",
        "/scene/short",
        "/scene/../../etc/passwd-of-this",
        "/download/",
        "/download/x",
        "/scene/index.html",
        "/assets/",
        "/etc/passwd",
    ):
        assert get(port, path=path)[0] == 404, path


@pytest.mark.socket
def test_a_file_that_a_browser_has_is_not_sent_again(open_server):
    port = open_server.get_port()
    status, headers = get(port, path="/")
    assert (status, headers["Cache-Control"]) == (200, "no-cache")
    assert get(port, path="/", If_None_Match=headers["ETag"])[0] == 304
    # style sheets and scripts are named by their hash, and never asked for again
    assert "immutable" in get(port, path=SCRIPT)[1]["Cache-Control"]
    # but a document that a token or a nonce stands for is kept nowhere
    assert get(port, path=SCENE)[1]["Cache-Control"] == "no-store"


@pytest.mark.socket
def test_the_document_names_every_style_sheet_and_script(open_server):
    """A script that is known by another script alone comes later."""
    port = open_server.get_port()
    with urlopen(f"http://127.0.0.1:{port}/") as answer:
        named = re.findall(r'(?:href|src)="(static/[^"]+)"', answer.read().decode())
    assert {Path(name).name for name in named} == {
        path.name for path in SHELL.iterdir() if path.suffix in (".css", ".js")
    }
    assert all(get(port, path=f"/{name}")[0] == 200 for name in named)


@pytest.mark.socket
def test_the_client_of_the_scene_is_sent_once_and_kept_under_its_hash(open_server):
    port = open_server.get_port()
    script = scene_page(True)
    path = f"/static/{script.name}"
    status, headers = get(port, path=path)
    assert (status, int(headers["Content-Length"])) == (200, len(script.script))
    assert "immutable" in headers["Cache-Control"]
    assert int(get(port, path=SCENE)[1]["Content-Length"]) < len(script.script) / 100
    assert get(port, path=path.replace("scene-", "scene-0"))[0] == 404


@pytest.mark.socket
@pytest.mark.parametrize("path", ["/", "/nothing", "/scene/", SCRIPT, "/link/"])
def test_at_other_paths_there_is_no_websocket(open_server, path):
    with pytest.raises(InvalidStatus) as error:
        connected(f"ws://127.0.0.1:{open_server.get_port()}{path}", subprotocols=[PROTOCOL])
    assert error.value.response.status_code == 404


BEHIND = behind_of("https://lab.example/race")


@pytest.mark.socket
def test_behind_a_proxy_the_page_has_another_name_and_needs_the_token():
    assert new_token("127.0.0.1", BEHIND)
    server = serve("127.0.0.1", 0, TOKEN, "race", behind=BEHIND)
    port = server.get_port()
    try:
        status, headers = get(port, path=f"/?run=a&token={TOKEN}", host="lab.example")
        assert (status, headers["Location"]) == (303, "/race/?run=a")
        assert headers["Set-Cookie"].endswith("; Secure")
        cookie = {"Cookie": headers["Set-Cookie"].partition(";")[0]}
        # the proxy may forward the name or not
        for host in ("lab.example", f"127.0.0.1:{port}"):
            assert get(port, host=host, Origin="https://lab.example", **cookie)[0] == 200
            for origin in ("http://evil.example", "http://lab.example:81", "null"):
                assert get(port, host=host, Origin=origin, **cookie)[0] == 403
        assert get(port, host="evil.example", **cookie)[0] == 403
        # a visitor who guesses takes the page from no other one
        for k in range(MOST):
            get(port, path=f"/?token=guess{k}", X_Forwarded_For="10.9.9.9, 10.0.0.1")
        asked = f"/?token={TOKEN}"
        assert get(port, path=asked, X_Forwarded_For="10.0.0.1")[0] == 429
        assert get(port, path=asked, X_Forwarded_For="10.0.0.1, 10.0.0.2")[0] == 303
    finally:
        server.stop()


def test_an_address_at_a_proxy_is_a_plain_one():
    assert behind_of("https://lab.example:443") == ("https://lab.example", "lab.example", "/")
    assert behind_of("http://[::1]:81/a/b/").host == "[::1]:81"
    for wrong in ("lab.example/race", "ftp://a", "https://", "https://a:b", "https://a/?x", ""):
        with pytest.raises(ValueError, match=r"^behind: expected .*https://name/path"):
            behind_of(wrong)


@pytest.mark.socket
def test_no_two_scenes_have_the_same_nonce(open_server):
    port = open_server.get_port()
    policies = {get(port, path=SCENE)[1]["Content-Security-Policy"] for _ in range(2)}
    assert len(policies) == 2


@pytest.mark.socket
@pytest.mark.parametrize(
    "message",
    [
        "a text",
        b"\xc1",
        b"\x80",
        b"\x81\xa4type\xa4none",
        b"\x81\xa4type\xb0GuiUpdateMessage",
        b"\x93\x01\x02\x03",
        msgspec.msgpack.encode({**CAMERA, "fov": "wide", "position": "here", "wxyz": None}),
    ],
)
def test_a_malformed_message_is_dropped_with_one_line(open_server, message, caplog):
    """Of several, the first one alone is logged."""
    with connect(open_server.get_port()) as client:
        for _ in range(3):
            client.socket.send(message)
        assert client.socket.ping().wait(PATIENCE)
    assert len(caplog.records) == 1
    assert len(caplog.text.splitlines()) == 1


def test_only_other_machines_need_a_token():
    assert new_token("127.0.0.1") is None
    assert new_token("localhost") is None
    assert len(new_token("0.0.0.0")) >= 20
    assert new_token("192.168.1.7") != new_token("192.168.1.7")


def test_a_token_is_kept_in_a_file_for_its_owner_alone(tmp_path):
    file = tmp_path / "token"
    token = kept_token(file)
    assert kept_token(file) == token != kept_token(tmp_path / "other")
    assert file.stat().st_mode & 0o077 == 0
    file.write_text("short")
    for wrong in (file, tmp_path / "no" / "such"):
        with pytest.raises(ValueError, match=r"^token-file: "):
            kept_token(wrong)


@pytest.mark.socket
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


@pytest.mark.socket
def test_a_busy_port_is_one_line():
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        port = busy.getsockname()[1]
        with pytest.raises(ValueError, match=f"^port: .*{port}") as error:
            serve("127.0.0.1", port, None, "race")
        assert "\n" not in str(error.value)


@pytest.mark.socket
@pytest.mark.parametrize(
    ("host", "port", "wrong"),
    [
        ("127.0.0.1", 99999, "port"),
        ("127.0.0.1", -1, "port"),
        ("203.0.113.7", 0, "host"),
        ("no.such.host.invalid", 0, "host"),
    ],
)
def test_a_wrong_host_or_port_is_one_line(host, port, wrong):
    with pytest.raises(ValueError, match=f"^{wrong}: ") as error:
        probe(host, port)
    assert "\n" not in str(error.value)


SHARE = {"type": "ShareUrlRequest"}
UPLOAD = {
    "type": "FileTransferStartUpload",
    "source_component_uuid": "x",
    "transfer_uuid": "y",
    "filename": "z",
    "mime_type": "text/plain",
    "part_count": 1,
    "size_bytes": 1,
}


@pytest.mark.socket
def test_a_file_is_fetched_once_by_who_knows_its_address_and_has_the_token(token_server):
    port = token_server.get_port()
    cookie = {"Cookie": f"race{port}={TOKEN}"}
    address = token_server.downloads.offer("a ' \r\n.csv", b"1,2")
    assert get(port, path=address)[0] == 401
    status, headers = get(port, path=address, **cookie)
    assert (status, headers["Content-Disposition"]) == (
        200,
        "attachment; filename*=UTF-8''a%20%27%20%0D%0A.csv",
    )
    assert headers["Content-Type"] == "application/octet-stream"
    assert get(port, path=address, **cookie)[0] == 404
    many = [token_server.downloads.offer("x", b"") for _ in range(6)]
    found = [get(port, path=one, **cookie)[0] for one in many]
    assert found == [404, 404, 200, 200, 200, 200]


CONTROL = {"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": 1}}


@pytest.mark.parametrize("message", [SHARE, UPLOAD, CONTROL])
def test_tunnel_uploads_and_controls_are_switched_off(message):
    assert problem_of(msgspec.msgpack.encode(message))


def test_a_camera_is_acceptable():
    assert not problem_of(msgspec.msgpack.encode(CAMERA))


HANDLE = {
    "type": "TransformControlsUpdateMessage",
    "name": "/edit/handle/0",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [1.0, 2.0, 3.0],
    "owner": "",
}


def test_the_pose_of_a_handle_is_one_that_a_part_of_a_course_can_have():
    def problem(**changed):
        return problem_of(msgspec.msgpack.encode(HANDLE | changed))

    assert not problem()
    assert problem(position=[1.0, 2.0, 1e5])
    assert problem(position=[1.0, float("nan"), 3.0])
    assert problem(wxyz=[0.0, 0.0, 0.0, 0.0])
    assert problem(wxyz=[float("inf"), 0.0, 0.0, 0.0])
    assert problem(name="x" * 1000)
    assert problem(scale=2.0)


@pytest.mark.parametrize(
    "data",
    [
        b"\x91" * 10**5 + b"\xc0",
        b"\x81\xa1a" * 10**5 + b"\xc0",
        b"\x82\xa4type\xa1\xff",
        msgspec.msgpack.encode({**CAMERA, "a\nb\x1b[31m": 1}),
        msgspec.msgpack.encode({**CAMERA, "fov": float("nan")}),
        msgspec.msgpack.encode({**CAMERA, "position": [0.0, float("inf"), 0.0]}),
        msgspec.msgpack.encode({"type": "CommandTriggerMessage", "uuid": "x", "updates": {}}),
    ],
)
def test_a_message_that_is_deep_not_finite_or_has_more_fields_is_one_line(data):
    """viser ended the connection of a message with a field too many."""
    problem = problem_of(data)
    assert problem
    assert problem.isprintable()
    assert len(problem) < 100


@pytest.fixture
def serve_for(monkeypatch):
    """Return a function that serves a page and waits so long for a whole request [s]."""
    servers = []

    def begin(seconds):
        monkeypatch.setattr(guard, "OPEN_TIMEOUT", seconds)
        servers.append(serve("127.0.0.1", 0, TOKEN, "race"))
        return servers[-1].get_port()

    yield begin
    for server in servers:
        server.stop()


def half_open(port):
    """Return a connection that has sent half of a request."""
    one = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)
    one.sendall(b"GET / HTTP/1.1\r\nHost: ")
    return one


@pytest.mark.socket
def test_half_of_a_request_is_not_waited_for(serve_for):
    assert is_closed(half_open(serve_for(0.2)))


@pytest.mark.socket
def test_visitors_who_send_no_whole_request_hold_few_connections(serve_for, caplog):
    port = serve_for(600.0)
    half = [half_open(port) for _ in range(2 * MOST_WAITING)]
    # The first half of them is closed, and a whole request is answered
    for one in half[:MOST_WAITING]:
        assert is_closed(one)
    assert get(port)[0] == 401
    open_still = [one for one in half[MOST_WAITING:] if not is_closed(one, patience=0.0)]
    assert len(open_still) >= MOST_WAITING - 1
    for one in half:
        one.close()
    assert not any(record.exc_info for record in caplog.records)


def is_closed(one, patience=PATIENCE):
    """Return whether the server has closed a connection."""
    one.settimeout(patience or 0.001)
    try:
        return one.recv(1) == b""
    except ConnectionError:
        return True
    except TimeoutError:
        return False


def test_a_process_without_files_says_so_in_a_line_a_minute():
    quiet = OneLineOfNoFiles()
    error = OSError(errno.EMFILE, "Too many open files")

    def record(seconds):
        made = logging.LogRecord(
            "asyncio", logging.ERROR, "", 0, "a\nb", (), (OSError, error, None)
        )
        made.created = seconds
        return made

    first = record(0.0)
    assert quiet.filter(first)
    assert first.exc_info is None
    said = "race web: too many open files: new visitors wait; raise `ulimit -n`"
    assert first.getMessage() == said
    assert [quiet.filter(record(seconds)) for seconds in (0.1, 59.0, 61.0)] == [False, False, True]
    fault = ValueError("another")
    other = logging.LogRecord("asyncio", logging.ERROR, "", 0, "a", (), (ValueError, fault, None))
    assert quiet.filter(other)
    assert other.exc_info


@pytest.mark.socket
def test_nothing_is_printed_on_stdout(capfd):
    serve("127.0.0.1", 0, None, "race").stop()
    assert capfd.readouterr().out == ""
