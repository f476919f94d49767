"""The page's own document, style sheets and scripts, from the folder `shell`.

Their policy allows scripts and styles of this server alone, and no inline ones.
"""

from __future__ import annotations

from functools import cache
from hashlib import sha256
from http import HTTPStatus
from pathlib import Path

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

FOLDER = Path(__file__).parent.parent / "shell"
STATIC = "/static/"
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
}
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self' data:; frame-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)


def own_response(path: str, request: Request) -> Response | None:
    """Return the answer for a path of the page's own; None: it has no such file."""
    name = "index.html" if path in ("/", "/index.html") else path.removeprefix(STATIC)
    body = _files().get(name)
    if body is None or (name == "index.html") == path.startswith(STATIC):
        return None
    tag = f'"{sha256(body).hexdigest()[:32]}"'
    headers = Headers({"ETag": tag})
    if request.headers.get("If-None-Match") == tag:
        return Response(HTTPStatus.NOT_MODIFIED, "Not Modified", headers, b"")
    headers["Content-Type"] = TYPES[Path(name).suffix]
    headers["Content-Length"] = str(len(body))
    return Response(HTTPStatus.OK, "OK", headers, body)


@cache
def _files() -> dict[str, bytes]:
    """Return the files by their names."""
    return {path.name: path.read_bytes() for path in FOLDER.iterdir() if path.suffix in TYPES}
