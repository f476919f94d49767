"""This module has all uses of what viser does not promise to keep, each with its reason.

viser is pinned to one version. With another one, each of these either fails at the start with one
line or has a test (tests/web/test_guard.py, test_clients.py, test_memory.py).

* `serving`: viser has no argument for the checks of a request and for a second kind of websocket,
  so that the function by which it opens its port is replaced while it starts. It could go with a
  parameter for websockets' `process_request` and `create_connection`.
* `scene_page`: viser's document has inline scripts, which a Content-Security-Policy forbids unless
  a nonce marks them; and its own panels have to stay out of sight. It could go with a nonce of
  viser's and an option without panels.
* `wake_on_the_loop`: viser wakes its connections from the thread that sends, which asyncio forbids.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import viser
import websockets.asyncio.server as websockets_server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

Serves = Callable[[ServerConnection], Awaitable[None]]
ProcessRequest = Callable[[ServerConnection, Request], Response | None]
# viser's own function -> the one in its place
ChangeServes = Callable[[Serves], Serves]
ChangeProcess = Callable[[ProcessRequest], ProcessRequest]

PAGE_CHANGES = {  # of viser's page: its loader and the script that this writes have the nonce
    "<script data-p=": '<script nonce="NONCE" data-p=',
    "const d=document.currentScript.dataset;": (
        "const {dataset:d,nonce:pass}=document.currentScript;"
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


@cache
def scene_page(scene_alone: bool) -> str:
    """Return viser's page, in which NONCE stands for the nonce of an answer.

    scene_alone: whether its own panels are hidden.

    Raises:
        RuntimeError: the version of viser is not the pinned one.
    """
    file = Path(viser.__file__).parent / "client/build/index.html"
    page = file.read_text(encoding="utf-8")
    changes = dict(PAGE_CHANGES)
    if scene_alone:
        changes["</head>"] = f"{SCENE_ALONE}</head>"
    for old, new in changes.items():
        if page.count(old) != 1:
            where = f"PAGE_CHANGES in {__file__}"
            raise RuntimeError(f"viser {viser.__version__}: its page has no {old!r}; see {where}")
        page = page.replace(old, new)
    return page


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
