"""The planner's numbers: of the flight that is shown, while it flies; before, of the flights that
START will fly."""

from __future__ import annotations

import re
from functools import partial
from itertools import groupby
from math import inf
from time import perf_counter
from typing import Any

import viser
from msgspec import inspect

from quadsim.spec.settings import Setting, bare
from web.competitor import Competitor
from web.flight_factory import PILOT, RANGES, FlightFactory
from web.page.html import box, small, text
from web.page.race_panel import REPLAY, RacePanel
from web.race import Race, Snapshot
from web.session import Session

TITLES = {"sampling": "Sampling", "mppi": "MPPI", "cost": "Cost", "model": "Model of the vehicle"}
HOLD = 0.5  # [s] after a slider was moved by hand, before it follows the race again
LABELS = {"sigma": "Sigma scale", "target_ess": "Target ESS"}  # where it is not the name itself


def label_of(name: str) -> str:
    return LABELS.get(name, name.replace("_", " ").capitalize())


class SamplerPanel:
    """A slider moved before START is flown by every sampler of the race, moved in flight by every
    one that flies."""

    def __init__(
        self, gui: viser.GuiApi, session: Session, flight_factory: FlightFactory, race: RacePanel
    ):
        self._session, self._flight_factory, self._race = session, flight_factory, race
        self._moved: dict[str, float] = {}  # for the next START
        self._moved_at: dict[str, float] = dict.fromkeys(RANGES, -inf)  # by hand [s]
        self.sliders: dict[str, viser.GuiSliderHandle] = {}
        with gui.add_folder("Planner"):
            self._whose = gui.add_html("")
            for name, value in self._preset().items():
                low, high, step = RANGES[name]
                self.sliders[name] = gui.add_slider(
                    label_of(name), low, high, step, type(low)(value)
                )
                self.sliders[name].on_update(partial(self._moved_by, name))
            self.others = OtherNumbers(gui, flight_factory, race)
            self.reset = gui.add_button(
                "Reset to preset", icon=viser.Icon.ARROW_BACK_UP, color="gray"
            )
        self.reset.on_click(lambda _: self._reset())
        race.numbers, race.settings = lambda: dict(self._moved), self.others.changed
        for control in (race.preset, race.sampler):
            control.on_update(lambda _: self._moved.clear())

    def update(self, s: Snapshot) -> None:
        """Show the numbers of what flies or is replayed, else those that START will fly."""
        replay = self._race.mode.value == REPLAY
        flying = [e for e in s.competitors if e.outcome is None]
        shown = (flying or (s.competitors if replay else ()) or (None,))[0]
        numbers = shown.numbers(s.t) if shown else {**self._preset(), **self._moved}
        self._whose.content = box(small(self._whose_numbers(shown, len(flying))))
        now = perf_counter()
        for name, slider in self.sliders.items():
            slider.disabled = replay and not flying
            if now - self._moved_at[name] > HOLD:
                value = type(slider.value)(numbers[name])
                slider.min, slider.max = min(slider.min, value), max(slider.max, value)
                slider.value = value

    def _whose_numbers(self, shown: Competitor | None, flying: int) -> str:
        if shown.spec.get("pilot") if shown else self._race.sampler.value.startswith(PILOT):
            return "a learned pilot has none of these numbers"
        if shown is None:
            moved = ", ".join(label_of(name) for name in self._moved)
            return (
                f"of the next flight; every sampler flies: {moved}"
                if moved
                else "of the next flight: the preset's"
            )
        if not flying:
            return f"of {text(shown.name)} at this time"
        return f"of {text(shown.name)}; a slider acts on " + (
            "every sampler" if flying > 1 else "its next plan"
        )

    def _preset(self) -> dict[str, float]:
        return self._flight_factory.numbers(self._race.preset.value, self._race.sampler.value)

    def _reset(self) -> None:
        self._moved.clear()
        self.others.show_preset()
        for name in RANGES:
            self._session.tell(Race.tune, name, None)

    async def _moved_by(self, name: str, event: viser.GuiEvent) -> None:
        """Not on another thread, as other callbacks: a START right after it must find the
        number."""
        if event.client_id is not None:  # by a visitor, not by update()
            self._moved_at[name] = perf_counter()
            self._moved[name] = self.sliders[name].value
            self._session.tell(Race.tune, name, self._moved[name])


class OtherNumbers:
    """Every number of the planner that has no slider, from its dataclasses. What is changed is
    flown by the next START, by every sampler that has it.
    """

    def __init__(self, gui: viser.GuiApi, flight_factory: FlightFactory, race: RacePanel):
        self._gui, self._flight_factory, self._race = gui, flight_factory, race
        # name -> control, its value of the preset
        self._fields: dict[str, tuple[Any, Any, Setting]] = {}
        self._folder = gui.add_folder("All numbers, from the next START", expand_by_default=False)
        self._groups: list[viser.GuiFolderHandle] = []
        self.show_preset()
        for control in (race.preset, race.vehicle, race.sampler):
            control.on_update(lambda _: self.show_preset())

    def show_preset(self) -> None:
        """Controls with the numbers of the preset, vehicle and sampler that are chosen."""
        for group in self._groups:
            group.remove()
        self._groups, self._fields = [], {}
        settings = list(self._settings(self._race.sampler.value).items())
        for title, members in groupby(settings, key=lambda item: item[1].group):
            with self._folder:
                self._groups.append(self._gui.add_folder(TITLES[title], expand_by_default=False))
            with self._groups[-1]:
                for name, setting in members:
                    self._fields[name] = self._add(name.removeprefix("model."), setting)

    def changed(self, sampler: str) -> dict[str, Any]:
        """What differs from the preset and this sampler has, as settings of quadsim.fly."""
        known = self._settings(sampler)
        return {
            n: _read(c.value, s)
            for n, (c, preset, s) in self._fields.items()
            if c.value != preset and n in known
        }

    def _settings(self, sampler: str) -> dict[str, Setting]:
        return self._flight_factory.settings(
            self._race.preset.value, self._race.vehicle.value, sampler
        )

    def _add(self, name: str, setting: Setting) -> tuple[Any, Any, Setting]:
        unit = re.search(r" (\[[^]]+\])", setting.help)
        label, kind = (
            name.replace("_", " ").capitalize() + (f" {unit[1]}" if unit else ""),
            bare(setting.kind),
        )
        if isinstance(setting.default, bool):
            control: Any = self._gui.add_checkbox(label, setting.default, hint=setting.help)
        elif isinstance(kind, inspect.LiteralType):
            control = self._gui.add_dropdown(
                label, kind.values, initial_value=setting.default, hint=setting.help
            )
        else:
            values = setting.default if isinstance(setting.default, tuple) else (setting.default,)
            words = " ".join("none" if v is None else f"{v:.6g}" for v in values)
            control = self._gui.add_text(label, words, hint=setting.help)
        return control, control.value, setting


def _read(value: Any, setting: Setting) -> Any:
    """The setting as a file would hold it; Spec.of says what is wrong with it."""
    if not isinstance(value, str):
        return value
    if isinstance(bare(setting.kind), inspect.TupleType):
        return value.split()
    return None if value.strip().lower() == "none" else value
