"""Board: the parts of the page around the scene, which pages are sent as they change.

A page asks with the versions of the parts that it has, and is answered once some have changed, see
quadsim.web.page.server.questions. The parts of ALWAYS go to every page; the others are kept up to
date, and sent, while a page shows them. A part is everybody's or a visitor's own.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from math import inf
from time import perf_counter
from typing import Annotated, Any, Literal, get_args

import msgspec
from msgspec import Meta

from quadsim.web.page.scene.camera import Camera
from quadsim.web.page.server.link import Link, LinkVisitor, Message
from quadsim.web.page.server.questions import Questions
from quadsim.web.page.server.seats import Seat, Seats
from quadsim.web.state.page_state import EVERYBODY

PartName = Literal[
    "head", "next", "now", "tower", "time_line", "map", "groups",
    "laps", "events", "planner", "curves", "chatter", "seeds", "by_hand",
    "race", "competitors", "numbers", "in_flight", "view", "editor", "export",
    "line_up", "picture",
]  # fmt: skip
ALWAYS = frozenset(("head", "next", "now", "tower", "time_line", "map", "groups", "by_hand"))
PARTS: tuple[PartName, ...] = get_args(PartName)
# Time after which a question is answered though nothing has changed, so that a page knows that the
# server lives [s]
REST = 1.0
WANTED = 3.0  # time after a question for which a part that is shown is kept up to date [s]
MOST_SHOWN = 32  # number of parts that a page shows at once

Key = Callable[[int], object]
Content = Callable[[int], Any]


class Ask(Message, tag="ask"):
    """A question of a page for the parts that have changed since the versions it has."""

    have: dict[PartName, Annotated[int, Meta(ge=0, le=10**12)]]
    seat: Seat = ""
    # the parts that it shows beside those of ALWAYS
    shows: Annotated[tuple[PartName, ...], Meta(max_length=MOST_SHOWN)] = ()


class Part(msgspec.Struct):
    """A part of the page."""

    version: int
    content: Any


class Parts(Message, tag="parts"):
    """The parts that a page lacks, and the mode of its camera; empty: it has none yet."""

    parts: dict[str, Part]
    camera: str


@dataclass
class Own:
    """A part that was made for one visitor, and the key that it was made from, see `offer`."""

    key: object
    part: Part | None


class Board:
    """The present parts of the page.

    One thread puts parts up; the answers to pages are made on the server's event loop.

    Args:
        link: takes the questions of pages, and gives the answers.
        seats: relate a page and its scene.
        camera: the cameras of the scenes.
        begins: called when a page asks for the first time.
    """

    def __init__(
        self,
        link: Link,
        seats: Seats,
        camera: Camera,
        begins: Callable[[], object] = lambda: None,
    ):
        self.link = link
        self._seats = seats
        self._camera = camera
        self._versions = count(1)
        # when a visitor last asked for a part [s]
        self._asked_at: dict[tuple[int, str], float] = {}
        self._parts: dict[tuple[int, str], Part] = {}
        self._offered: dict[str, tuple[Key, Content]] = {}
        self._own: dict[tuple[int, str], Own] = {}
        self._cameras: dict[int, str] = {}  # the modes that visitors have last been sent
        self._questions = Questions(link, Ask, self._answer, begins)
        link.on_leave(self._forget)

    def put(self, name: PartName, content: Any, visitor: int = EVERYBODY) -> None:
        """Show a part; nothing is sent again if it has not changed.

        Args:
            name: of the part.
            content: of the part.
            visitor: number of the only visitor who is shown it, or EVERYBODY.
        """
        shown = self._parts.get((visitor, name))
        if shown is None or shown.content != content:
            self._parts[visitor, name] = Part(next(self._versions), content)

    def offer(self, name: PartName, key: Key, content: Content) -> None:
        """Make a part for each visitor that shows it.

        Args:
            name: of the part.
            key: function of the visitor's number; its result says whether the part is as it was.
            content: function of the visitor's number.
        """
        self._offered[name] = (key, content)

    def is_wanted(self, name: PartName, visitor: int = EVERYBODY) -> bool:
        """Return whether the page of a visitor, or any page, shows a part."""
        return perf_counter() - self._asked_at.get((visitor, name), -inf) < WANTED

    def forget(self, visitor: int) -> None:
        """Forget the parts of a visitor who has left. The thread that puts parts up calls it."""
        for name in PARTS:
            self._parts.pop((visitor, name), None)
            self._asked_at.pop((visitor, name), None)

    def answer(self) -> None:
        """Answer the pages whose parts have changed. Any thread may call it."""
        self._questions.answer()

    def _answer(self, visitor: LinkVisitor, ask: Ask, waited: float) -> Parts | None:
        """Return what has changed; None: nothing, and the page has not waited for long.

        A new page waits for its head, so that it has all of its parts at once.
        """
        now = perf_counter()
        for name in ask.shows:
            self._asked_at[EVERYBODY, name] = self._asked_at[visitor.number, name] = now
        self._seats.relate(visitor, ask.seat)
        changed = {}
        for name in (*ALWAYS, *ask.shows):
            part = self._part_for(visitor.number, name)
            if part is not None and part.version != ask.have.get(name):  # type: ignore[call-overload]
                changed[name] = part
        client = self._seats.client_of(ask.seat)
        camera = self._camera.mode_of(client) if client else ""
        is_made = (visitor.number, "head") in self._parts
        is_new = is_made and (bool(changed) or camera != self._cameras.get(visitor.number))
        if not is_new and waited < REST:
            return None
        self._cameras[visitor.number] = camera
        return Parts(changed, camera)

    def _part_for(self, visitor: int, name: str) -> Part | None:
        """Return a part as a visitor sees it; None: there is none yet."""
        if name not in self._offered:
            return self._parts.get((visitor, name)) or self._parts.get((EVERYBODY, name))
        key_of, content_of = self._offered[name]
        key = key_of(visitor)
        own = self._own.get((visitor, name))
        if own is None or own.key != key:
            before = own.part if own else None
            own = Own(key, self._made(content_of, visitor, before))
            self._own[visitor, name] = own
        return own.part

    def _made(self, content_of: Content, visitor: int, before: Part | None) -> Part | None:
        """Return a part that is made anew; what cannot be made stays what it was before."""
        try:
            content = content_of(visitor)
        except Exception:
            # An error in one part must not keep the page from the others.
            traceback.print_exc()
            return before
        is_same = before is not None and before.content == content
        return before if is_same else Part(next(self._versions), content)

    def _forget(self, visitor: LinkVisitor) -> None:
        self._cameras.pop(visitor.number, None)
        for name in self._offered:
            self._own.pop((visitor.number, name), None)
