"""The planner's numbers: of the flight that is shown, or of those that START will fly."""

from __future__ import annotations

from functools import partial
from itertools import groupby
from math import inf
from time import perf_counter
from typing import Any, NamedTuple

import viser
from msgspec import inspect

from quadsim.spec.settings import Kind, SettingValue, bare
from web.choices import PILOT, planner_settings, preset_of
from web.competitor import Competitor
from web.numbers import SLIDERS, Change, numbers_of
from web.page.html import box, small, text
from web.page.race_panel import RacePanel
from web.race import PageRace, Snapshot
from web.session import Session

TITLES = {"sampling": "Sampling", "mppi": "MPPI", "cost": "Cost", "model": "Model of the vehicle"}
HOLD = 0.5  # [s] after a slider was moved by hand, before it follows the race again
HAVE_SLIDERS = {slider.setting for slider in SLIDERS.values()}


class SamplerPanel:
    """The sliders of the planner's numbers.

    A slider moved before START is flown by every sampler of the race, moved in flight by every one
    that flies.

    Attributes:
        moved: numbers that the next START will fly in place of the preset's.
    """

    def __init__(self, gui: viser.GuiApi, session: Session, race: RacePanel):
        self._session = session
        self._race = race
        self.moved: dict[str, float] = {}
        self._moved_at: dict[str, float] = dict.fromkeys(SLIDERS, -inf)  # by hand [s]
        self.sliders: dict[str, viser.GuiSliderHandle] = {}
        # Colored sampling has every number that has a slider.
        settings = planner_settings(race.preset.value, race.vehicle.value, "colored")
        numbers = self._preset_numbers()
        with gui.add_folder("Planner"):
            self._whose = gui.add_html("")
            for name, slider in SLIDERS.items():
                handle = gui.add_slider(
                    slider.label,
                    min=slider.low,
                    max=slider.high,
                    step=slider.step,
                    initial_value=type(slider.low)(numbers[name]),
                    hint=settings[slider.setting].setting.help,
                )
                handle.on_update(partial(self._moved_by, name))
                self.sliders[name] = handle
            self.others = OtherNumbers(gui, race)
            back = viser.Icon.ARROW_BACK_UP
            self.reset = gui.add_button("Reset to preset", icon=back, color="gray")
        self.reset.on_click(self._reset)
        for control in (race.preset, race.sampler):
            control.on_update(self._forget_moved)

    def update(self, s: Snapshot) -> None:
        """Show the numbers of what flies or is replayed, else those that START will fly."""
        flying = [entry for entry in s.competitors if entry.outcome is None]
        shown: Competitor | None = None
        if flying:
            shown = flying[0]
        elif self._race.is_replay and s.competitors:
            shown = s.competitors[0]
        numbers = shown.numbers(s.t) if shown else {**self._preset_numbers(), **self.moved}
        self._whose.content = box(small(self._whose_numbers(shown, len(flying))))
        now = perf_counter()
        for name, slider in self.sliders.items():
            slider.disabled = self._race.is_replay and not flying
            if now - self._moved_at[name] > HOLD:
                value = type(slider.value)(numbers[name])
                # A number beyond its slider's range widens the range.
                slider.min = min(slider.min, value)
                slider.max = max(slider.max, value)
                slider.value = value

    def _whose_numbers(self, shown: Competitor | None, flying: int) -> str:
        """Return a line that names the flight whose numbers the sliders show."""
        if shown:
            has_pilot = bool(shown.spec.get("pilot"))
        else:
            has_pilot = self._race.sampler.value.startswith(PILOT)
        if has_pilot:
            return "a learned pilot has none of these numbers"
        if shown is None:
            if not self.moved:
                return "of the next flight: the preset's"
            moved = ", ".join(SLIDERS[name].label for name in self.moved)
            return f"of the next flight; every sampler flies: {moved}"
        if not flying:
            return f"of {text(shown.name)} at this time"
        whom = "every sampler" if flying > 1 else "its next plan"
        return f"of {text(shown.name)}; a slider acts on {whom}"

    def _preset_numbers(self) -> dict[str, float]:
        """Return the numbers of the preset that is chosen."""
        preset = preset_of(self._race.preset.value, self._race.sampler.value)
        return numbers_of(preset, preset)

    # The callbacks are coroutines, which viser runs one after another on its event loop, in the
    # order of the messages: others run on several threads at once. A START right after a slider
    # was moved must find its number.

    async def _moved_by(self, name: str, event: viser.GuiEvent) -> None:
        if event.client_id is None:  # by update(), not by a visitor
            return
        value = self.sliders[name].value
        self._moved_at[name] = perf_counter()
        self.moved = {**self.moved, name: value}
        self._session.tell(PageRace.change, Change(name, value))

    async def _forget_moved(self, _: viser.GuiEvent) -> None:
        self.moved = {}

    async def _reset(self, _: viser.GuiEvent) -> None:
        self.moved = {}
        self.others.show_preset()
        for name in SLIDERS:
            self._session.tell(PageRace.change, Change(name, None))


class Field(NamedTuple):
    """A control of a setting."""

    control: Any
    preset: Any  # the control's value for the preset
    found: SettingValue


class OtherNumbers:
    """Every number of the planner that has no slider, made from its annotated settings.

    What is changed is flown by the next START, by every sampler that has it.
    """

    def __init__(self, gui: viser.GuiApi, race: RacePanel):
        self._gui = gui
        self._race = race
        self._fields: dict[str, Field] = {}
        self._folder = gui.add_folder("All numbers, from the next START", expand_by_default=False)
        self._groups: list[viser.GuiFolderHandle] = []
        self.show_preset()
        for control in (race.preset, race.vehicle, race.sampler):
            control.on_update(self._preset_chosen)

    def show_preset(self) -> None:
        """Show the numbers of the preset, vehicle and sampler that are chosen."""
        for group in self._groups:
            group.remove()
        self._groups = []
        self._fields = {}
        settings = self._settings(self._race.sampler.value).items()
        for group, members in groupby(settings, key=lambda item: item[1].setting.group):
            with self._folder:
                folder = self._gui.add_folder(TITLES[group], expand_by_default=False)
            self._groups.append(folder)
            with folder:
                for name, found in members:
                    self._fields[name] = self._add(found)

    def changed(self, sampler: str) -> dict[str, Any]:
        """Return a sampler's settings of quadsim.fly that differ from the preset."""
        known = self._settings(sampler)
        return {
            name: read(field.control.value, field.found.kind)
            for name, field in self._fields.items()
            if field.control.value != field.preset and name in known
        }

    async def _preset_chosen(self, _: viser.GuiEvent) -> None:
        """Show another preset; as a coroutine, so that no two threads do so at once."""
        self.show_preset()

    def _settings(self, sampler: str) -> dict[str, SettingValue]:
        """Return the settings of a sampler's planner, without those that have a slider."""
        preset = self._race.preset.value
        found = planner_settings(preset, self._race.vehicle.value, sampler)
        return {name: value for name, value in found.items() if name not in HAVE_SLIDERS}

    def _add(self, found: SettingValue) -> Field:
        """Add the control of a setting."""
        setting = found.setting
        label = setting.field.replace("_", " ").capitalize()
        if setting.unit:
            label += f" [{setting.unit}]"
        kind = bare(found.kind)
        default = found.value
        control: Any
        if isinstance(default, bool):
            control = self._gui.add_checkbox(label, default, hint=setting.help)
        elif isinstance(kind, inspect.LiteralType):
            control = self._gui.add_dropdown(
                label, kind.values, initial_value=default, hint=setting.help
            )
        else:
            numbers = default if isinstance(default, tuple) else (default,)
            shown = " ".join("none" if x is None else f"{x:.6g}" for x in numbers)
            control = self._gui.add_text(label, shown, hint=setting.help)
        return Field(control, control.value, found)


def read(value: Any, kind: Kind) -> Any:
    """Return a control's value as a setting of quadsim.fly, which says what is wrong with it."""
    if not isinstance(value, str):
        return value
    if isinstance(bare(kind), inspect.TupleType):
        return value.split()
    return None if value.strip().lower() == "none" else value
