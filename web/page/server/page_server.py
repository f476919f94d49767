"""The page's server: viser's server with a Guard, on this machine only by default."""

from __future__ import annotations

import errno
import re
import secrets
import socket
import warnings
from pathlib import Path

import rich
import viser

from quadsim.web.page.server.behind import Behind
from quadsim.web.page.server.guard import ALL_INTERFACES, Guard, host_and_port
from quadsim.web.page.server.seats import Seats
from quadsim.web.page.server.viser_private import wake_on_the_loop

TOKEN = re.compile(r"[A-Za-z0-9_-]{16,200}")
LOOPBACK = ("127.0.0.1", "localhost", "::1")
# addresses reserved for documentation: a socket to one shows the interface in use
ELSEWHERE_4 = (socket.AF_INET, "192.0.2.1")
ELSEWHERE_6 = (socket.AF_INET6, "2001:db8::1")


def new_token(host: str, behind: Behind | None = None) -> str | None:
    """Return a new token, or None for loopback, which only this machine can reach.

    behind: address at a proxy, which other machines can reach whatever the host is.
    """
    return None if host in LOOPBACK and behind is None else secrets.token_urlsafe(18)


def kept_token(file: Path) -> str:
    """Return the token of a file, so that a page that starts again has the same one.

    A missing file is made, for its owner alone.

    Raises:
        ValueError: the file has no token, or cannot be read or made; the message is one line.
    """
    try:
        if not file.exists():
            file.touch(mode=0o600)
            file.write_text(secrets.token_urlsafe(18) + "\n", encoding="ascii")
        token = file.read_text(encoding="ascii").strip()
    except (OSError, UnicodeError) as error:
        problem = getattr(error, "strerror", "") or "expected a text in ASCII"
        raise ValueError(f"token-file: {file}: {problem.lower()}") from None
    if not TOKEN.fullmatch(token):
        wanted = "expected a token of 16 letters, digits, - and _ at least"
        raise ValueError(f"token-file: {file}: {wanted}")
    return token


class PageServer(viser.ViserServer):
    """viser's server, with a link to the page's own scripts.

    Args:
        guard: guard of the server, active while it starts.
        host, port: address to listen on.
        label: name of the server on the page.

    Attributes:
        link: receiver of the messages of the page's own scripts.
        downloads: the files that wait for visitors.
        seats: relate the two connections of each visitor.
        needs_token: whether a visitor has to know the token.
    """

    def __init__(self, guard: Guard, host: str, port: int, label: str):
        super().__init__(host=host, port=port, label=label, verbose=False)
        self.link = guard.link
        self.downloads = guard.downloads
        self.needs_token = guard.needs_token
        self.seats = Seats(self)


def serve(
    host: str,
    port: int,
    token: str | None,
    label: str,
    has_shell: bool = True,
    behind: Behind | None = None,
) -> PageServer:
    """Return a running server.

    Args:
        host, port: address to listen on; port 0: any free port.
        token: token required of every visitor; None: no token is required.
        label: name of the server on the page.
        has_shell: whether the page's own document holds viser's in a frame; else viser's alone is
            the page.
        behind: address of the page at a proxy; None: browsers reach the server itself.

    Raises:
        ValueError: the server cannot listen there; the message is one line.
    """
    port = probe(host, port)
    # A visitor may leave while its own controls are set.
    warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")
    # viser prints banners through rich; stdout is for results
    rich.reconfigure(stderr=True, quiet=True)
    guard = Guard(host, port, token, has_shell, behind)
    with guard.guarding():
        server = PageServer(guard, host, port, label)
    if server.get_port() != port:
        server.stop()
        raise ValueError(f"port: {port} on {host} was taken in this moment; choose another")
    wake_on_the_loop(server)
    return server


def probe(host: str, port: int) -> int:
    """Return the port if the server can listen on it; for 0 a free port.

    viser itself would hang on a wrong host, and silently use the next port if one is busy.

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

    If the server listens on all interfaces, the address is reachable from other machines.
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
