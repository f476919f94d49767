"""Guard: checks of requests to the page's server, and security headers of its answers.

Host and Origin of each request are checked, so that pages of other sites cannot reach the server
through a browser. Beyond this machine a token is required, which is given once in the address and
then kept in a cookie. Every answer has a Content-Security-Policy: the page runs only scripts of its
own server, and the frame of the scene only those marked by a nonce; both connect only to this
server. quadsim.web.page.messages checks visitors' messages.
"""

from __future__ import annotations

import logging
import secrets
import threading
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from errno import EMFILE, ENFILE
from functools import cache, partial
from http import HTTPStatus
from math import inf
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, parse_qsl, urlencode, urlsplit

import viser
import websockets.asyncio.server as websockets_server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from quadsim.web.page.link import Link
from quadsim.web.page.messages import MAX_BYTES, Control, PageConnection, is_link
from quadsim.web.page.shell_files import POLICY, own_response

ALL_INTERFACES = ("0.0.0.0", "::")
# Where viser's page is, in a frame of the page
SCENE = "/scene/"
SCENE_POLICY = (
    "default-src 'none'; script-src 'nonce-{nonce}' 'wasm-unsafe-eval'; worker-src blob:; "
    "connect-src 'self' data:; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; "
    "font-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors {around}"
)
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",  # an address may hold the token
}
PAGE_CHANGES = {  # of viser's page: its loader and the script that this writes have the nonce
    "<script data-p=": '<script nonce="NONCE" data-p=',
    "const d=document.currentScript.dataset;": (
        "const {dataset:d,nonce:pass}=document.currentScript;"
    ),
    'e.type="module";': 'e.type="module";e.nonce=pass;',
}
# of ours in viser's page, in this order
SCENE_SCRIPTS = tuple(Path(__file__).with_name(name) for name in ("page.js", "boxes.js"))
LOG = logging.getLogger("race web")
# Within which a visitor sends a whole request [s]
OPEN_TIMEOUT = 5.0
# Between two lines that say that files cannot be opened [s]
QUIET = 60.0

Serves = Callable[[ServerConnection], Awaitable[None]]
ProcessRequest = Callable[[ServerConnection, Request], Response | None]
_patching = threading.Lock()


class Guard:
    """The checks of one server.

    Args:
        host, port: address that the server listens on.
        token: token required of every visitor; None: no token is required.
        has_shell: whether the page's own document holds viser's in a frame; else viser's alone is
            the page.

    Attributes:
        server: viser's server, after its start.
        link: receiver of the messages of the page's own scripts.
    """

    def __init__(self, host: str, port: int, token: str | None, has_shell: bool = True):
        self.server: viser.ViserServer | None = None
        self.link = Link()
        names = (host, "127.0.0.1", "localhost", "::1")
        self._hosts = {host_and_port(name, port) for name in names}
        # A server that listens on all interfaces does not have a fixed name.
        self._any_host = host in ALL_INTERFACES
        self._token = token
        self._has_shell = has_shell
        self._cookie = f"race{port}"

    @contextmanager
    def guarding(self) -> Iterator[None]:
        """Guard the viser server that starts in this context: viser has no argument for that."""
        original = websockets_server.serve

        def serve(
            viser_serves: Serves, *arguments: Any, process_request: ProcessRequest, **keywords: Any
        ) -> Any:
            async def serves(connection: ServerConnection) -> None:
                if is_link(connection):
                    await self.link.serve(connection)
                else:
                    await viser_serves(connection)

            keywords |= {
                "process_request": partial(self._process, process_request),
                "create_connection": partial(PageConnection, self._find_control),
                "max_size": MAX_BYTES,
                "open_timeout": OPEN_TIMEOUT,
                "logger": LOG,
            }
            return original(serves, *arguments, **keywords)

        with _patching:
            websockets_server.serve = serve  # type: ignore[misc,assignment]
            try:
                yield
            finally:
                websockets_server.serve = original  # type: ignore[misc]

    def _process(
        self, viser_answers: ProcessRequest, connection: ServerConnection, request: Request
    ) -> Response | None:
        """Answer a request; None lets a websocket connect."""
        response = self.refusal(connection, request)
        if response is None and request.headers.get("Upgrade") == "websocket":
            return viser_answers(connection, request)
        path = urlsplit(request.path).path
        scene = SCENE if self._has_shell else "/"
        policy = POLICY
        frames = "DENY"
        caching = "no-store"
        if response is None and path == scene:
            nonce = secrets.token_urlsafe(18)
            around = "'self'" if self._has_shell else "'none'"
            policy = SCENE_POLICY.format(nonce=nonce, around=around)
            frames = "SAMEORIGIN" if self._has_shell else "DENY"
            response = scene_response(nonce)
        elif response is None and self._has_shell:
            response = own_response(path, request)
            if response is not None:
                caching = "no-cache"  # is asked for again, with its ETag
        response = response or connection.respond(HTTPStatus.NOT_FOUND, "there is no such page\n")
        response.headers["Content-Security-Policy"] = policy
        response.headers["X-Frame-Options"] = frames
        response.headers["Cache-Control"] = caching
        for name, value in HEADERS.items():
            response.headers[name] = value
        return response

    def refusal(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return the answer to a rejected request, None for an accepted one.

        A request is accepted if its Host is this server, if its Origin, which browsers send, is the
        server's own page, and if its cookie holds the token.
        """
        headers = request.headers
        if any(len(headers.get_all(name)) > 1 for name in ("Host", "Origin", "Cookie")):
            twice = "expected Host, Origin and Cookie once each\n"
            return connection.respond(HTTPStatus.BAD_REQUEST, twice)
        host = headers.get("Host", "")
        if not self._any_host and host not in self._hosts:
            return connection.respond(HTTPStatus.FORBIDDEN, "this server has another name\n")
        if headers.get("Origin", f"http://{host}") != f"http://{host}":
            foreign = "pages of another origin may not use this server\n"
            return connection.respond(HTTPStatus.FORBIDDEN, foreign)
        if self._token is None or self._is_token(cookie_of(request, self._cookie)):
            return None
        asked = parse_qs(urlsplit(request.path).query).get("token", [""])
        if not self._is_token(asked[0]):
            advice = "open the address with ?token=... that `race web` printed\n"
            return connection.respond(HTTPStatus.UNAUTHORIZED, advice)
        # Move the token from the address to a cookie.
        response = connection.respond(HTTPStatus.SEE_OTHER, "")
        others = [pair for pair in parse_qsl(urlsplit(request.path).query) if pair[0] != "token"]
        response.headers["Location"] = "/?" + urlencode(others) if others else "/"
        cookie = f"{self._cookie}={self._token}; HttpOnly; SameSite=Strict; Path=/"
        response.headers["Set-Cookie"] = cookie
        return response

    def _is_token(self, text: str) -> bool:
        """Compare with the token in constant time."""
        return text.isascii() and secrets.compare_digest(text, self._token or "")

    def _find_control(self, uuid: str) -> Control | None:
        """Return a control of the page or of one visitor's own windows."""
        if self.server is None:
            return None
        clients = self.server.get_clients().values()
        for gui in (self.server.gui, *(client.gui for client in clients)):
            # viser has no public way from a uuid to a control.
            control: Any = gui._gui_input_handle_from_uuid.get(uuid)
            if control is not None:
                return control
        return None


def host_and_port(host: str, port: int) -> str:
    """Return host and port in the format of an address."""
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def cookie_of(request: Request, name: str) -> str:
    """Return the value of a cookie, "" if there is none."""
    for part in request.headers.get("Cookie", "").split(";"):
        key, _, value = part.strip().partition("=")
        if key == name:
            return value
    return ""


def scene_response(nonce: str) -> Response:
    """Return viser's page with our scripts; every script in it has the nonce."""
    body = _viser_page().replace("NONCE", nonce).encode()
    size = str(len(body))
    headers = Headers({"Content-Type": "text/html; charset=utf-8", "Content-Length": size})
    return Response(HTTPStatus.OK, "OK", headers, body)


@cache
def _viser_page() -> str:
    """Return viser's page with PAGE_CHANGES and our scripts.

    Raises:
        RuntimeError: the version of viser is not the pinned one.
    """
    file = Path(viser.__file__).parent / "client/build/index.html"
    page = file.read_text(encoding="utf-8")
    scripts = [script.read_text(encoding="utf-8") for script in SCENE_SCRIPTS]
    elements = "".join(f'<script nonce="NONCE">{script}</script>' for script in scripts)
    ours = {"</head>": f"{elements}</head>"}
    for old, new in (PAGE_CHANGES | ours).items():
        if page.count(old) != 1:
            where = f"PAGE_CHANGES in {__file__}"
            raise RuntimeError(f"viser {viser.__version__}: its page has no {old!r}; see {where}")
        page = page.replace(old, new)
    return page


def shorten_record(record: logging.LogRecord) -> bool:
    """Reduce the log record of a visitor's error to one line, without a traceback."""
    if record.exc_info and record.exc_info[1]:
        error = record.exc_info[1]
        text = " ".join(str(error).split())[:200]
        record.msg = f"race web: {record.getMessage()}: {type(error).__name__}: {text}"
        record.args = ()
        record.exc_info = None
    return True


LOG.addFilter(shorten_record)


class OneLineOfNoFiles(logging.Filter):
    """Reduces asyncio's records of a process without free file descriptors to a line a minute.

    asyncio tries to accept each waiting connection again, with a traceback each.
    """

    def __init__(self) -> None:
        super().__init__()
        self._told = -inf

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a record is written."""
        error = record.exc_info[1] if record.exc_info else None
        if not (isinstance(error, OSError) and error.errno in (EMFILE, ENFILE)):
            return True
        if record.created - self._told < QUIET:
            return False
        self._told = record.created
        record.msg = (
            f"race web: {str(error.strerror).lower()}: new visitors wait; raise `ulimit -n`"
        )
        record.args = ()
        record.exc_info = None
        return True


logging.getLogger("asyncio").addFilter(OneLineOfNoFiles())
