"""Cockpit: who holds the sticks, and the flight that follows them.

Several visitors watch a race and one of them flies. The others' sticks are ignored until that one
lets go, leaves, or has been silent for a while.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from time import perf_counter

from quadsim.racing.hand import Hand, Sticks

# Throttle below which it counts as down
DOWN = 0.05
# Share of the throttle for hovering from which on a flight begins
ENOUGH = 0.95
# Time without sticks after which another visitor may take them [s]
ABANDONED = 5.0


class Cockpit:
    """The place from which one visitor flies. Any thread may use it.

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
        """The number of the visitor who holds the sticks, None where nobody does."""
        return self._pilot

    @property
    def sticks(self) -> Sticks | None:
        """The sticks as they are now; None: none have come for a while, or no flight follows."""
        hand = self._hand
        return hand.sticks if hand else None

    @property
    def hover(self) -> float:
        """The throttle at which the vehicle hovers; one half without a flight."""
        hand = self._hand
        return hand.rates.hover if hand else 0.5

    def serve(self, hand: Hand | None) -> None:
        """Let a flight follow the sticks, which stands until it is told to begin; None: none."""
        with self._lock:
            self._hand = hand
            self._was_down = False

    def take(self, visitor: int) -> bool:
        """Give the sticks to a visitor, unless another one holds them; return whether."""
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
        """Move the sticks; return whether this visitor holds them. Others' are ignored."""
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
        """Whether the throttle has been down since the flight stands on its start."""
        return self._was_down

    @property
    def is_ready(self) -> bool:
        """Whether the throttle was down, and is now raised so far that the vehicle hovers.

        A gamepad's stick rests in the middle: it must not begin a flight by itself.
        """
        hand = self._hand
        sticks = hand.sticks if hand else None
        if hand is None or sticks is None or not self._was_down:
            return False
        return sticks.throttle >= ENOUGH * hand.rates.hover
