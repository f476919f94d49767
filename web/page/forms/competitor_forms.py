"""The forms of the competitors of the next START: each visitor edits a row of its own choice."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Annotated

from msgspec import Meta, inspect

from quadsim.config.resolve import nominal_model
from quadsim.config.settings import SETTINGS, bare
from quadsim.heat.spec import MOST
from quadsim.racing.hand import HAND
from quadsim.vehicle import load_vehicle
from quadsim.web.page.due import Beat, Due
from quadsim.web.page.forms.forms import (
    Field,
    Fields,
    Form,
    Kind,
    PressField,
    SetField,
    button,
    field_of,
    note,
)
from quadsim.web.page.server.link import LinkVisitor, Message
from quadsim.web.race.next_start import NextStart
from quadsim.web.state.choices import (
    Choices,
    CompetitorChoices,
    Planners,
    flight_controller_of,
)
from quadsim.web.state.commands import (
    OF_COMPETITOR,
    AddRow,
    ChooseNames,
    EditRow,
    PutBack,
    RemoveRow,
    ResetRow,
    SetNumber,
    SetSetting,
)
from quadsim.web.state.desk import Desk
from quadsim.web.state.numbers import SLIDERS, Slider
from quadsim.web.state.offered_presets import offered_presets
from quadsim.web.state.page_state import PageState, Row
from quadsim.web.state.setting_texts import HAVE_SLIDERS, shown_value

TITLES = {"sampling": "Sampling", "mppi": "MPPI", "cost": "Cost", "model": "Model of the vehicle"}
SOLUTIONS = 1.0  # time between two looks for solutions that presets follow [s]
ADD, REMOVE, BACK, RESET = "add", "remove", "undo", "reset"


class ChooseRow(Message, tag="edit_row"):
    """A visitor edits another competitor."""

    row: Annotated[int, Meta(ge=0, le=10**9)]


class CompetitorForm(Form):
    """The row that a visitor edits: its names and sliders, and rows that come and go.

    Args:
        start: what the next START flies.
    """

    name = "competitors"
    title = "Competitors"
    is_open = True

    def __init__(self, start: NextStart):
        self._start = start
        self._desk = start.desk
        # of each vehicle, the presets that can fly the race
        self._presets: dict[str, tuple[str, ...]] = {}
        self._presets_due = Due(0.0)
        self._presets_beat = Beat(SOLUTIONS)

    def update(self) -> None:
        """Find out which presets can fly the race. The page's own thread calls it."""
        state = self._desk.state
        menu, race = state.menu, state.race
        course = self._start.course()
        if course is None or menu is None:
            self._presets = {}
            return
        chosen = frozenset(row.choices.preset for row in state.rows)
        vehicles = frozenset(row.choices.vehicle for row in state.rows)
        laps = race.laps or course.laps
        # A solution may be stored at any time.
        if self._presets_due((chosen, vehicles, course, laps)) or self._presets_beat.strikes():
            self._presets = {
                vehicle: offered_presets(menu.presets, chosen, course, vehicle, laps, race.runs_dir)
                for vehicle in vehicles
            }

    def key(self, visitor: int) -> object:
        """Return the row, and what else decides what can be done."""
        state = self._desk.state
        row = state.edited(visitor)
        presets = self._presets.get(row.choices.vehicle)
        # Numbers of a preset may follow from the course
        course = state.race.course
        return row, course, len(state.rows), bool(state.removed), state.menu, presets

    def fields(self, visitor: int) -> Fields:
        """Return the buttons of rows, names, sliders."""
        state = self._desk.state
        row = state.edited(visitor)
        fields = [*_row_buttons(state), *self._names(row, state)]
        fields += [note(f"remark {k}", text) for k, text in enumerate(_remarks(row.choices))]
        fields += _sliders(Choices.of(state.race, row.choices))
        fields.append(button(RESET, "Reset to preset"))
        return Fields(fields, row.number)

    def field(self, visitor: int, name: str) -> Field | None:
        """Return one field, of which sliders and names are made alone."""
        state = self._desk.state
        row = state.edited(visitor)
        if name in SLIDERS:
            choices = Choices.of(state.race, row.choices)
            return _slider(name, choices, choices.planners())
        if name in OF_COMPETITOR:
            return self._name(name, row, state)
        return super().field(visitor, name)

    def set(self, visitor: int, asked: SetField) -> None:
        """Choose a name, or a number of a slider. Raises ValueError."""
        value = asked.value
        if asked.field in SLIDERS:
            self._desk.do(SetNumber(asked.of, asked.field, float(value)))
            return
        names = {asked.field: str(value)}
        if value == HAND:
            vehicle = self._desk.state.row(asked.of).choices.vehicle
            names["flight_controller"] = flight_controller_of(vehicle)
        self._desk.do(ChooseNames(asked.of, names))

    def press(self, visitor: LinkVisitor, asked: PressField) -> None:
        """Add a copy, remove the row, put one back, reset the row. Raises ValueError."""
        pressed = asked.field
        if pressed == ADD:
            self._desk.do(AddRow(visitor.number, like=asked.of))
        elif pressed == REMOVE:
            self._desk.do(RemoveRow(asked.of))
        elif pressed == BACK:
            self._desk.do(PutBack())
        else:
            self._desk.do(ResetRow(asked.of))

    def edit(self, visitor: LinkVisitor, asked: ChooseRow) -> None:
        """Edit another competitor; one that was just removed stays what it is."""
        with suppress(ValueError):
            self._desk.do(EditRow(visitor.number, asked.row))

    def _names(self, row: Row, state: PageState) -> list[Field]:
        """Return the choices of names."""
        return [self._name(name, row, state) for name in OF_COMPETITOR]

    def _name(self, name: str, row: Row, state: PageState) -> Field:
        """Return the choice of a name; presets that cannot fly the race are not offered."""
        field = field_of(OF_COMPETITOR[name], getattr(row.choices, name), state.menu)
        if name == "preset":
            field.choices = self._presets.get(row.choices.vehicle, field.choices)
        return field


def _row_buttons(state: PageState) -> list[Field]:
    """Return the buttons to add, remove and put back."""
    count = len(state.rows)
    can = {ADD: count < MOST, REMOVE: count > 1, BACK: bool(state.removed) and count < MOST}
    return [button(name) for name, is_there in can.items() if is_there]


def _remarks(choices: CompetitorChoices) -> list[str]:
    """Return what has to be said of the numbers of a row."""
    if choices.sampler == HAND:
        return ["a person flies, by gamepad or keyboard: none of the numbers below"]
    if not choices.has_planner:
        return ["a learned pilot has none of the numbers below"]
    if choices.idle_settings:
        idle = ", ".join(choices.idle_settings).replace("_", " ")
        return [f"kept, but {choices.kind} sampling has none: {idle}"]
    return []


def _sliders(choices: Choices) -> list[Field]:
    """Return the sliders of a row."""
    planners = choices.planners()
    return [_slider(name, choices, planners) for name in SLIDERS]


def _slider(name: str, choices: Choices, planners: Planners) -> Field:
    """Return a slider of a row."""
    slider = SLIDERS[name]
    value = slider.read(planners.chosen, planners.base)
    return slider_field(name, slider, value, is_enabled=slider.setting in choices.kinds)


def slider_field(name: str, slider: Slider, value: float, is_enabled: bool) -> Field:
    """Return a slider; a number beyond its range widens it."""
    return Field(
        name=name,
        kind="slider",
        label=slider.label,
        value=float(value),
        help=slider.hint,
        low=min(slider.low, value),
        high=max(slider.high, value),
        step=slider.step,
        is_enabled=is_enabled,
    )


class NumbersForm(Form):
    """Every other setting of the planner of the row that a visitor edits."""

    name = "numbers"
    title = "All numbers"

    def __init__(self, desk: Desk):
        self._desk = desk

    def key(self, visitor: int) -> object:
        """Return the row, and the course, from which its numbers may follow."""
        state = self._desk.state
        return state.edited(visitor), state.race.course

    def fields(self, visitor: int) -> Fields:
        """Return a control for each setting, in a fold for each group."""
        state = self._desk.state
        row = state.edited(visitor)
        choices = Choices.of(state.race, row.choices)
        names = [name for name in choices.kinds if name not in HAVE_SLIDERS]
        if not names:
            none = note("none", "no planner flies: there are no numbers")
            return Fields([none], row.number)
        parts = _parts_of(choices)
        return Fields([_setting_field(name, choices, parts) for name in names], row.number)

    def field(self, visitor: int, name: str) -> Field | None:
        """Return the control of one setting."""
        state = self._desk.state
        choices = Choices.of(state.race, state.edited(visitor).choices)
        if name not in choices.kinds or name in HAVE_SLIDERS:
            return None
        return _setting_field(name, choices, _parts_of(choices))

    def set(self, visitor: int, asked: SetField) -> None:
        """Set a setting. Raises ValueError."""
        self._desk.do(SetSetting(asked.of, asked.field, asked.value))


def _parts_of(choices: Choices) -> dict[str, object]:
    """Return the parts of a planner, and its model of the vehicle, by their groups of settings."""
    planner = choices.planners().chosen
    return {
        "sampling": planner.sampling,
        "mppi": planner.mppi,
        "cost": planner.cost,
        "model": nominal_model(choices.known_settings, load_vehicle(choices.vehicle)),
    }


def _setting_field(name: str, choices: Choices, parts: Mapping[str, object]) -> Field:
    """Return the control of a setting of the planner. parts: the result of `_parts_of`."""
    setting = SETTINGS[name]
    bare_kind = bare(choices.kinds[name])
    text = shown_value(getattr(parts[setting.group], setting.field))
    kind: Kind = "check" if isinstance(text, bool) else "text"
    values: tuple[str, ...] = ()
    if isinstance(bare_kind, inspect.LiteralType):
        kind = "choice"
        values = tuple(map(str, bare_kind.values))
    return Field(
        name=name,
        kind=kind,
        label=setting.field.replace("_", " ").capitalize(),
        value=text,
        unit=setting.unit,
        help=setting.help,
        choices=values,
        group=TITLES[setting.group],
    )
