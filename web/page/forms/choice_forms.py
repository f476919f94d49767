"""Forms of the race of the next START, which all visitors share, and of a visitor's display."""

from __future__ import annotations

from typing import Any

from msgspec.structs import replace

from quadsim.web.page.forms.forms import (
    Field,
    Fields,
    Form,
    PressField,
    SetField,
    button,
    field_of,
    note,
)
from quadsim.web.page.server.link import LinkVisitor
from quadsim.web.race.next_start import NextStart
from quadsim.web.state.commands import OF_RACE, OF_RACE_CHOICES, ChooseRace, FlyAgainst, SetView
from quadsim.web.state.desk import Desk
from quadsim.web.state.fields import ShownField, shown_fields
from quadsim.web.state.page_state import TOGETHER, PageState
from quadsim.web.state.view import View

ALONE = "alone"


class RaceForm(Form):
    """The choices of the race, and the stored runs beside it."""

    name = "race"
    title = "Race"
    is_open = True

    def __init__(self, start: NextStart):
        self._start = start

    def key(self, visitor: int) -> object:
        """Return the race and its course."""
        state = self._start.desk.state
        course = self._start.course()
        laps = course.laps if course else 0
        heat = (state.world, state.expect, state.rules, len(state.rows) > 1)
        return state.race, heat, state.against, state.menu, laps

    def fields(self, visitor: int) -> Fields:
        """Return the choices, in the order of their records."""
        state = self._start.desk.state
        found = {name: self._field(one, state) for name, one in OF_RACE.items()}
        if not (len(state.rows) > 1 and state.world == TOGETHER):
            del found["expect"], found["rules"]
        fields = list(found.values())
        if state.against:
            beside = ", ".join(state.against)
            fields.append(note("against", f"beside the flight: {beside}"))
            fields.append(button(ALONE, "Fly without stored runs"))
        return Fields(fields)

    def set(self, visitor: int, asked: SetField) -> None:
        """Choose a setting of the race. Raises ValueError."""
        self._start.desk.do(ChooseRace(asked.field, asked.value, visitor))

    def press(self, visitor: LinkVisitor, asked: PressField) -> None:
        """Show no stored runs beside the next flight."""
        self._start.desk.do(FlyAgainst(()))

    def _field(self, found: ShownField, state: PageState) -> Field:
        """Return the control of a setting."""
        of: Any = state.race if found.name in OF_RACE_CHOICES else state
        field = field_of(found, getattr(of, found.name), state.menu)
        if found.name != "laps":
            return field
        course = self._start.course()
        own = f"{course.laps}, the course's" if course else "the course's"
        value = "" if field.value == "0" else field.value
        return replace(field, value=value, instead=own)


class ViewForm(Form):
    """The choices of the display: ghosts, trails, what is drawn, how much is sent."""

    name = "view"
    title = "View"

    def __init__(self, desk: Desk):
        self._desk = desk

    def key(self, visitor: int) -> object:
        """Return the choices."""
        return self._desk.state.visitor(visitor).view

    def fields(self, visitor: int) -> Fields:
        """Return a control for each choice."""
        view = self._desk.state.visitor(visitor).view
        fields = shown_fields(View)
        return Fields([field_of(found, getattr(view, name)) for name, found in fields.items()])

    def set(self, visitor: int, asked: SetField) -> None:
        """Change a choice. Raises ValueError."""
        self._desk.do(SetView(visitor, asked.field, asked.value))  # type: ignore[arg-type]
