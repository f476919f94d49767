"""Access control: a viser server with a token, checks of Host and Origin, and a page that talks to
this server alone.

It listens on loopback by default. On any other address a token is required: given once in the URL,
it is kept in a cookie. Host and Origin are checked, so that pages of other sites cannot reach the
server through a browser. The page comes with a Content-Security-Policy: its own scripts, known by a
nonce, its own server, no frame around it. What visitors may send is in web.page.messages.
"""

from __future__ import annotations

import errno
import secrets
import socket
import threading
from collections.abc import Callable
from contextlib import contextmanager
from functools import cache
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, urlencode, urlsplit

import rich
import viser
import websockets.asyncio.server as websockets_server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from web.page.messages import LOG, VISITOR, cookie_of, restrict_messages

LOOPBACK = ("127.0.0.1", "localhost", "::1")
ALL_INTERFACES = ("0.0.0.0", "::")
REDIRECTIONS = ("websocket", "playbackPath")  # of viser's page: to another server, to a recording
POLICY = (
    "default-src 'none'; script-src 'self' 'nonce-{nonce}' 'wasm-unsafe-eval'; worker-src blob:; "
    "connect-src 'self' data:; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; font-src 'self' data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
OURS = Path(__file__).with_name("page.js")
PAGE_CHANGES = {  # of viser's page
    "<title>Viser</title>": "<title>race</title>",
    "<script data-p=": '<script nonce="NONCE" data-p=',
    "const d=document.currentScript.dataset;": "const {dataset:d,nonce:pass}=document.currentScript;",
    'e.type="module";': 'e.type="module";e.nonce=pass;',
    "</head>": f'<script nonce="NONCE">{OURS.read_text(encoding="utf-8")}</script></head>',
}
# None: the request may pass; or what ends it
Check = Callable[[ServerConnection, Request], Response | None]
_patching = threading.Lock()


def new_token(host: str) -> str | None:
    """None on loopback, which only this machine can reach."""
    return None if host in LOOPBACK else secrets.token_urlsafe(18)


def address(host: str, port: int) -> str:
    """The page's, for a browser; where the server listens on all interfaces, the one that other
    machines reach."""
    if host in ALL_INTERFACES:
        family, elsewhere = (
            (socket.AF_INET6, "2001:db8::1") if ":" in host else (socket.AF_INET, "192.0.2.1")
        )
        try:
            with socket.socket(family, socket.SOCK_DGRAM) as way:  # connecting it sends nothing
                way.connect((elsewhere, 9))
                host = way.getsockname()[0]
        except OSError:  # no network
            host = socket.gethostname()
    return f"http://[{host}]:{port}/" if ":" in host else f"http://{host}:{port}/"


def serve(host: str, port: int, token: str | None, label: str) -> viser.ViserServer:
    """A running server. Raises ValueError with one line for a host or port that cannot be used."""
    port = probe(host, port)
    # viser prints banners through it; stdout is for results
    rich.reconfigure(stderr=True, quiet=True)
    with _patching, _checked_requests(request_check(host, port, token), f"{VISITOR}{port}"):
        server = viser.ViserServer(host=host, port=port, label=label, verbose=False)
    if server.get_port() != port:
        server.stop()
        raise ValueError(f"port: {port} on {host} was taken in this moment; choose another")
    restrict_messages(server)
    return server


def probe(host: str, port: int) -> int:
    """The port if it can be listened on, a free one for 0. viser itself would hang on a wrong host
    and silently use the next port where one is busy.
    """
    if not 0 <= port <= 65535:
        raise ValueError(f"port: expected 0 to 65535, got {port}")
    try:
        family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
            probe.listen()
            return probe.getsockname()[1]
    except (OSError, UnicodeError) as error:
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        if getattr(error, "errno", None) not in (errno.EADDRINUSE, errno.EACCES):
            raise ValueError(f"host: cannot listen on {host}:{port}: {reason}") from None
        advice = "choose another, 0 takes any that is free"
        raise ValueError(f"port: cannot listen on {host}:{port}: {reason}; {advice}") from None


def request_check(host: str, port: int, token: str | None) -> Check:
    """Passes requests whose Host is this server, whose Origin, which browsers send, is its own
    page, and whose cookie holds the token. Any Host passes where the server listens on addresses it
    cannot know.
    """
    names = {host, "127.0.0.1", "localhost", "::1"}
    hosts = {f"[{n}]:{port}" if ":" in n else f"{n}:{port}" for n in names}
    cookie = f"race{port}"

    def check(connection: ServerConnection, request: Request) -> Response | None:
        if not all(value.isascii() for _, value in request.headers.raw_items()) or any(
            len(request.headers.get_all(name)) > 1 for name in ("Host", "Origin", "Cookie")
        ):
            return connection.respond(
                HTTPStatus.BAD_REQUEST, "expected ASCII headers, and each of them once\n"
            )
        asked, origin = request.headers.get("Host", ""), request.headers.get("Origin")
        if host not in ALL_INTERFACES and asked not in hosts:
            return connection.respond(HTTPStatus.FORBIDDEN, "this server does not have that name\n")
        if origin is not None and origin != f"http://{asked}":
            return connection.respond(
                HTTPStatus.FORBIDDEN, "pages of another origin may not use this server\n"
            )
        asks = parse_qsl(urlsplit(request.path).query, keep_blank_values=True)
        if token is None or _equal(cookie_of(request, cookie), token):
            return _without_redirection(connection, asks)
        if not _equal(dict(asks).get("token", ""), token):
            advice = "open the address with ?token=... that `race web` printed\n"
            return connection.respond(HTTPStatus.UNAUTHORIZED, advice)
        response = connection.respond(HTTPStatus.SEE_OTHER, "")
        response.headers["Location"] = "/"
        response.headers["Set-Cookie"] = f"{cookie}={token}; HttpOnly; SameSite=Strict; Path=/"
        return response

    return check


def _without_redirection(
    connection: ServerConnection, asks: list[tuple[str, str]]
) -> Response | None:
    """None, or the way to the same address without what would make the page play or obey something
    else."""
    kept = [(name, value) for name, value in asks if name not in REDIRECTIONS]
    if len(kept) == len(asks):
        return None
    response = connection.respond(HTTPStatus.SEE_OTHER, "")
    response.headers["Location"] = f"/?{urlencode(kept)}"
    return response


def protected(response: Response, nonce: str) -> Response:
    """With the headers that keep a browser from other scripts, servers and frames than this page's
    own."""
    response.headers["Content-Security-Policy"] = POLICY.format(nonce=nonce)
    response.headers["X-Frame-Options"] = "DENY"
    response.headers["X-Content-Type-Options"] = "nosniff"
    response.headers["Referrer-Policy"] = "no-referrer"  # an address may hold the token
    response.headers["Cache-Control"] = "no-store"
    return response


def page_response(nonce: str) -> Response:
    """viser's page under our title; its loader, and the script that this writes into the page, have
    the nonce."""
    body = _viser_page().replace("NONCE", nonce).encode()
    headers = Headers(
        {"Content-Type": "text/html; charset=utf-8", "Content-Length": str(len(body))}
    )
    return Response(HTTPStatus.OK, "OK", headers, body)


@cache
def _viser_page() -> str:
    """Raises RuntimeError for another version of viser than the one that is pinned."""
    page = (Path(viser.__file__).parent / "client/build/index.html").read_text(encoding="utf-8")
    for old, new in PAGE_CHANGES.items():
        if page.count(old) != 1:
            raise RuntimeError(
                f"viser {viser.__version__}: its page has no {old!r}; see PAGE_CHANGES in {__file__}"
            )
        page = page.replace(old, new)
    return page


def _equal(a: str, b: str) -> bool:
    """In constant time."""
    return secrets.compare_digest(a.encode(), b.encode())


@contextmanager
def _checked_requests(check: Check, visitor: str):
    """A server that starts meanwhile runs the check before every request: viser has no argument for
    that.

    visitor: name of the cookie by which a browser is known again.
    """
    original = websockets_server.serve

    def checked(*args: Any, process_request: Callable, **kwargs: Any) -> Any:
        def process(connection: ServerConnection, request: Request) -> Response | None:
            response = check(connection, request)
            if response is None and request.headers.get("Upgrade") == "websocket":
                return process_request(connection, request)
            nonce = secrets.token_urlsafe(18)
            is_page = urlsplit(request.path).path in ("/", "/index.html")
            if response is None and is_page:
                response = page_response(nonce)
                if not cookie_of(request, visitor):
                    response.headers["Set-Cookie"] = (
                        f"{visitor}={nonce}; HttpOnly; SameSite=Strict; Path=/"
                    )
            response = response or process_request(connection, request)
            return protected(response, nonce) if response else None

        return original(*args, process_request=process, logger=LOG, **kwargs)

    websockets_server.serve = checked  # type: ignore[misc,assignment]
    try:
        yield
    finally:
        websockets_server.serve = original  # type: ignore[misc]
