"""Access control: a viser server with a token, checks of Host and Origin, and validated messages.

It listens on loopback by default. On any other address a token is required: given once in the URL, it is kept in a
cookie. Host and Origin are checked, so that pages of other sites cannot reach the server through a browser. Of the
messages that clients may send, only clicks, hotkeys and values within a control's own range are accepted; the share
tunnel and uploads are switched off.
"""

from __future__ import annotations

import errno
import secrets
import socket
import threading
from collections.abc import Callable
from contextlib import contextmanager
from http import HTTPStatus
from math import isfinite
from typing import Any
from urllib.parse import parse_qs, urlsplit

import rich
import viser
import websockets.asyncio.server as websockets_server
from viser import _messages as messages
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

LOOPBACK = ("127.0.0.1", "localhost", "::1")
ALL_INTERFACES = ("0.0.0.0", "::")
LONGEST_TEXT = 200  # characters
UNUSED_MESSAGES = (  # that viser's server handles and no control of the page sends
    messages.ShareUrlRequest,
    messages.ShareUrlDisconnect,
    messages.FileTransferStartUpload,
    messages.FileTransferPart,
    messages.GuiFormSubmitMessage,
    messages.GuiFormDirtyMessage,
    messages.GuiButtonHoldMessage,
)
Check = Callable[[ServerConnection, Request], Response | None]  # None: the request may pass; or what ends it
_patching = threading.Lock()


def new_token(host: str) -> str | None:
    """None on loopback, which only this machine can reach."""
    return None if host in LOOPBACK else secrets.token_urlsafe(18)


def serve(host: str, port: int, token: str | None, label: str) -> viser.ViserServer:
    """A running server. Raises ValueError with one line for a host or port that cannot be used."""
    port = probe(host, port)
    rich.reconfigure(stderr=True, quiet=True)  # viser prints banners through it; stdout is for results
    with _patching, _checked_requests(request_check(host, port, token)):
        server = viser.ViserServer(host=host, port=port, label=label, verbose=False)
    if server.get_port() != port:
        server.stop()
        raise ValueError(f"port: {port} on {host} was taken in this moment; choose another")
    _restrict_messages(server)
    return server


def probe(host: str, port: int) -> int:
    """The port if it can be listened on, a free one for 0. viser itself would hang on a wrong host and silently use
    the next port where one is busy.
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
        reason = getattr(error, "strerror", None) or str(error)
        at = "port" if getattr(error, "errno", None) in (errno.EADDRINUSE, errno.EACCES) else "host"
        raise ValueError(f"{at}: cannot listen on {host}:{port}: {reason.lower()}") from None


def request_check(host: str, port: int, token: str | None) -> Check:
    """Passes requests whose Host is this server, whose Origin, which browsers send, is its own page, and whose cookie
    holds the token. Any Host passes where the server listens on addresses it cannot know.
    """
    names = {host, "127.0.0.1", "localhost", "::1"}
    hosts = {f"[{n}]:{port}" if ":" in n else f"{n}:{port}" for n in names}
    cookie = f"race{port}"

    def check(connection: ServerConnection, request: Request) -> Response | None:
        asked, origin = request.headers.get("Host", ""), request.headers.get("Origin")
        if host not in ALL_INTERFACES and asked not in hosts:
            return connection.respond(HTTPStatus.FORBIDDEN, "this server does not have that name\n")
        if origin is not None and origin != f"http://{asked}":
            return connection.respond(HTTPStatus.FORBIDDEN, "pages of another origin may not use this server\n")
        if token is None or _equal(_cookie(request, cookie), token):
            return None
        if not _equal(parse_qs(urlsplit(request.path).query).get("token", [""])[0], token):
            advice = "open the address with ?token=... that `race web` printed\n"
            return connection.respond(HTTPStatus.UNAUTHORIZED, advice)
        response = connection.respond(HTTPStatus.SEE_OTHER, "")
        response.headers["Location"] = "/"
        response.headers["Set-Cookie"] = f"{cookie}={token}; HttpOnly; SameSite=Strict; Path=/"
        return response

    return check


def _cookie(request: Request, name: str) -> str:
    pairs = (part.strip().partition("=") for part in request.headers.get("Cookie", "").split(";"))
    return next((value for key, _, value in pairs if key == name), "")


def _equal(a: str, b: str) -> bool:
    """In constant time."""
    return secrets.compare_digest(a.encode(), b.encode())


@contextmanager
def _checked_requests(check: Check):
    """A server that starts meanwhile runs the check before every request: viser has no argument for that."""
    original = websockets_server.serve

    def checked(*args: Any, process_request: Callable, **kwargs: Any) -> Any:
        def process(connection: ServerConnection, request: Request) -> Any:
            return check(connection, request) or process_request(connection, request)

        return original(*args, process_request=process, **kwargs)

    websockets_server.serve = checked  # type: ignore[misc,assignment]
    try:
        yield
    finally:
        websockets_server.serve = original  # type: ignore[misc]


def _restrict_messages(server: viser.ViserServer) -> None:
    handlers = server._websock_server._incoming_handlers
    for kind in UNUSED_MESSAGES:
        handlers.pop(kind, None)
    server.request_share_url = lambda *_, **__: None  # type: ignore[method-assign]
    update: Any = handlers[messages.GuiUpdateMessage][0]

    async def checked(client_id: Any, message: Any) -> None:
        handle = server.gui._gui_input_handle_from_uuid.get(message.uuid)
        if handle is not None and validate_input(handle, message.updates):
            await update(client_id, message)

    handlers[messages.GuiUpdateMessage] = [checked]


def validate_input(handle: Any, updates: Any) -> bool:
    """Whether the control itself could have sent this: only its value, of its type and within its range. viser itself
    would set any attribute.
    """
    if not isinstance(updates, dict) or set(updates) != {"value"}:
        return False
    value, props, held = updates["value"], handle._impl.props, handle._impl.value
    if getattr(props, "disabled", False) or not props.visible:
        return False
    if hasattr(props, "options"):
        return isinstance(value, str) and value in props.options
    if isinstance(held, bool):
        return isinstance(value, bool)
    if not isinstance(held, int | float):
        return isinstance(value, str) and len(value) <= LONGEST_TEXT
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        return False
    low, high = getattr(props, "min", None), getattr(props, "max", None)
    return (low is None or value >= low) and (high is None or value <= high)
