"""Messages that a browser may send to the page, over a real connection.

None of them may end the server or its connection, set a control to a value that a person could not
set, or write more than one line. A message that is too large ends its own connection alone.
"""

from __future__ import annotations

import random
import sys
import time
from functools import partial
from typing import Any

import msgspec

from quadsim.web.page.server import serve
from tests.fuzz.harness import Case
from tests.web.wire import CAMERA, connect

TYPES = ("ViewerCameraMessage", "GuiUpdateMessage", "CommandTriggerMessage")
TYPES = (*TYPES, "GetRenderResponseMessage", "ShareUrlRequest", "FileTransferStartUpload", "x", "")
NUMBERS = (0, -1, 1, 2**31, 2**63, 2**64 - 1, 0.5, -0.0, 1e308, float("nan"), float("inf"))
VALUES = (
    *NUMBERS,
    None,
    True,
    False,
    "",
    "x",
    "b",
    "a\nb\x1b[31m",
    "x" * 10**4,
    b"\0",
    [],
    {},
    [1],
)
NAMES = ("value", "visible", "disabled", "options", "label", "_x", "__class__", "")


def page_messages(rng: random.Random) -> Case:
    """Return a case with some messages of one visitor."""
    seed = rng.random()
    call = partial(visit, random.Random(seed))
    label = f"messages of the seed {seed}"
    return Case("page_messages", label, (), call=call, codes=frozenset({0}))


def visit(rng: random.Random) -> int:
    """Send messages, then a good one, which has to be followed. Return the exit code."""
    server = serve("127.0.0.1", 0, None, "race")
    slider = server.gui.add_slider("slider", min=0.0, max=1.0, step=0.1, initial_value=0.5)
    choice = server.gui.add_dropdown("choice", ("a", "b"), initial_value="a")
    tick = server.gui.add_checkbox("tick", initial_value=False)
    text = server.gui.add_text("text", initial_value="t")
    number = server.gui.add_number("number", initial_value=3, min=0, max=9)
    button = server.gui.add_button("button")
    shut = server.gui.add_slider(
        "shut", min=0.0, max=1.0, step=0.1, initial_value=0.5, disabled=True
    )
    uuids = [control._impl.uuid for control in (slider, choice, tick, text, number, button, shut)]

    problem = ""
    with connect(server.get_port()) as client:
        for _ in range(rng.randint(1, 30)):
            client.socket.send(_message(rng, uuids))
        wanted = rng.choice((0.1, 0.9))
        client.set(slider, wanted)
        end = time.monotonic() + 20
        while slider.value != wanted:
            if time.monotonic() > end:
                problem = "a good message was not followed"
                break
            time.sleep(0.01)
    values = (slider.value, choice.value, tick.value, text.value, number.value, shut.value)
    kept = (
        0 <= slider.value <= 1
        and choice.value in ("a", "b")
        and isinstance(tick.value, bool)
        and isinstance(text.value, str)
        and len(text.value) <= 200
        and 0 <= number.value <= 9
        and shut.value == 0.5
    )
    server.stop()
    if problem or not kept:
        print(f"{problem}: {values!r}", file=sys.stderr)
        return 1
    return 0


def _message(rng: random.Random, uuids: list[str]) -> bytes | str:
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
            updates: Any = {rng.choice(NAMES): rng.choice(VALUES)}
            if rng.random() < 0.6:
                updates = {"value": rng.choice(VALUES)}
            message = {
                "type": rng.choice(TYPES) if rng.random() < 0.3 else "GuiUpdateMessage",
                "uuid": rng.choice((*uuids, "x", "", 3, None)),
                "updates": rng.choice((updates, updates, updates, rng.choice(VALUES))),
            }
            if rng.random() < 0.2:
                message[rng.choice(("more", "payload", "render_uuid"))] = rng.choice(VALUES)
            return msgspec.msgpack.encode(message)
