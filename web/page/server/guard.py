"""Guard: checks of requests to the page's server, and security headers of its answers.

Host and Origin of each request are checked, so that pages of other sites cannot reach the server
through a browser. Beyond this machine a token is required, which is given once in the address and
then kept in a cookie. Every answer has a Content-Security-Policy: the page runs only scripts of its
own server, and the frame of the scene only those marked by a nonce; both connect only to this
server. quadsim.web.page.server.messages checks visitors' messages.
"""

from __future__ import annotations

import logging
import secrets
from contextlib import AbstractContextManager
from errno import EMFILE, ENFILE
from functools import partial
from http import HTTPStatus
from math import inf
from typing import NamedTuple
from urllib.parse import parse_qs, parse_qsl, urlencode, urlsplit

from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from quadsim.web.page.server.behind import Behind
from quadsim.web.page.server.downloads import Downloads
from quadsim.web.page.server.link import LINK_PATH, Link
from quadsim.web.page.server.messages import MAX_BYTES, PageConnection, is_link
from quadsim.web.page.server.seats import SEAT, seat_in
from quadsim.web.page.server.shell_files import (
    POLICY,
    STATIC,
    document_response,
    static_response,
)
from quadsim.web.page.server.viser_private import (
    ProcessRequest,
    ScenePage,
    Serves,
    scene_page,
    serving,
)
from quadsim.web.page.server.wrong_tokens import SPAN, WrongTokens

ALL_INTERFACES = ("0.0.0.0", "::")
SCENE_POLICY = (
    "default-src 'none'; script-src 'nonce-{nonce}' 'wasm-unsafe-eval'; worker-src blob:; "
    "connect-src 'self' data:; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; "
    "font-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors {around}"
)
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",  # an address may hold the token
}
LOG = logging.getLogger("race web")
# Of a file whose name has the hash of its content, for the visitor who has the token
FOREVER = "private, max-age=31536000, immutable"
# Within which a visitor sends a whole request [s]
OPEN_TIMEOUT = 5.0
# Between two lines that say that files cannot be opened [s]
QUIET = 60.0


class Answer(NamedTuple):
    """An answer, and the headers that depend on what it is."""

    response: Response
    policy: str = POLICY
    frames: str = "DENY"
    caching: str = "no-store"


class Guard:
    """The checks of one server.

    Args:
        host, port: address that the server listens on.
        token: token required of every visitor; None: no token is required.
        has_shell: whether the page's own document holds viser's in a frame; else viser's alone is
            the page.
        behind: address of the page at a proxy; None: browsers reach the server itself.

    Attributes:
        link: receiver of the messages of the page's own scripts.
        downloads: the files that wait for visitors.
        needs_token: whether a visitor has to know the token.
    """

    def __init__(
        self,
        host: str,
        port: int,
        token: str | None,
        has_shell: bool = True,
        behind: Behind | None = None,
    ):
        self.link = Link()
        self.downloads = Downloads()
        names = (host, "127.0.0.1", "localhost", "::1")
        self._hosts = {host_and_port(name, port) for name in names}
        self._behind = behind
        if behind:
            self._hosts.add(behind.host)
        # A server that listens on all interfaces does not have a fixed name.
        self._any_host = host in ALL_INTERFACES
        self._token = token
        self.needs_token = token is not None
        self._wrong = WrongTokens()
        self._has_shell = has_shell
        self._cookie = f"race{port}"

    def guarding(self) -> AbstractContextManager[None]:
        """Guard the viser server that starts in this context."""
        return serving(
            self._serves,
            lambda viser_answers: partial(self._process, viser_answers),
            create_connection=PageConnection,
            max_size=MAX_BYTES,
            open_timeout=OPEN_TIMEOUT,
            compression="deflate",
            logger=LOG,
        )

    def _serves(self, viser_serves: Serves) -> Serves:
        """Return the function that serves the websockets of both the page's link and viser's scene.

        Args:
            viser_serves: viser's function, which serves websockets of the scene.
        """

        async def serves(connection: ServerConnection) -> None:
            if is_link(connection):
                await self.link.serve(connection)
                return
            SEAT.set(seat_in(path_of(connection.request)) or "")
            await viser_serves(connection)

        return serves

    def _process(
        self, viser_answers: ProcessRequest, connection: ServerConnection, request: Request
    ) -> Response | None:
        """Answer a request; None lets a websocket connect."""
        path = path_of(request)
        is_websocket = request.headers.get("Upgrade") == "websocket"
        refusal = self.refusal(connection, request)
        if refusal is None and is_websocket and self._is_served(path):
            if path != LINK_PATH:
                # The link's tables are text. The scene has arrays of floats, which hardly shrink.
                request.headers.pop("Sec-WebSocket-Extensions", None)
            return viser_answers(connection, request)
        found = None
        if refusal is None and not is_websocket:
            found = self._found(path, request)
        nothing = connection.respond(HTTPStatus.NOT_FOUND, "there is no such page\n")
        answer = found or Answer(refusal or nothing)
        answer.response.headers["Content-Security-Policy"] = answer.policy
        answer.response.headers["X-Frame-Options"] = answer.frames
        answer.response.headers["Cache-Control"] = answer.caching
        for name, value in HEADERS.items():
            answer.response.headers[name] = value
        return answer.response

    def _is_served(self, path: str) -> bool:
        """Return whether there is a websocket at a path: the link, or a scene's."""
        if not self._has_shell:
            return path == "/"
        return path == LINK_PATH or seat_in(path) is not None

    def _found(self, path: str, request: Request) -> Answer | None:
        """Return the answer for a path; None: there is nothing."""
        scene = scene_page(self._has_shell)
        if path == STATIC + scene.name:
            return Answer(script_response(scene.script), caching=FOREVER)
        if not self._has_shell:
            return self._scene(scene, STATIC.lstrip("/")) if path == "/" else None
        if seat_in(path) is not None:
            return self._scene(scene, ".." + STATIC)
        download = self.downloads.response(path)
        if download is not None:
            return Answer(download)
        document = document_response(path, request)
        if document is not None:
            return Answer(document, caching="no-cache")  # asked for again, with its ETag
        static = static_response(path)
        return None if static is None else Answer(static, caching=FOREVER)

    def _scene(self, scene: ScenePage, folder: str) -> Answer:
        """Return the document of a scene. folder: of the script, seen from the document."""
        nonce = secrets.token_urlsafe(18)
        around = "'self'" if self._has_shell else "'none'"
        document = scene.document.replace("NONCE", nonce).replace("SCRIPT", folder + scene.name)
        return Answer(
            response_of(document.encode(), "text/html; charset=utf-8"),
            policy=SCENE_POLICY.format(nonce=nonce, around=around),
            frames="SAMEORIGIN" if self._has_shell else "DENY",
        )

    def refusal(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return the answer to a rejected request, None for an accepted one.

        A request is accepted if its Host is this server, if its Origin, which browsers send, is the
        server's own page, and if its cookie holds the token. An address from which many different
        wrong tokens came is refused for a while, but for visitors who have the cookie.
        """
        headers = request.headers
        if any(len(headers.get_all(name)) > 1 for name in ("Host", "Origin", "Cookie")):
            twice = "expected Host, Origin and Cookie once each\n"
            return connection.respond(HTTPStatus.BAD_REQUEST, twice)
        host = headers.get("Host", "")
        if not self._any_host and host not in self._hosts:
            return connection.respond(HTTPStatus.FORBIDDEN, "this server has another name\n")
        own = {f"http://{host}"} | ({self._behind.origin} if self._behind else set())
        if headers.get("Origin", f"http://{host}") not in own:
            foreign = "pages of another origin may not use this server\n"
            return connection.respond(HTTPStatus.FORBIDDEN, foreign)
        if self._token is None:
            return None
        kept = cookie_of(request, self._cookie)
        if self._is_token(kept):
            return None
        address = self._address_of(connection, request)
        if self._wrong.is_refused(address):
            wait = f"too many wrong tokens: wait {SPAN:g} s\n"
            return connection.respond(HTTPStatus.TOO_MANY_REQUESTS, wait)
        asked = parse_qs(urlsplit(request.path).query).get("token", [""])
        if not self._is_token(asked[0]):
            for wrong in filter(None, (kept, asked[0])):
                self._wrong.add(address, wrong)
            advice = "open the address with ?token=... that `race web` printed\n"
            return connection.respond(HTTPStatus.UNAUTHORIZED, advice)
        return self._with_cookie(connection, request)

    def _with_cookie(self, connection: ServerConnection, request: Request) -> Response:
        """Move the token from the address to a cookie."""
        response = connection.respond(HTTPStatus.SEE_OTHER, "")
        others = [pair for pair in parse_qsl(urlsplit(request.path).query) if pair[0] != "token"]
        root = self._behind.path if self._behind else "/"
        response.headers["Location"] = f"{root}?{urlencode(others)}" if others else root
        cookie = f"{self._cookie}={self._token}; HttpOnly; SameSite=Strict; Path=/"
        if self._behind and self._behind.is_encrypted:
            cookie += "; Secure"
        response.headers["Set-Cookie"] = cookie
        return response

    def _address_of(self, connection: ServerConnection, request: Request) -> str:
        """Return the address of a visitor, which a proxy adds to a list of its own."""
        forwarded = request.headers.get_all("X-Forwarded-For")
        if self._behind and forwarded:
            return forwarded[-1].rpartition(",")[2].strip()
        return str((connection.remote_address or ("",))[0])

    def _is_token(self, text: str) -> bool:
        """Return whether a text is the token, compared in constant time."""
        return text.isascii() and secrets.compare_digest(text, self._token or "")


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


def path_of(request: Request | None) -> str:
    """Return the path of a request, without its query."""
    return urlsplit(request.path).path if request else ""


def response_of(body: bytes, kind: str) -> Response:
    """Return an answer with a body of the given media type."""
    headers = Headers({"Content-Type": kind, "Content-Length": str(len(body))})
    return Response(HTTPStatus.OK, "OK", headers, body)


def script_response(script: bytes) -> Response:
    """Return a script."""
    return response_of(script, "text/javascript; charset=utf-8")


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
