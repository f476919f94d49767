"""CompetitorPanel: the competitors of the next START on one visitor's page, and one row to edit."""

from __future__ import annotations

from functools import partial
from typing import Any, get_args

import viser

from quadsim.firmware import FlightControllerName
from quadsim.heat.spec import MOST
from quadsim.racing.hand import HAND
from quadsim.web.by_hand import flight_controller_of
from quadsim.web.commands import (
    AddRow,
    AnyCommand,
    ChooseNames,
    EditRow,
    PutBack,
    RemoveRow,
    ResetRow,
)
from quadsim.web.desk import Desk
from quadsim.web.line_up import LineUp
from quadsim.web.menu import Menu
from quadsim.web.page.html import box, small, text
from quadsim.web.page.line_up_html import names_of, table_of
from quadsim.web.page.row_numbers import RowNumbers
from quadsim.web.state import PageState

ADD = "add"
REMOVE = "remove"
BACK = "undo"
NOTICE = 6.0  # duration of a notice [s]


class CompetitorPanel:
    """The table of competitors and the controls of one row, for one visitor alone.

    The page's thread calls `update`, which shows the state. Callbacks are coroutines on viser's
    event loop; they only send commands. A command names the row that the controls show.

    Args:
        client: the visitor.
        desk: the owner of the state.
        menu: the available choices.
        order: place of the folder among the others.
    """

    def __init__(self, client: viser.ClientHandle, desk: Desk, menu: Menu, order: float):
        self._client = client
        self._desk = desk
        self._menu = menu
        self._refused = 0  # number of refused commands, after which the controls are set again
        self._refused_shown = 0
        self._shown: object = None
        state = desk.state
        self._row = state.edited(client.client_id).number
        row = state.row(self._row).choices
        gui = client.gui
        with gui.add_folder("Competitors", order=order):
            self._table = gui.add_html("")
            self.choose = gui.add_button_group("Edit", self._buttons(state))
            self._title = gui.add_html("")
            hint = "how the planner samples; or hand, a person, or a learned pilot in its place"
            self.sampler = gui.add_dropdown(
                "Sampler", menu.samplers, initial_value=row.sampler, hint=hint
            )
            presets = tuple(menu.presets)
            self.preset = gui.add_dropdown("Preset", presets, initial_value=row.preset)
            self.vehicle = gui.add_dropdown("Vehicle", menu.vehicles, initial_value=row.vehicle)
            hint = "sensors by which the vehicle knows its state; perfect: the true state"
            self.sensing = gui.add_dropdown(
                "Sensing", menu.sensings, initial_value=row.sensing, hint=hint
            )
            hint = "ideal: a first-order rate loop; betaflight: the firmware, where it is built"
            self.flight_controller = gui.add_dropdown(
                "Flight controller",
                get_args(FlightControllerName),
                initial_value=row.flight_controller,
                hint=hint,
            )
            self.numbers = RowNumbers(gui, row, self._number_command)
            back = viser.Icon.ARROW_BACK_UP
            self.reset = gui.add_button("Reset to preset", icon=back, color="gray")
        for name, control in self._controls.items():
            control.on_update(partial(self._chosen, name))
        self.choose.on_click(self._pressed)
        self.reset.on_click(self._reset)

    def update(self, state: PageState, line_up: LineUp, presets: tuple[str, ...]) -> None:
        """Show the state if it has changed, or a command was refused.

        presets: the presets with which the edited competitor can fly the race.
        """
        shown = (state, line_up, presets, self._refused)
        if shown == self._shown:
            return
        self._shown = shown
        row = state.edited(self._client.client_id)
        self._row = row.number
        self._table.content = table_of(state, line_up, row.number)
        # viser sends options even if they have not changed.
        if self.preset.options != presets:
            self.preset.options = presets
        buttons = self._buttons(state)
        if self.choose.options != buttons:
            self.choose.options = buttons
        set_values = self.numbers.set_values
        if self._refused != self._refused_shown:
            self._refused_shown = self._refused
            set_values.forget()
        for name, control in self._controls.items():
            set_values(name, control, getattr(row.choices, name))
        self.numbers.show(row.choices)
        index = state.index(row.number)
        title = f"{names_of(state, line_up)[index]}, number {index + 1}"
        remarks = []
        choices = row.choices
        if choices.sampler == HAND:
            remarks.append("a person flies, by gamepad or keyboard: none of the numbers below")
        elif not choices.has_planner:
            remarks.append("a learned pilot has none of the numbers below")
        elif choices.idle_settings:
            idle = ", ".join(choices.idle_settings).replace("_", " ")
            remarks.append(f"kept, but {text(choices.kind)} sampling has none: {text(idle)}")
        self._title.content = box(title, *map(small, remarks))

    @property
    def _controls(self) -> dict[str, viser.GuiDropdownHandle[Any]]:
        """The controls of a row's own names."""
        return {
            "sampler": self.sampler,
            "preset": self.preset,
            "vehicle": self.vehicle,
            "sensing": self.sensing,
            "flight_controller": self.flight_controller,
        }

    def _buttons(self, state: PageState) -> tuple[str, ...]:
        """Return the buttons: one for each competitor, and three to add, remove and put back."""
        count = len(state.rows)
        numbers = map(str, range(1, count + 1))
        more = (ADD,) if count < MOST else ()
        less = (REMOVE,) if count > 1 else ()
        back = (BACK,) if state.removed and count < MOST else ()
        return (*numbers, *more, *less, *back)

    def _do(self, command: AnyCommand) -> None:
        """Carry out a command; notify the visitor if that is not possible."""
        try:
            self._desk.do(command)
        except ValueError as error:
            self._refused += 1
            self._client.add_notification(
                "Not taken", str(error), auto_close_seconds=NOTICE, color="red"
            )

    def _number_command(self, form: Any, name: str, value: Any) -> None:
        """Send a command about a number of the shown row. form: SetNumber or SetSetting."""
        self._do(form(self._row, name, value))

    async def _pressed(self, event: viser.GuiEvent[viser.GuiButtonGroupHandle]) -> None:
        """Edit a different competitor, add a copy of the shown one, remove it, or put one back."""
        pressed = event.target.value
        visitor = self._client.client_id
        if pressed == ADD:
            self._do(AddRow(visitor, like=self._row))
        elif pressed == REMOVE:
            self._do(RemoveRow(self._row))
        elif pressed == BACK:
            self._do(PutBack())
        elif pressed.isdigit():
            rows = self._desk.state.rows
            self._do(EditRow(visitor, rows[min(int(pressed), len(rows)) - 1].number))

    async def _chosen(self, name: str, event: viser.GuiEvent) -> None:
        """Choose a name. A preset brings its vehicle, a manual flight its flight controller."""
        if event.client_id is None:  # by update(), not by a visitor
            return
        value = self._controls[name].value
        names = {name: value}
        if name == "preset":
            names["vehicle"] = self._menu.presets[value]
        if value == HAND:
            names["flight_controller"] = flight_controller_of(self.vehicle.value)
        self._do(ChooseNames(self._row, names))

    async def _reset(self, event: viser.GuiEvent) -> None:
        """Reset to the numbers of the preset."""
        self._do(ResetRow(self._row))
