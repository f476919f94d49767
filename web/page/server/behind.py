"""Behind: the address of the page at a proxy that forwards requests to its server."""

from __future__ import annotations

from typing import NamedTuple
from urllib.parse import urlsplit

from quadsim.files.yaml_errors import cut

USUAL_PORTS = {"https": 443, "http": 80}


class Behind(NamedTuple):
    """The address of the page at a proxy, such as https://lab.example/race/.

    Attributes:
        origin: scheme, name and port, as a browser sends them with its requests.
        host: name and port, which the proxy may forward.
        path: of the page, with a slash at its end.
    """

    origin: str
    host: str
    path: str

    @property
    def address(self) -> str:
        """The address of the page."""
        return self.origin + self.path

    @property
    def is_encrypted(self) -> bool:
        """Whether browsers speak https with the proxy."""
        return self.origin.startswith("https:")


def behind_of(address: str) -> Behind:
    """Return the address of a page at a proxy.

    Raises:
        ValueError: the text is no such address; the message is one line.

    Examples:
        >>> from quadsim.web.page.server.behind import behind_of
        >>> behind_of("https://lab.example/race")
        Behind(origin='https://lab.example', host='lab.example', path='/race/')
    """
    parts = urlsplit(address)
    try:
        port = parts.port
    except ValueError:
        port = -1
    is_plain = not (parts.query or parts.fragment or parts.username or parts.password)
    if parts.scheme not in USUAL_PORTS or not parts.hostname or port == -1 or not is_plain:
        wanted = "expected the page's address at the proxy, such as https://name/path"
        raise ValueError(f"behind: {wanted}, got {cut(repr(address))}")
    name = f"[{parts.hostname}]" if ":" in parts.hostname else parts.hostname
    host = name if port in (None, USUAL_PORTS[parts.scheme]) else f"{name}:{port}"
    return Behind(f"{parts.scheme}://{host}", host, parts.path.rstrip("/") + "/")
