"""Cockpit: the visitor who holds the sticks, and the flight that follows them.

Several visitors watch a race and one of them flies. The sticks of the other visitors are ignored
until the flying visitor lets go, leaves, or has been silent for a while.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from time import perf_counter

from quadsim.racing.hand import Hand, Sticks

# Throttle below which the stick counts as down
DOWN = 0.05
# Share of the hover throttle at which a flight begins
ENOUGH = 0.95
# Time without stick input after which another visitor may take the sticks [s]
ABANDONED = 5.0


class Cockpit:
    """The sticks of the flying visitor. Any thread may use it.

    Args:
        clock: returns the time on the wall clock [s].
    """

    def __init__(self, clock: Callable[[], float] = perf_counter):
        self._clock = clock
        self._lock = threading.Lock()
        self._pilot: int | None = None
        self._moved_at = 0.0
        self._hand: Hand | None = None
        self._was_down = False

    @property
    def pilot(self) -> int | None:
        """The number of the visitor who holds the sticks, None if nobody does."""
        return self._pilot

    @property
    def sticks(self) -> Sticks | None:
        """The present stick positions; None: no recent input, or no flight by hand."""
        hand = self._hand
        return hand.sticks if hand else None

    @property
    def hover(self) -> float:
        """The hover throttle of the vehicle; one half without a flight."""
        hand = self._hand
        return hand.rates.hover if hand else 0.5

    def serve(self, hand: Hand | None) -> None:
        """Connect a flight to the sticks, at rest until it begins; None: disconnect."""
        with self._lock:
            self._hand = hand
            self._was_down = False

    def take(self, visitor: int) -> bool:
        """Give the sticks to a visitor unless another one holds them; return the success."""
        with self._lock:
            now = self._clock()
            abandoned = now - self._moved_at > ABANDONED
            if self._pilot not in (None, visitor) and not abandoned:
                return False
            self._pilot = visitor
            self._moved_at = now
            return True

    def let_go(self, visitor: int) -> None:
        """Take the sticks from a visitor; no effect if another one holds them."""
        with self._lock:
            if self._pilot == visitor:
                self._pilot = None

    def move(self, visitor: int, sticks: Sticks) -> bool:
        """Move the sticks if this visitor holds them; return whether that is so."""
        with self._lock:
            if self._pilot != visitor:
                return False
            self._moved_at = self._clock()
            self._was_down |= sticks.throttle < DOWN
            if self._hand:
                self._hand.move(sticks)
            return True

    @property
    def was_down(self) -> bool:
        """Whether the throttle has been down since the flight was connected."""
        return self._was_down

    @property
    def is_ready(self) -> bool:
        """Whether the throttle was down, and is now raised to about hover.

        A gamepad's stick rests in the middle: it must not begin a flight by itself.
        """
        hand = self._hand
        sticks = hand.sticks if hand else None
        if hand is None or sticks is None or not self._was_down:
            return False
        return sticks.throttle >= ENOUGH * hand.rates.hover
