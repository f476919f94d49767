"""Desk: the one owner of the page's state. Any thread may look at it and send commands."""

from __future__ import annotations

import threading

from quadsim.web.state.choices import Choices
from quadsim.web.state.commands import AnyCommand, OfferCourse, apply
from quadsim.web.state.menu import Menu
from quadsim.web.state.page_state import PageState


class Desk:
    """Holds the state of the page, which commands replace one after another.

    Args:
        first: the initial competitors, with the choices of the whole race.
        menu: the names that visitors may choose; None: any.
    """

    def __init__(self, *first: Choices, menu: Menu | None = None):
        self._lock = threading.Lock()
        self._state = PageState.of(*first, menu=menu)

    @property
    def state(self) -> PageState:
        """The present state, which never changes itself."""
        return self._state

    def do(self, command: AnyCommand | OfferCourse) -> PageState:
        """Carry out a command and return the state after it.

        Raises:
            ValueError: the command cannot be carried out, and the state stays as it was.
        """
        with self._lock:
            self._state = apply(self._state, command)
            return self._state
