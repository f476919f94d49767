"""ViewForm: how a visitor sees the race in the scene."""

from __future__ import annotations

from quadsim.web.page.forms.forms import Fields, Form, SetField, field_of
from quadsim.web.state.commands import SetView
from quadsim.web.state.desk import Desk
from quadsim.web.state.fields import shown_fields
from quadsim.web.state.view import View


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
