"""Seats: secret names that relate the two connections of a visitor, viser's and the link.

A page draws the name of its seat, opens the scene at the address /scene/NAME, and says the name
over the link.
"""

from __future__ import annotations

import re
from contextvars import ContextVar
from typing import Annotated

import viser
from msgspec import Meta

from quadsim.web.page.server.link import LinkVisitor

SCENE = "/scene/"  # path of viser's page, which the page holds in a frame
NAME = re.compile(r"[A-Za-z0-9_-]{16,64}")

Seat = Annotated[str, Meta(max_length=64)]

# of the connection that is being served; empty: it has none
SEAT: ContextVar[str] = ContextVar("seat", default="")


def seat_in(path: str) -> str | None:
    """Return the name of the seat in the path of a scene; None: the path is of no scene."""
    name = path.removeprefix(SCENE)
    return name if name != path and NAME.fullmatch(name) else None


class Seats:
    """Knows for each seat its client of viser's server and its visitor of the link."""

    def __init__(self, server: viser.ViserServer):
        self._clients: dict[str, viser.ClientHandle] = {}
        self._seats: dict[int, str] = {}
        server.on_client_connect(self._sit)
        server.on_client_disconnect(self._leave)

    def client_of(self, seat: str) -> viser.ClientHandle | None:
        """Return the client of viser's server at a seat; None: there is none, or not yet."""
        return self._clients.get(seat)

    def relate(self, visitor: LinkVisitor, seat: str) -> None:
        """Remember the seat of a visitor of the link."""
        self._seats[visitor.number] = seat

    def name_of(self, visitor: LinkVisitor) -> str:
        """Return the name of the seat of a visitor of the link; empty: it has named none yet."""
        return self._seats.get(visitor.number, "")

    def forget(self, visitor: LinkVisitor) -> str:
        """Forget a visitor of the link; return the name of its seat, empty if it had none."""
        return self._seats.pop(visitor.number, "")

    def client_beside(self, visitor: LinkVisitor) -> viser.ClientHandle | None:
        """Return the client of viser's server at the seat of a visitor; None: there is none yet."""
        return self.client_of(self._seats.get(visitor.number, ""))

    def visitor_at(self, seat: str) -> int | None:
        """Return the visitor of the link at a seat; None: no visitor has named this seat."""
        return next((number for number, name in self._seats.items() if name == seat), None)

    def visitors(self) -> dict[int, int]:
        """Return the visitors of the link by the numbers of their clients of viser's server."""
        found = {}
        for visitor, seat in tuple(self._seats.items()):
            client = self.client_of(seat)
            if client is not None:
                found[client.client_id] = visitor
        return found

    async def _sit(self, client: viser.ClientHandle) -> None:
        # viser runs a coroutine where its connection is served, a plain function elsewhere.
        self._clients[SEAT.get()] = client

    def _leave(self, client: viser.ClientHandle) -> None:
        left = [name for name, one in self._clients.items() if one.client_id == client.client_id]
        for name in left:
            del self._clients[name]
