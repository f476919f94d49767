"""RowNumbers: the planner's numbers of the edited competitor, for the next START."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from itertools import groupby
from typing import Any, NamedTuple

import viser
from msgspec import inspect

from quadsim.config.settings import Kind, SettingValue, bare
from quadsim.web.choices import CompetitorChoices, planner_settings
from quadsim.web.commands import SetNumber, SetSetting
from quadsim.web.numbers import SLIDERS, numbers_of
from quadsim.web.page.set_values import SetValues
from quadsim.web.setting_texts import HAVE_SLIDERS, shown_value

TITLES = {"sampling": "Sampling", "mppi": "MPPI", "cost": "Cost", "model": "Model of the vehicle"}
DIGITS = 6  # of the decimals that a box takes

# Sends a command about a number: SetNumber or SetSetting, the name and the value of the number
Send = Callable[[type, str, Any], None]


class Field(NamedTuple):
    """A control of a setting."""

    control: Any
    kind: Kind


class RowNumbers:
    """The sliders, and a control for each setting of the planner.

    They show the numbers of one competitor. Only the page's thread calls `show`; callbacks are
    coroutines on viser's event loop, which send commands.

    Args:
        first: the initial competitor.
        send: called when a visitor has changed a number.
    """

    def __init__(self, gui: viser.GuiApi, first: CompetitorChoices, send: Send):
        self._gui = gui
        self._send = send
        self.sliders = add_sliders(gui, first, "")
        for name, slider in self.sliders.items():
            slider.on_update(partial(self._moved, name))
        self._folder = gui.add_folder("All numbers", expand_by_default=False)
        self._groups: list[viser.GuiFolderHandle] = []
        self._fields: dict[str, Field] = {}
        self.set_values = SetValues()
        self.show(first)

    def show(self, row: CompetitorChoices) -> None:
        """Show the numbers of a competitor."""
        known = planner_settings(row.preset, row.vehicle, row.sampler)
        planner = row.planner
        numbers = numbers_of(planner, row.base)
        for name, slider in self.sliders.items():
            widen(slider, float(numbers[name]))
            self.set_values(name, slider, float(numbers[name]))
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
            self.set_values(f"setting {name}", control, shown_value(value))

    def _kinds(self) -> dict[str, Kind]:
        """Return the kinds of the settings that have a control, by name."""
        return {name: field.kind for name, field in self._fields.items()}

    def _build(self, settings: Mapping[str, SettingValue]) -> None:
        """Replace the controls by the controls of these settings."""
        for group in self._groups:
            group.remove()
        self.set_values.forget(*(f"setting {name}" for name in self._fields), *self.sliders)
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
        self._send(SetNumber, name, self.sliders[name].value)

    async def _typed(self, name: str, event: viser.GuiEvent) -> None:
        """Set the value of a control."""
        if event.client_id is not None:
            self._send(SetSetting, name, event.target.value)


def add_sliders(
    gui: viser.GuiApi, first: CompetitorChoices, ending: str
) -> dict[str, viser.GuiSliderHandle]:
    """Add a slider for each number of quadsim.web.numbers.SLIDERS.

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
        widen(slider, value)
        slider.value = value


def widen(slider: viser.GuiSliderHandle, value: float) -> None:
    """Widen the range of a slider to a value beyond it."""
    slider.min = min(slider.min, value)
    slider.max = max(slider.max, value)
