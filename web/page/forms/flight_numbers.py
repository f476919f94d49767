"""FlightNumbersForm: the planner's numbers of the shown flight, which may change in flight."""

from __future__ import annotations

from collections.abc import Sequence

from quadsim.web.page.forms.competitor_forms import slider_field
from quadsim.web.page.forms.forms import Field, Fields, Form, SetField, note
from quadsim.web.race.competitor import Competitor
from quadsim.web.race.numbers_in_flight import can_change, numbers_of_several, remark
from quadsim.web.race.page_race import PageRace
from quadsim.web.race.session import Session
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.race.viewing import Viewing
from quadsim.web.state.commands import Watch
from quadsim.web.state.desk import Desk
from quadsim.web.state.numbers import SLIDERS, Change

EVERYONE = "everyone"
OF = "of"


class FlightNumbersForm(Form):
    """The sliders of the shown flight, which act on its next plan, and not on a later START.

    Every visitor chooses whose numbers it sees.
    """

    name = "in_flight"
    title = "Numbers in flight"

    def __init__(self, desk: Desk, session: Session, viewing: Viewing):
        self._desk = desk
        self._session = session
        self._viewing = viewing

    def key(self, visitor: int) -> object:
        """Return the competitors, and the numbers that are shown."""
        s = self._seen_by(visitor)
        shown = _shown(s)
        numbers = [tuple(entry.numbers(s.t).values()) for entry in shown]
        names = [(entry.name, entry.live, entry.outcome) for entry in shown]
        return s.race, names, numbers, self._desk.state.visitor(visitor).of

    def fields(self, visitor: int) -> Fields:
        """Return the choice of a competitor, what its sliders do, and the sliders."""
        s = self._seen_by(visitor)
        shown = _shown(s)
        if not shown:
            return Fields([note("none", "Stand here once something flies or is replayed.")])
        t = s.t
        options = _options(shown)
        of = self._of(visitor, options)
        meant = [entry for entry in shown if of in (EVERYONE, entry.name)]
        numbers = {
            **meant[0].numbers(t),
            **{number.name: number.values[0] for number in numbers_of_several(meant, t)},
        }
        choice = Field(
            OF, "choice", "Of", of, choices=options, help="the competitor whose numbers are shown"
        )
        sliders = []
        for name, slider in SLIDERS.items():
            can = any(can_change(entry, name) for entry in meant)
            field = slider_field(name, slider, numbers[name], is_enabled=can)
            field.label += " now"
            field.rests = True
            sliders.append(field)
        return Fields([choice, note("does", remark(meant, t)), *sliders])

    def set(self, visitor: int, asked: SetField) -> None:
        """Show the numbers of another competitor, or change a number of the flight."""
        if asked.field == OF:
            self._desk.do(Watch(visitor, str(asked.value)))
            return
        of = self._of(visitor, _options(_shown(self._seen_by(visitor))))
        name = "" if of == EVERYONE else of
        self._session.tell(PageRace.change, Change(asked.field, float(asked.value)), name)

    def _of(self, visitor: int, options: Sequence[str]) -> str:
        """Return the competitor whose numbers a visitor sees: the first one, or the chosen one."""
        asked = self._desk.state.visitor(visitor).of
        return asked if asked in options else options[0]

    def _seen_by(self, visitor: int) -> Snapshot:
        """Return the race as it flies, or else at the time that a visitor watches."""
        s = self._session.snapshot
        return s if s.flying else self._viewing.seen_by(visitor)


def _shown(s: Snapshot) -> Sequence[Competitor]:
    """Return the competitors that fly, or else those that are shown."""
    flying = [entry for entry in s.competitors if entry.live and entry.outcome is None]
    return flying or s.competitors


def _options(shown: Sequence[Competitor]) -> list[str]:
    """Return the names of the competitors whose numbers can be chosen."""
    names = [entry.name for entry in shown]
    return [*names, EVERYONE] if len(names) > 1 else names
