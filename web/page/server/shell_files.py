"""The page's own document, style sheets and scripts, from the folder `shell`.

Their policy allows scripts and styles of this server alone, and no inline ones.

The document names style sheets and scripts under a path with the hash of all of them, so that a
browser keeps them, and asks for them again only if one has changed. It names all scripts, which a
browser would otherwise find one after another.
"""

from __future__ import annotations

from functools import cache
from hashlib import sha256
from http import HTTPStatus
from pathlib import Path

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

FOLDER = Path(__file__).parent.parent / "shell"
DOCUMENT = "index.html"
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


def document_response(path: str, request: Request) -> Response | None:
    """Return the answer with the page's document; None: the path is of something else."""
    if path not in ("/", f"/{DOCUMENT}"):
        return None
    body = _document()
    tag = f'"{_hash_of([body])}"'
    if request.headers.get("If-None-Match") == tag:
        return Response(HTTPStatus.NOT_MODIFIED, "Not Modified", Headers({"ETag": tag}), b"")
    return _response(DOCUMENT, body, ETag=tag)


def static_response(path: str) -> Response | None:
    """Return the answer with a style sheet or a script; None: there is none at this path."""
    name = path.removeprefix(static_folder())
    body = _files().get(name)
    return None if body is None else _response(name, body)


@cache
def static_folder() -> str:
    """Return the path under which style sheets and scripts are served, with their hash."""
    parts = [part for name, body in sorted(_files().items()) for part in (name.encode(), body)]
    return f"{STATIC}{_hash_of(parts)}/"


def _response(name: str, body: bytes, **headers: str) -> Response:
    """Return the answer with a file."""
    kind = {"Content-Type": TYPES[Path(name).suffix], "Content-Length": str(len(body))}
    return Response(HTTPStatus.OK, "OK", Headers({**headers, **kind}), body)


@cache
def _document() -> bytes:
    """Return the document, which names all style sheets and scripts under their hash."""
    text = (FOLDER / DOCUMENT).read_text(encoding="utf-8")
    scripts = sorted(name for name in _files() if name.endswith(".js"))
    links = "".join(f'<link rel="modulepreload" href="static/{name}" />' for name in scripts)
    text = text.replace("</head>", f"{links}</head>", 1)
    return text.replace('"static/', f'"{static_folder().lstrip("/")}').encode()


@cache
def _files() -> dict[str, bytes]:
    """Return style sheets and scripts by their names."""
    files = [path for path in FOLDER.iterdir() if path.suffix in TYPES and path.name != DOCUMENT]
    return {path.name: path.read_bytes() for path in files}


def _hash_of(parts: list[bytes]) -> str:
    return sha256(b"\0".join(parts)).hexdigest()[:32]
