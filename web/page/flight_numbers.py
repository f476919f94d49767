"""NumbersInFlight: the planner's numbers of the shown flight, which may change in flight."""

from __future__ import annotations

from functools import partial
from math import inf
from time import perf_counter

import viser

from web.choices import Choices
from web.competitor import Competitor
from web.numbers import SLIDERS, Change
from web.page.html import box, small, text
from web.page.row_numbers import add_sliders, show_numbers
from web.race import PageRace, Snapshot
from web.session import Session

EVERYONE: str = "everyone"
SETTLED = 0.5  # rest time of a slider before its number is requested, so a drag is one change [s]
HOLD = 1.0  # time after a visitor's move before a slider follows the race again [s]


class NumbersInFlight:
    """The sliders of the shown flight, which act on its next plan, and not on a later START.

    The page's thread calls `update`; callbacks are coroutines and only note what was moved.

    Args:
        first: a competitor, for the sliders' ranges.
    """

    def __init__(self, gui: viser.GuiApi, session: Session, first: Choices):
        self._session = session
        self._asked: dict[str, float] = {}  # numbers that have not settled yet
        self._moved_at: dict[str, float] = dict.fromkeys(SLIDERS, -inf)  # by hand [s]
        self.folder = gui.add_folder("Numbers in flight", visible=False)
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
        of = [entry for entry in flying or s.competitors if self._is_meant(entry)]
        self._whose.content = box(small(_remark(of, bool(flying))))
        now = perf_counter()
        numbers = _numbers(of, s.t)
        can_act = [name for name in SLIDERS if any(_changes(entry, name) for entry in of)]
        for name, slider in self.sliders.items():
            disabled = not flying or name not in can_act
            if slider.disabled != disabled:
                slider.disabled = disabled
            if now - self._moved_at[name] > HOLD:
                show_numbers({name: slider}, numbers)

    def _offer(self, entries: list[Competitor] | tuple[Competitor, ...]) -> None:
        """Offer the competitors of the race, by name."""
        options = (EVERYONE, *(entry.name for entry in entries))
        if self.whose.options != options:
            self.whose.options = options  # a competitor that is gone becomes EVERYONE

    def _is_meant(self, entry: Competitor) -> bool:
        """Return whether the sliders apply to a competitor."""
        return self.whose.value in (EVERYONE, entry.name)

    def _ask(self) -> None:
        """Request the numbers that have settled."""
        now = perf_counter()
        settled = [name for name in self._asked if now - self._moved_at[name] > SETTLED]
        name = "" if self.whose.value == EVERYONE else self.whose.value
        for number in settled:
            value = self._asked.pop(number)
            self._session.tell(PageRace.change, Change(number, value), name)

    async def _moved(self, name: str, event: viser.GuiEvent) -> None:
        """Note a visitor's change of a number."""
        if event.client_id is None:  # by update(), not by a visitor
            return
        self._moved_at[name] = perf_counter()
        self._asked[name] = self.sliders[name].value


def _numbers(entries: list[Competitor], t: float) -> dict[str, float]:
    """Return the numbers at t, each from the first competitor that has it."""
    numbers = entries[0].numbers(t)
    for name in numbers:
        having = [entry for entry in entries if _has(entry, name)]
        if having:
            numbers[name] = having[0].numbers(t)[name]
    return numbers


def _has(entry: Competitor, name: str) -> bool:
    """Return whether a competitor's planner has the number of a slider."""
    if not entry.has_planner:
        return False
    sampling = entry.spec["planner"].get("sampling")
    is_of_colored = SLIDERS[name].setting == "gamma"
    return not is_of_colored or (isinstance(sampling, dict) and "gamma" in sampling)


def _changes(entry: Competitor, name: str) -> bool:
    """Return whether a number may change in flight, which it cannot in a shared world."""
    return _has(entry, name) and not entry.spec.get("heat")


def _remark(entries: list[Competitor], flying: bool) -> str:
    """Return one line about the effect of the sliders, as HTML."""
    names = text(", ".join(entry.name for entry in entries))
    if not any(entry.has_planner for entry in entries):
        return f"{names}: a learned pilot, or a person, has none of these numbers"
    if not flying:
        return f"{names}: the numbers at this time"
    if any(entry.spec.get("heat") for entry in entries):
        return "in one world the numbers of START stay: they act in flight as ghosts only"
    return f"a slider acts on the next plan of {names}, and on this flight alone"
