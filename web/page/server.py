"""The page's server: viser's behind a Guard, on this machine alone unless a host is given."""

from __future__ import annotations

import asyncio
import errno
import secrets
import socket
from typing import Any

import rich
import viser

from web.page.guard import ALL_INTERFACES, Guard, host_and_port

LOOPBACK = ("127.0.0.1", "localhost", "::1")
# addresses for documentation, which nobody has: a socket to one shows which interface is used
ELSEWHERE_4 = (socket.AF_INET, "192.0.2.1")
ELSEWHERE_6 = (socket.AF_INET6, "2001:db8::1")


def new_token(host: str) -> str | None:
    """Return a token; None on loopback, which only this machine can reach."""
    return None if host in LOOPBACK else secrets.token_urlsafe(18)


class PageServer(viser.ViserServer):
    """viser's server, with a link to the page's own scripts.

    Args:
        guard: guards it while it starts.
        host, port: address to listen on.
        label: its name on the page.

    Attributes:
        link: takes the messages of the page's own scripts.
    """

    def __init__(self, guard: Guard, host: str, port: int, label: str):
        super().__init__(host=host, port=port, label=label, verbose=False)
        self.link = guard.link


def serve(host: str, port: int, token: str | None, label: str) -> PageServer:
    """Return a running server.

    Args:
        host, port: address to listen on; port 0 is any that is free.
        token: required of every visitor; None: of none.
        label: its name on the page.

    Raises:
        ValueError: the server cannot listen there; the message is one line.
    """
    port = probe(host, port)
    # viser prints banners through rich; stdout is for results
    rich.reconfigure(stderr=True, quiet=True)
    guard = Guard(host, port, token)
    with guard.guarding():
        server = PageServer(guard, host, port, label)
    if server.get_port() != port:
        server.stop()
        raise ValueError(f"port: {port} on {host} was taken in this moment; choose another")
    guard.server = server
    wake_on_the_loop(server)
    return server


def probe(host: str, port: int) -> int:
    """Return the port if it can be listened on, a free one for 0.

    viser itself would hang on a wrong host, and silently use the next port where one is busy.

    Raises:
        ValueError: the port cannot be listened on; the message is one line.
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
    except UnicodeError as error:
        raise ValueError(f"host: cannot listen on {host}:{port}: {error}") from None
    except OSError as error:
        reason = f"cannot listen on {host}:{port}: {(error.strerror or str(error)).lower()}"
        if error.errno in (errno.EADDRINUSE, errno.EACCES):
            advice = "choose another, 0 takes any that is free"
            raise ValueError(f"port: {reason}; {advice}") from None
        raise ValueError(f"host: {reason}") from None


def address(host: str, port: int) -> str:
    """Return the page's address for a browser.

    Where the server listens on all interfaces, it is the one that other machines reach.
    """
    if host in ALL_INTERFACES:
        family, elsewhere = ELSEWHERE_6 if ":" in host else ELSEWHERE_4
        try:
            with socket.socket(family, socket.SOCK_DGRAM) as way:
                way.connect((elsewhere, 9))  # sends nothing
                host = way.getsockname()[0]
        except OSError:  # no network
            host = socket.gethostname()
    return f"http://{host_and_port(host, port)}/"


class LoopEvent(asyncio.Event):
    """An event that is set on its event loop alone.

    viser sets the event of a buffer of messages twice: at once on the thread that sends, and again
    on the loop. An asyncio.Event cannot stand the first: "deque mutated during iteration", where
    the loop adds a waiter meanwhile. Nobody reads it there, and the second follows.
    """

    def set(self) -> None:
        """Set the event; no effect on another thread than the loop's."""
        try:
            asyncio.get_running_loop()
        except RuntimeError:  # another thread
            return
        super().set()


def wake_on_the_loop(server: viser.ViserServer) -> None:
    """Wake those who wait for messages on the event loop alone, before the first one listens."""
    websocket_server = server._websock_server

    def on_connect(connection: Any) -> None:
        connection.get_message_buffer().message_event = LoopEvent()

    websocket_server.get_message_buffer().message_event = LoopEvent()
    websocket_server.on_client_connect(on_connect)


def forget_removed(server: viser.ViserServer) -> None:
    """Let the server forget what was removed, once every open page knows.

    By itself it does so only when another page connects: until then the messages that remove a
    race's charts pile up, race by race. Not forced, it keeps removals that open pages have yet to
    receive; without those they would show the last race's charts and drones for ever.

    The method is private in viser 1.1.1, the version that is pinned. If another one has no such
    method: look at what it runs when a page connects, or drop this call where
    tests/web/test_memory.py holds without it.
    """
    server._run_garbage_collector()
