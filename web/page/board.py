"""Board: the parts of the page around the scene, which pages fetch as they change.

A page asks with the versions of the parts that it has, and gets those that have changed since. So a
slow or a new page gets the present state at its own pace, and the server keeps nothing for it.
"""

from __future__ import annotations

from itertools import count
from math import inf
from time import perf_counter
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from quadsim.web.page.camera import Camera
from quadsim.web.page.link import LinkVisitor, Message
from quadsim.web.page.seats import Seat, Seats
from quadsim.web.page.server import PageServer

PartName = Literal[
    "head", "now", "tower", "time_line", "map", "laps", "events", "planner", "chatter", "seeds"
]


WANTED = 2.0  # time after a question for which the part of its tab is kept up to date [s]


class Ask(Message, tag="ask"):
    """A request of a page for the parts that have changed since the versions it has."""

    have: dict[PartName, Annotated[int, Meta(ge=0, le=10**12)]]
    seat: Seat = ""
    # the part of the tab that is open
    tab: PartName | None = None


class Part(msgspec.Struct):
    """A part of the page."""

    version: int
    content: Any


class Parts(Message, tag="parts"):
    """The parts that a page lacks, and the mode of its camera; empty: it has none yet."""

    parts: dict[str, Part]
    camera: str


class Board:
    """The present parts of the page. One thread puts them up, any thread answers."""

    def __init__(self, server: PageServer, seats: Seats, camera: Camera):
        self._seats = seats
        self._camera = camera
        self._versions = count(1)
        self._asked_at: dict[str, float] = {}  # when the part of a tab was last asked for [s]
        self._parts: dict[str, Part] = {}
        server.link.on(Ask, self._answer)

    def put(self, name: PartName, content: Any) -> None:
        """Show a part; nothing is sent again if it has not changed."""
        shown = self._parts.get(name)
        if shown is None or shown.content != content:
            self._parts[name] = Part(next(self._versions), content)

    def is_wanted(self, name: PartName) -> bool:
        """Return whether any page has the tab of a part open."""
        return perf_counter() - self._asked_at.get(name, -inf) < WANTED

    def _answer(self, visitor: LinkVisitor, ask: Ask) -> None:
        if ask.tab is not None:
            self._asked_at[ask.tab] = perf_counter()
        changed = {
            name: part
            for name, part in tuple(self._parts.items())
            if part.version != ask.have.get(name)  # type: ignore[call-overload]
        }
        client = self._seats.client_of(ask.seat)
        visitor.send(Parts(changed, self._camera.mode_of(client) if client else ""))
