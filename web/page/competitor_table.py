"""CompetitorTable: one to eight competitors, each with its own numbers, for the next START."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, get_args

import viser

from quadsim.course import Course
from quadsim.firmware import FlightControllerName
from quadsim.heat.spec import MOST
from quadsim.palette import styles_on_dark
from quadsim.racing.hand import HAND
from web.by_hand import flight_controller_of
from web.choices import OF_THE_RACE, Choices, differences, names_of
from web.numbers import SLIDERS
from web.offered_presets import offered_presets
from web.page.html import RED, box, coloured, div, element, small, swatch, text
from web.page.menu import Menu
from web.page.row_numbers import RowNumbers, Step, shown_value

ADD = "add"
REMOVE = "remove"
# Default attributes of a row; its second line names different ones
USUAL = {"flight_controller": "ideal", "sensing": "perfect"}
NOTICE = 6.0  # duration of a notice [s]


class CompetitorTable:
    """The rows of the table, and the controls of the edited row.

    Rows and controls change on viser's event loop alone: callbacks are coroutines, which it runs
    one after another, in the order of the visitors' messages. Any thread may read `rows`.

    Args:
        menu: the available choices.
        first: the initial competitors.

    Attributes:
        rows: the competitors, without the choices of the whole race.
        edited: the index of the edited row.
    """

    def __init__(self, gui: viser.GuiApi, menu: Menu, first: Sequence[Choices]):
        self.rows = tuple(first)
        self._menu = menu
        self.edited = 0
        row = self.rows[0]
        self.folder = gui.add_folder("Competitor")
        with self.folder:
            self._title = gui.add_html("")
            self.choose = gui.add_button_group("Edit", self._buttons())
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
            self.numbers = RowNumbers(gui, row, self.edit)
            back = viser.Icon.ARROW_BACK_UP
            self.reset = gui.add_button("Reset to preset", icon=back, color="gray")
        for name, control in self._controls.items():
            control.on_update(partial(self._chosen, name))
        self.choose.on_click(self._pressed)
        self.reset.on_click(self._reset)
        self._show()

    def flights(self, race: Choices) -> list[Choices]:
        """Return the flights of all competitors.

        race: the choices of the whole race.
        """
        shared = {name: getattr(race, name) for name in OF_THE_RACE}
        return [replace(row, **shared) for row in self.rows]

    def offer_presets(self, course: Course, laps: int, runs_dir: str) -> None:
        """Offer the presets with which the edited competitor can fly a race.

        runs_dir: folder of runs with the solutions of `race limit`.
        """
        chosen = {row.preset for row in self.rows}
        vehicle = self.rows[self.edited].vehicle
        offered = offered_presets(self._menu.presets, chosen, course, vehicle, laps, runs_dir)
        # viser sends options even if they have not changed.
        if self.preset.options != offered:
            self.preset.options = offered

    def edit(self, event: viser.GuiEvent, step: Step) -> None:
        """Change the edited competitor; notify the visitor if that is not possible."""
        row = self.rows[self.edited]
        try:
            row = step(row)
            _ = row.planner
        except ValueError as error:
            if event.client is not None:
                event.client.add_notification(
                    "Not taken", str(error), auto_close_seconds=NOTICE, color="red"
                )
        else:
            self.rows = (*self.rows[: self.edited], row, *self.rows[self.edited + 1 :])
        self._show()

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

    def _show(self) -> None:
        """Show the edited competitor."""
        row = self.rows[self.edited]
        for name, control in self._controls.items():
            control.value = getattr(row, name)
        self.numbers.show(row)
        buttons = self._buttons()
        # viser sends options even if they have not changed.
        if self.choose.options != buttons:
            self.choose.options = buttons
        name = names_of(self.rows)[self.edited]
        own = styles_on_dark([one.kind for one in self.rows])[self.edited]
        title = f"{swatch(own)}{coloured(text(name), own.colour)}, number {self.edited + 1}"
        remarks = []
        if row.sampler == HAND:
            remarks.append("a person flies, by gamepad or keyboard: none of the numbers below")
        elif not row.has_planner:
            remarks.append("a learned pilot has none of the numbers below")
        elif row.idle_settings:
            idle = ", ".join(row.idle_settings).replace("_", " ")
            remarks.append(f"kept, but {text(row.kind)} sampling has none: {text(idle)}")
        self._title.content = box(title, *map(small, remarks))

    def _buttons(self) -> tuple[str, ...]:
        """Return the buttons: one for each competitor, and two to add and remove one."""
        numbers = map(str, range(1, len(self.rows) + 1))
        more = (ADD,) if len(self.rows) < MOST else ()
        less = (REMOVE,) if len(self.rows) > 1 else ()
        return (*numbers, *more, *less)

    async def _pressed(self, event: viser.GuiEvent[viser.GuiButtonGroupHandle]) -> None:
        """Edit a different competitor, add a copy of the edited one, or remove it."""
        pressed = event.target.value
        if pressed == ADD and len(self.rows) < MOST:
            self.rows = (*self.rows, self.rows[self.edited])
            self.edited = len(self.rows) - 1
        elif pressed == REMOVE and len(self.rows) > 1:
            self.rows = (*self.rows[: self.edited], *self.rows[self.edited + 1 :])
            self.edited = min(self.edited, len(self.rows) - 1)
        elif pressed.isdigit():
            self.edited = min(int(pressed), len(self.rows)) - 1
        self._show()

    async def _chosen(self, name: str, event: viser.GuiEvent) -> None:
        """Set a name. A preset also sets its vehicle, a manual flight the flight controller."""
        if event.client_id is None:  # by _show(), not by a visitor
            return
        value = self._controls[name].value
        changes = {name: value}
        if name == "preset":
            changes["vehicle"] = self._menu.presets[value]
        if value == HAND:
            vehicle = self.rows[self.edited].vehicle
            changes["flight_controller"] = flight_controller_of(vehicle)
        self.edit(event, lambda row: replace(row, **changes))

    async def _reset(self, event: viser.GuiEvent) -> None:
        """Reset to the numbers of the preset."""
        self.edit(event, lambda row: replace(row, numbers={}, settings={}))


def table_of(flights: Sequence[Choices], edited: int, problem: str) -> str:
    """Return the table of competitors as HTML.

    Args:
        flights: the flights of the next START.
        edited: index of the edited flight, from 0.
        problem: the reason why the flights cannot be flown, "" if they can.
    """
    styles = styles_on_dark([flight.kind for flight in flights])
    rows = []
    for k, (flight, name, own) in enumerate(zip(flights, names_of(flights), styles, strict=True)):
        first = f"{k + 1} {swatch(own)}" + coloured(text(name), own.colour)
        look = {"background": "#2c3038"} if k == edited and len(flights) > 1 else {}
        row = div(first + small(_what(flight)), padding="2px 6px", border_radius="4px", **look)
        rows.append(row.replace("<div ", f'<div data-row="{k + 1}" ', 1))
    remark = ""
    if problem:
        remark = div(coloured(text(problem), RED), margin_top="4px")
    elif len(flights) > 1:
        remark = small(text(compared(flights)))
    return box(element("div", "".join(rows)), remark)


def announced(flights: Sequence[Choices], world: str) -> str:
    """Return a description of the next START and of what to look for, as HTML.

    world: description of the world of several competitors.
    """
    styles = styles_on_dark([flight.kind for flight in flights])
    named = [
        swatch(own) + coloured(text(name), own.colour)
        for name, own in zip(names_of(flights), styles, strict=True)
    ]
    course = text(flights[0].course)
    if len(flights) == 1:
        return div(f"START flies {named[0]} on {course}", text_align="center")
    what = div(f"START flies {' against '.join(named)}", font_size="16px")
    where = small(f"on {course}, {text(world)}. {text(compared(flights))}")
    look = small("Watch who leads, and the chatter of the thrust: jumps that no motor can follow.")
    return div(what + where + look, text_align="center")


def compared(flights: Sequence[Choices]) -> str:
    """Return one sentence with the differences between competitors."""
    found = differences(flights)
    if not found:
        return "They are all alike."
    return f"They differ in {' and '.join(found)}; all else is equal, the seed too."


def _what(flight: Choices) -> str:
    """Return the choices of a competitor as HTML: names and changed numbers."""
    parts = [flight.preset if flight.has_planner else flight.sampler, flight.vehicle]
    parts += [
        getattr(flight, name) for name, usual in USUAL.items() if getattr(flight, name) != usual
    ]
    changed = changes_of(flight) if flight.has_planner else []
    shown = [text(part) for part in parts]
    return " · ".join([*shown, *(f"<b>{text(change)}</b>" for change in changed)])


def changes_of(flight: Choices) -> list[str]:
    """Return the numbers that differ from the preset, such as "samples 512"."""
    idle = flight.idle_settings
    found = []
    for name, value in flight.settings.items():
        if name not in idle:
            found.append(f"{name} {shown_value(value)}")
    for name, value in flight.numbers.items():
        if SLIDERS[name].setting not in idle:
            found.append(f"{SLIDERS[name].label.lower()} {value:g}")
    return [change.replace("_", " ") for change in found]
