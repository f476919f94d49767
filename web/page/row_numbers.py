"""RowNumbers: the planner's numbers of the edited competitor, for the next START."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from itertools import groupby
from typing import Any, NamedTuple

import viser
from msgspec import inspect

from quadsim.config.settings import Kind, SettingValue, bare
from quadsim.files.values import checked
from web.choices import Choices, planner_settings
from web.numbers import SLIDERS, numbers_of

TITLES = {"sampling": "Sampling", "mppi": "MPPI", "cost": "Cost", "model": "Model of the vehicle"}
# Settings with a slider for the whole number; sliders of sigma and gamma control a part of one
HAVE_SLIDERS = {"temperature", "target_ess", "samples"}
DIGITS = 6  # of the decimals that a box takes

# makes another competitor of one, and may raise ValueError
Step = Callable[[Choices], Choices]
Edit = Callable[[viser.GuiEvent, Step], None]


class Field(NamedTuple):
    """A control of a setting."""

    control: Any
    kind: Kind


class RowNumbers:
    """The sliders, and a control for each setting of the planner.

    They show the numbers of one competitor. Only the owner calls `show`, on viser's event loop;
    callbacks are coroutines, which run one after another on that loop.

    Args:
        first: the initial competitor.
        edit: called when a visitor has changed a number.
    """

    def __init__(self, gui: viser.GuiApi, first: Choices, edit: Edit):
        self._gui = gui
        self._edit = edit
        self.sliders = add_sliders(gui, first, "")
        for name, slider in self.sliders.items():
            slider.on_update(partial(self._moved, name))
        self._folder = gui.add_folder("All numbers", expand_by_default=False)
        self._groups: list[viser.GuiFolderHandle] = []
        self._fields: dict[str, Field] = {}
        self.show(first)

    def show(self, row: Choices) -> None:
        """Show the numbers of a competitor."""
        known = planner_settings(row.preset, row.vehicle, row.sampler)
        planner = row.planner
        show_numbers(self.sliders, numbers_of(planner, row.base))
        for name, slider in self.sliders.items():
            slider.disabled = SLIDERS[name].setting not in known
        shown = {name: found for name, found in known.items() if name not in HAVE_SLIDERS}
        if {name: found.kind for name, found in shown.items()} != self._kinds():
            self._build(shown)
        parts = {"sampling": planner.sampling, "mppi": planner.mppi, "cost": planner.cost}
        for name, (control, _) in self._fields.items():
            setting = shown[name].setting
            if setting.group in parts:
                value = getattr(parts[setting.group], setting.field)
            else:
                value = row.settings.get(name, shown[name].value)
            control.value = shown_value(value)

    def _kinds(self) -> dict[str, Kind]:
        """Return the kinds of the settings that have a control, by name."""
        return {name: field.kind for name, field in self._fields.items()}

    def _build(self, settings: Mapping[str, SettingValue]) -> None:
        """Replace the controls by the controls of these settings."""
        for group in self._groups:
            group.remove()
        self._groups = []
        self._fields = {}
        for group, members in groupby(settings.items(), key=lambda item: item[1].setting.group):
            with self._folder:
                folder = self._gui.add_folder(TITLES[group], expand_by_default=False)
            self._groups.append(folder)
            with folder:
                for name, found in members:
                    control = self._add(found)
                    control.on_update(partial(self._typed, name))
                    self._fields[name] = Field(control, found.kind)

    def _add(self, found: SettingValue) -> Any:
        """Add the control of a setting."""
        setting = found.setting
        label = setting.field.replace("_", " ").capitalize()
        if setting.unit:
            label += f" [{setting.unit}]"
        kind = bare(found.kind)
        value = shown_value(found.value)
        if isinstance(value, bool):
            return self._gui.add_checkbox(label, value, hint=setting.help)
        if isinstance(kind, inspect.LiteralType):
            return self._gui.add_dropdown(
                label, kind.values, initial_value=value, hint=setting.help
            )
        return self._gui.add_text(label, value, hint=setting.help)

    async def _moved(self, name: str, event: viser.GuiEvent) -> None:
        """Set the number of a slider."""
        if event.client_id is None:  # by show(), not by a visitor
            return
        value = self.sliders[name].value

        def moved(row: Choices) -> Choices:
            return row.with_number(name, checked_number(name, value, row))

        self._edit(event, moved)

    async def _typed(self, name: str, event: viser.GuiEvent) -> None:
        """Set the value of a control."""
        if event.client_id is None or name not in self._fields:
            return
        control, kind = self._fields[name]
        value = read(control.value, kind)
        self._edit(event, lambda row: row.with_setting(name, checked(name, value, kind)))


def add_sliders(gui: viser.GuiApi, first: Choices, ending: str) -> dict[str, viser.GuiSliderHandle]:
    """Add a slider for each number of web.numbers.SLIDERS.

    Args:
        first: the competitor of the initial numbers.
        ending: suffix of the labels.
    """
    numbers = numbers_of(first.base, first.base)
    sliders = {}
    for name, slider in SLIDERS.items():
        value = float(numbers[name])
        handle = gui.add_slider(
            slider.label + ending,
            min=min(float(slider.low), value),
            max=max(float(slider.high), value),
            step=float(slider.step),
            initial_value=value,
            hint=slider.hint,
        )
        handle.precision = DIGITS  # a box takes numbers between the steps
        sliders[name] = handle
    return sliders


def show_numbers(
    sliders: Mapping[str, viser.GuiSliderHandle], numbers: Mapping[str, float]
) -> None:
    """Set the sliders; a number beyond the range of its slider widens the range."""
    for name, slider in sliders.items():
        value = float(numbers[name])
        slider.min = min(slider.min, value)
        slider.max = max(slider.max, value)
        slider.value = value


def checked_number(name: str, value: float, row: Choices) -> float:
    """Return the value of a slider if its setting can have it, else raise SettingError."""
    setting = SLIDERS[name].setting
    if setting not in HAVE_SLIDERS or (setting == "target_ess" and value == 0):
        return value
    found = planner_settings(row.preset, row.vehicle, row.sampler)[setting]
    whole = int(value) if value.is_integer() else value
    checked(setting, whole, found.kind)
    return whole if setting == "samples" else value


def shown_value(value: Any) -> Any:
    """Return a setting's value for its control, numbers as a text."""
    if isinstance(value, bool | str):
        return value
    numbers = value if isinstance(value, tuple) else (value,)
    return " ".join("none" if x is None else f"{x:.10g}" for x in numbers)


def read(value: Any, kind: Kind) -> Any:
    """Return a control's value as a setting of quadsim.fly, which reports invalid values."""
    if not isinstance(value, str):
        return value
    if isinstance(bare(kind), inspect.TupleType):
        return value.split()
    return None if value.strip().lower() == "none" else value
