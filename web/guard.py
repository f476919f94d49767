"""The door: a viser server that only those get into who should, and that believes nothing a client says.

Loopback unless told otherwise; anywhere else a token is asked for, once, and becomes a cookie. Host and Origin
are checked, so that no foreign page talks to ours. Of what clients may send, only clicks, hotkeys and values
within a control's own range get through; the share tunnel and uploads are shut.
"""

from __future__ import annotations

import errno
import secrets
import socket
import threading
from collections.abc import Callable
from contextlib import contextmanager
from http import HTTPStatus
from typing import Any
from urllib.parse import parse_qs, urlsplit

import rich
import viser
import websockets.asyncio.server as websockets_server
from viser import _messages as messages
from websockets import Headers
from websockets.http11 import Request, Response

from web.validate_input import validate_input

LOOPBACK = ("127.0.0.1", "localhost", "::1")
EVERYWHERE = ("0.0.0.0", "::")
SHUT = (  # what clients could ask a server for and no control of ours needs
    messages.ShareUrlRequest,
    messages.ShareUrlDisconnect,
    messages.FileTransferStartUpload,
    messages.FileTransferPart,
    messages.GuiFormSubmitMessage,
    messages.GuiFormDirtyMessage,
    messages.GuiButtonHoldMessage,
)
_patching = threading.Lock()


def new_token(host: str) -> str | None:
    """None on loopback, where whoever can connect is already on this machine."""
    return None if host in LOOPBACK else secrets.token_urlsafe(18)


def serve(host: str, port: int, token: str | None, label: str) -> viser.ViserServer:
    """A running server. Raises ValueError with one line for a host or port that cannot be used."""
    port = probe(host, port)
    rich.reconfigure(stderr=True, quiet=True)  # viser prints banners through it; stdout is for results
    with _patching, _asking(check_of(host, port, token), origins_of(host, port)):
        server = viser.ViserServer(host=host, port=port, label=label, verbose=False)
    if server.get_port() != port:
        server.stop()
        raise ValueError(f"port: {port} on {host} was taken in this moment; choose another")
    _shut(server)
    return server


def probe(host: str, port: int) -> int:
    """The port if it can be listened on, a free one for 0. viser would hang on a wrong host and move on from a busy
    port without a word."""
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
        reason = getattr(error, "strerror", None) or str(error)
        at = "port" if getattr(error, "errno", None) in (errno.EADDRINUSE, errno.EACCES) else "host"
        raise ValueError(f"{at}: cannot listen on {host}:{port}: {reason.lower()}") from None


def hosts_of(host: str, port: int) -> set[str] | None:
    """What a request's Host may say; None: anything, where the server is reached by names it does not know."""
    names = {host, "127.0.0.1", "localhost", "::1"}
    return None if host in EVERYWHERE else {f"[{n}]:{port}" if ":" in n else f"{n}:{port}" for n in names}


def origins_of(host: str, port: int) -> list[Any] | None:
    """Pages that may open the websocket; None for programs, which send no Origin and no cookies of a browser."""
    hosts = hosts_of(host, port)
    return None if hosts is None else [None, *(f"http://{name}" for name in sorted(hosts))]


def check_of(host: str, port: int, token: str | None) -> Callable[[Request], Response | None]:
    """A function that lets a request pass (None) or answers it."""
    hosts, cookie = hosts_of(host, port), f"race{port}"

    def check(request: Request) -> Response | None:
        said, origin = request.headers.get("Host", ""), request.headers.get("Origin")
        if hosts is not None and said not in hosts:
            return _answer(HTTPStatus.FORBIDDEN, "this server does not go by that name")
        if origin is not None and origin != f"http://{said}":
            return _answer(HTTPStatus.FORBIDDEN, "this page may not talk to the server")
        if token is None or _same(_cookie(request, cookie), token):
            return None
        if _same(_asked(request), token):
            kept = f"{cookie}={token}; HttpOnly; SameSite=Strict; Path=/"
            return _answer(HTTPStatus.SEE_OTHER, "", {"Location": "/", "Set-Cookie": kept})
        return _answer(HTTPStatus.UNAUTHORIZED, "open the address with ?token=... that `race web` printed")

    return check


def _asked(request: Request) -> str:
    return parse_qs(urlsplit(request.path).query).get("token", [""])[0]


def _cookie(request: Request, name: str) -> str:
    pairs = (part.strip().partition("=") for part in request.headers.get("Cookie", "").split(";"))
    return next((value for key, _, value in pairs if key == name), "")


def _same(a: str, b: str) -> bool:
    return secrets.compare_digest(a.encode(), b.encode())


def _answer(status: HTTPStatus, text: str, headers: dict[str, str] | None = None) -> Response:
    body = f"{text}\n".encode() if text else b""
    fields = Headers({"Content-Length": str(len(body)), "Content-Type": "text/plain", **(headers or {})})
    return Response(status, status.phrase, fields, body)


@contextmanager
def _asking(check: Callable, origins: list | None):
    """While a server starts: websockets' own serve, with our check before every request."""
    original = websockets_server.serve

    def guarded(*args: Any, process_request: Any = None, **kwargs: Any) -> Any:
        def process(connection: Any, request: Request) -> Any:
            return check(request) or (process_request(connection, request) if process_request else None)

        return original(*args, process_request=process, origins=origins, **kwargs)

    websockets_server.serve = guarded  # type: ignore[misc,assignment]
    try:
        yield
    finally:
        websockets_server.serve = original  # type: ignore[misc]


def _shut(server: viser.ViserServer) -> None:
    """Drop what no control needs; let values through only where they make sense."""
    handlers = server._websock_server._incoming_handlers
    for kind in SHUT:
        handlers.pop(kind, None)
    server.request_share_url = lambda *_, **__: None  # type: ignore[method-assign]
    update: Any = handlers[messages.GuiUpdateMessage][0]

    async def checked(client_id: Any, message: Any) -> None:
        handle = server.gui._gui_input_handle_from_uuid.get(message.uuid)
        if handle is not None and validate_input(handle, message.updates):
            await update(client_id, message)

    handlers[messages.GuiUpdateMessage] = [checked]
