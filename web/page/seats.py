"""Seats: secret names that relate the two connections of a visitor, viser's and the link."""

from __future__ import annotations

import secrets
from typing import Annotated

import viser
from msgspec import Meta

SEAT = 16  # bytes of a seat's name

Seat = Annotated[str, Meta(max_length=4 * SEAT)]


class Seats:
    """Gives each of viser's visitors a seat, which the page's own scripts send over the link."""

    def __init__(self, server: viser.ViserServer):
        self._clients: dict[str, viser.ClientHandle] = {}
        server.on_client_connect(self._sit)
        server.on_client_disconnect(self._leave)

    def client_of(self, seat: str) -> viser.ClientHandle | None:
        """Return viser's visitor at a seat; None: there is none, or not yet."""
        return self._clients.get(seat)

    def _sit(self, client: viser.ClientHandle) -> None:
        name = secrets.token_urlsafe(SEAT)
        self._clients[name] = client
        client.gui.add_html(f'<div hidden data-seat="{name}"></div>', order=1e6)

    def _leave(self, client: viser.ClientHandle) -> None:
        left = [name for name, one in self._clients.items() if one.client_id == client.client_id]
        for name in left:
            del self._clients[name]
