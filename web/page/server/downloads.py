"""Downloads: files that wait for one visitor, each at an address that nobody can guess."""

from __future__ import annotations

import secrets
import threading
from collections import OrderedDict
from http import HTTPStatus
from urllib.parse import quote

from websockets.datastructures import Headers
from websockets.http11 import Response

from quadsim.web.page.server.link import Message

DOWNLOAD = "/download/"
MOST = 4  # number of files that wait; older ones are forgotten


class Download(Message, tag="download"):
    """A file that waits for its visitor at an address of this server."""

    name: str
    address: str


class Downloads:
    """The files that wait. Any thread may call it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._files: OrderedDict[str, tuple[str, bytes]] = OrderedDict()

    def offer(self, name: str, data: bytes) -> str:
        """Keep a file until it is fetched, and return its address."""
        address = DOWNLOAD + secrets.token_urlsafe(18)
        with self._lock:
            self._files[address] = (name, data)
            while len(self._files) > MOST:
                self._files.popitem(last=False)
        return address

    def kept(self, name: str, data: bytes) -> Download:
        """Keep a file until it is fetched, and return the message that names it."""
        return Download(name, self.offer(name, data))

    def response(self, path: str) -> Response | None:
        """Return the answer for the address of a file, once; None: there is none."""
        with self._lock:
            found = self._files.pop(path, None)
        if found is None:
            return None
        name, data = found
        headers = Headers(
            {
                "Content-Type": "application/octet-stream",
                "Content-Length": str(len(data)),
                "Content-Disposition": f"attachment; filename*=UTF-8''{quote(name)}",
            }
        )
        return Response(HTTPStatus.OK, "OK", headers, data)
