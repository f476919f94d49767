"""This module has all uses of what viser does not promise to keep, each with its reason.

viser is pinned to one version. With another one, each of these either fails at the start with one
line or has a test (tests/web/test_guard.py, test_clients.py, test_memory.py).

* `serving`: viser has no argument for the checks of a request and for a second kind of websocket,
  so that the function by which it opens its port is replaced while it starts. It could go with a
  parameter for websockets' `process_request` and `create_connection`.
* `scene_page`: viser's document has one inline script with all of its client, which a
  Content-Security-Policy forbids unless a nonce marks it, and which no browser keeps, as the nonce
  is new each time. It becomes a file that is named by its hash. viser's own panels have to stay out
  of sight. It could go with a script of viser's in a file and an option without panels.
* `wake_on_the_loop`: viser wakes its connections from the thread that sends, which asyncio forbids.
"""

from __future__ import annotations

import asyncio
import json
import re
import threading
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import viser
import websockets.asyncio.server as websockets_server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

Serves = Callable[[ServerConnection], Awaitable[None]]
ProcessRequest = Callable[[ServerConnection, Request], Response | None]
# viser's own function -> the one in its place
ChangeServes = Callable[[Serves], Serves]
ChangeProcess = Callable[[ProcessRequest], ProcessRequest]

# viser's inline script: the packed client in attributes, and the loader that unpacks it
LOADER = re.compile(r"<script (data-p=[^>]*)>(.*?)</script>", re.DOTALL)
ATTRIBUTE = re.compile(r'data-(\w+)="([^"]*)"')
LOADER_CHANGES = {  # as a file: the attributes are a constant, the client's script has the nonce
    "const d=document.currentScript.dataset;": (
        "const pass=document.currentScript.nonce;const d=DATA;"
    ),
    'e.type="module";': 'e.type="module";e.nonce=pass;',
}
# The scene alone is seen. What is hidden gets no clicks and no focus. The ground is dark while the
# scene loads, too.
SCENE_ALONE = (
    "<style>html{background:#141517}body{visibility:hidden}canvas{visibility:visible}</style>"
)
_patching = threading.Lock()


@contextmanager
def serving(
    change_serves: ChangeServes, change_process: ChangeProcess, **keywords: Any
) -> Iterator[None]:
    """Give the viser server that starts in this context other functions to serve by.

    Args:
        change_serves: makes the function that serves a connection.
        change_process: makes the function that answers a request.
        keywords: further arguments of websockets' `serve`.
    """
    original = websockets_server.serve

    def serve(
        viser_serves: Serves, *arguments: Any, process_request: ProcessRequest, **given: Any
    ) -> Any:
        process = change_process(process_request)
        ours = {**given, **keywords, "process_request": process}
        return original(change_serves(viser_serves), *arguments, **ours)

    with _patching:
        websockets_server.serve = serve  # type: ignore[misc,assignment]
        try:
            yield
        finally:
            websockets_server.serve = original  # type: ignore[misc]


class ScenePage(NamedTuple):
    """viser's page in two files.

    Attributes:
        document: in which NONCE stands for the nonce of an answer, SCRIPT for the script's address.
        script: the client, which is the same for all.
        name: of the script's file, with the hash of its content.
    """

    document: str
    script: bytes
    name: str


@cache
def scene_page(scene_alone: bool) -> ScenePage:
    """Return viser's page.

    scene_alone: whether its own panels are hidden.

    Raises:
        RuntimeError: the version of viser is not the pinned one.
    """
    file = Path(viser.__file__).parent / "client/build/index.html"
    page = file.read_text(encoding="utf-8")
    loaders = LOADER.findall(page)
    if len(loaders) != 1:
        raise _other_viser("one script with data-p")
    attributes, script = loaders[0]
    for old, new in LOADER_CHANGES.items():
        if script.count(old) != 1:
            raise _other_viser(repr(old))
        script = script.replace(old, new)
    script = script.replace("DATA", json.dumps(dict(ATTRIBUTE.findall(attributes))), 1)
    document = LOADER.sub('<script nonce="NONCE" src="SCRIPT"></script>', page)
    if scene_alone:
        document = document.replace("</head>", f"{SCENE_ALONE}</head>", 1)
    name = f"scene-{sha256(script.encode()).hexdigest()[:32]}.js"
    return ScenePage(document, script.encode(), name)


def _other_viser(lacks: str) -> RuntimeError:
    return RuntimeError(f"viser {viser.__version__}: its page has not {lacks}; see {__file__}")


class LoopEvent(asyncio.Event):
    """An event that can be set only on its own event loop.

    viser sets the event of a buffer of messages twice: at once on the sending thread, and again on
    the loop. The first call is not safe for an asyncio.Event: it raises "deque mutated during
    iteration" if the loop adds a waiter meanwhile. It can be dropped, as the second call follows.
    """

    def set(self) -> None:
        """Set the event; no effect outside the loop's thread."""
        try:
            asyncio.get_running_loop()
        except RuntimeError:  # another thread
            return
        super().set()


def wake_on_the_loop(server: viser.ViserServer) -> None:
    """Make viser wake waiting pages only on the event loop; call it before the first page."""
    websocket_server = server._websock_server

    def on_connect(connection: Any) -> None:
        connection.get_message_buffer().message_event = LoopEvent()

    websocket_server.get_message_buffer().message_event = LoopEvent()
    websocket_server.on_client_connect(on_connect)
