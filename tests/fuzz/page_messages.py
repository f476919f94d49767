"""Messages that a browser may send to the page, over real connections: the scene's and the link.

None of them may end the server or its connection, change what START flies to what a person could
not choose, or write more than one line. A message that is too large ends its own connection alone.
"""

from __future__ import annotations

import json
import random
import sys
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from typing import Any

import msgspec

from quadsim.web.page.dashboard import Dashboard
from quadsim.web.page.server.page_server import serve
from quadsim.web.race.session import Session
from quadsim.web.state.choices import Choices
from quadsim.web.state.menu import Menu
from tests.fuzz.harness import Case
from tests.web.wire import CAMERA, connect, link

MENU = Menu(("figure8",), ("swift",), ("race",), ("colored", "gaussian"))
TYPES = ("ViewerCameraMessage", "GuiUpdateMessage", "CommandTriggerMessage")
TYPES = (*TYPES, "GetRenderResponseMessage", "ShareUrlRequest", "FileTransferStartUpload", "x", "")
NUMBERS = (0, -1, 1, 2**31, 2**63, 2**64 - 1, 0.5, -0.0, 1e308, float("nan"), float("inf"))
VALUES = (*NUMBERS, None, True, False, "", "x", "b", "a\nb\x1b[31m", "x" * 10**4, [], {}, [1])
FORMS = (
    "race",
    "competitors",
    "numbers",
    "in_flight",
    "view",
    "editor",
    "export",
    "x",
    "",
    3,
    None,
)
FIELDS = ("course", "seed", "laps", "temperature", "sampler", "horizon", "of", "ghosts", "item")
FIELDS = (*FIELDS, "add", "reset", "new", "done", "save", "link", "undo", "x", "__class__", "")

# A message to the scene, and one over the link
Messages = tuple[bytes | str, bytes | str]


def page_messages(rng: random.Random) -> Case:
    """Return a case with some messages of one visitor."""
    messages = [(_message(rng), _link_message(rng)) for _ in range(rng.randint(1, 30))]
    wanted = rng.choice((0.125, 0.875))
    call = partial(visit, messages, wanted)
    return Case("page_messages", f"{messages!r}, {wanted}", (), call=call, codes=frozenset({0}))


def visit(messages: Sequence[Messages], wanted: float) -> int:
    """Send messages, then a good one, which has to be followed. Return the exit code."""
    with tempfile.TemporaryDirectory() as root:
        server = serve("127.0.0.1", 0, None, "race")
        session = Session(root)
        page = Dashboard(server, session, MENU, Choices(course="figure8"))
        try:
            problem = _problem(messages, wanted, server.get_port(), page)
        finally:
            page.close()
            session.close()
            server.stop()
    if problem:
        print(problem, file=sys.stderr)
    return 1 if problem else 0


def _problem(messages: Sequence[Messages], wanted: float, port: int, page: Dashboard) -> str:
    """Send messages, and then `wanted` as a temperature; return what went wrong, or ""."""
    with connect(port) as client, link(port) as linked:
        for of_scene, of_link in messages:
            client.socket.send(of_scene)
            linked.socket.send(of_link)
        if linked.set("competitors", "temperature", wanted):
            return "a good message was not followed"
        end = time.monotonic() + 20
        while not client.socket.ping().wait(1):
            if time.monotonic() > end:
                return "the scene does not answer any more"
    for row in page.desk.state.rows:
        # What cannot be flown is refused: this raises nothing.
        row.choices.planners()
    menu = page.desk.state.menu
    if menu is None or page.desk.state.race.course not in menu.courses:
        return f"the course is {page.desk.state.race.course!r}"
    return ""


def _link_message(rng: random.Random) -> bytes | str:
    """Return one message over the link: of a known form with wrong values, or of random bytes."""
    if rng.random() < 0.2:
        return rng.choice((rng.randbytes(20), "", "x", "[" * 2000, '{"type": "set_field"}'))
    message: dict[str, Any] = {
        "type": rng.choice(("set_field", "press", "edit_row", "ask", "camera", "take", "x")),
        "form": rng.choice(FORMS),
        "field": rng.choice(FIELDS),
        "of": rng.choice((0, 1, 2, -1, 2**40, None)),
    }
    if message["type"] == "set_field":
        message["value"] = rng.choice(VALUES)
    if message["type"] == "edit_row":
        message = {"type": "edit_row", "row": rng.choice(VALUES)}
    return json.dumps(message)


def _message(rng: random.Random) -> bytes | str:
    """Return one message: of a known form with wrong values, deep, cut, or of random bytes."""
    match rng.randrange(8):
        case 0:
            return rng.randbytes(rng.choice((0, 1, 10, 1000)))
        case 1:
            return rng.choice(("", "x", '{"type": "GuiUpdateMessage"}', "\0"))
        case 2:
            return b"\x91" * rng.choice((10, 2000, 10**5)) + b"\xc0"  # lists in lists
        case 3:
            return b"\x81\xa1a" * rng.choice((10, 10**5)) + b"\xc0"  # maps in maps
        case 4:
            camera: dict[str, Any] = {**CAMERA, rng.choice(list(CAMERA)): rng.choice(VALUES)}
            if rng.random() < 0.5:
                camera["position"] = [rng.choice(NUMBERS) for _ in range(rng.choice((2, 3, 4)))]
            return msgspec.msgpack.encode(camera)
        case 5:
            data = msgspec.msgpack.encode(CAMERA)
            return data[: rng.randrange(len(data))] + rng.randbytes(rng.choice((0, 3)))
        case _:
            updates: Any = {"value": rng.choice(VALUES)}
            message = {
                "type": rng.choice(TYPES) if rng.random() < 0.3 else "GuiUpdateMessage",
                "uuid": rng.choice(("x", "", 3, None)),
                "updates": rng.choice((updates, updates, updates, rng.choice(VALUES))),
            }
            if rng.random() < 0.2:
                message[rng.choice(("more", "payload", "render_uuid"))] = rng.choice(VALUES)
            return msgspec.msgpack.encode(message)
