"""NumbersInFlight: the planner's numbers of the shown flight, which may change in flight."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from math import inf
from time import perf_counter
from typing import NamedTuple

import viser

from quadsim.web.choices import CompetitorChoices
from quadsim.web.competitor import Competitor
from quadsim.web.numbers import SLIDERS, Change
from quadsim.web.numbers_in_flight import can_change, numbers_of_several, remark
from quadsim.web.page.html import box, small, text
from quadsim.web.page.row_numbers import add_sliders, show_numbers
from quadsim.web.race import PageRace, Snapshot
from quadsim.web.session import Session

EVERYONE: str = "everyone"
SETTLED = 0.5  # rest time of a slider before its number is requested, so a drag is one change [s]
HOLD = 1.0  # time after a visitor's move before a slider follows the race again [s]


class Asked(NamedTuple):
    """A number that a visitor has moved."""

    value: float
    whose: str  # name of a competitor, or EVERYONE


class NumbersInFlight:
    """The sliders of the shown flight, which act on its next plan, and not on a later START.

    Every visitor has them. The page's thread calls `update`; callbacks are coroutines and only note
    what was moved.

    Args:
        first: a competitor, for the sliders' ranges.
        order: place of the folder among the others.
    """

    def __init__(self, gui: viser.GuiApi, session: Session, first: CompetitorChoices, order: float):
        self._session = session
        # numbers that have not settled yet, with the competitor that was meant when they were moved
        self._asked: dict[str, Asked] = {}
        self._moved_at: dict[str, float] = dict.fromkeys(SLIDERS, -inf)  # by hand [s]
        self.folder = gui.add_folder("Numbers in flight", visible=False, order=order)
        with self.folder:
            self._whose = gui.add_html("")
            self.whose = gui.add_dropdown("Of", (EVERYONE,), initial_value=EVERYONE)
            self.sliders = add_sliders(gui, first, " now")
        for name, slider in self.sliders.items():
            slider.on_update(partial(self._moved, name))

    def update(self, s: Snapshot) -> None:
        """Request the settled numbers, and show the numbers of the race."""
        shown = bool(s.competitors)
        if self.folder.visible != shown:
            self.folder.visible = shown
        if not shown:
            return
        self._ask()
        flying = [entry for entry in s.competitors if entry.live and entry.outcome is None]
        self._offer(flying or s.competitors)
        shown_ones = flying or s.competitors
        of = [entry for entry in shown_ones if self._is_meant(entry)] or shown_ones[:1]
        self._whose.content = box(small(text(remark(of, s.t))))
        now = perf_counter()
        numbers = {
            **of[0].numbers(s.t),
            **{number.name: number.values[0] for number in numbers_of_several(of, s.t)},
        }
        can_act = [name for name in SLIDERS if any(can_change(entry, name) for entry in of)]
        for name, slider in self.sliders.items():
            disabled = name not in can_act
            if slider.disabled != disabled:
                slider.disabled = disabled
            if now - self._moved_at[name] > HOLD:
                show_numbers({name: slider}, numbers)

    def _offer(self, entries: Sequence[Competitor]) -> None:
        """Offer the competitors of the race by name, and all of them; the first one is chosen."""
        names = tuple(entry.name for entry in entries)
        options = (*names, EVERYONE) if len(names) > 1 else names
        if options and self.whose.options != options:
            self.whose.options = options  # a competitor that is gone becomes the first one
            self.whose.value = options[0]

    def _is_meant(self, entry: Competitor) -> bool:
        """Return whether the sliders apply to a competitor."""
        return self.whose.value in (EVERYONE, entry.name)

    def _ask(self) -> None:
        """Request the numbers that have settled."""
        now = perf_counter()
        settled = [name for name in self._asked if now - self._moved_at[name] > SETTLED]
        for number in settled:
            asked = self._asked.pop(number)
            name = "" if asked.whose == EVERYONE else asked.whose
            self._session.tell(PageRace.change, Change(number, asked.value), name)

    async def _moved(self, name: str, event: viser.GuiEvent) -> None:
        """Note a visitor's change of a number."""
        if event.client_id is None:  # by update(), not by a visitor
            return
        self._moved_at[name] = perf_counter()
        self._asked[name] = Asked(self.sliders[name].value, self.whose.value)
