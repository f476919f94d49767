"""What to fly or to replay, and the button that starts it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import viser

from web.choices import Choices, Numbers
from web.race import Race
from web.session import Session

LIVE, GHOSTS, AGAINST, REPLAY = "live", "live: two samplers", "live against a run", "replay"
NONE = "none"


@dataclass(frozen=True)
class Menu:
    """What there is to choose from."""

    courses: tuple[str, ...]
    vehicles: tuple[str, ...]
    presets: Mapping[str, str]  # name -> the vehicle it is meant for
    samplers: tuple[str, ...]


class RacePanel:
    """What to fly or to replay, and START."""

    def __init__(self, gui: viser.GuiApi, session: Session, menu: Menu, first: Choices):
        self._session = session
        self.numbers: Callable[[], Numbers | None] = lambda: None
        nothing: tuple[str, ...] = (NONE,)
        with gui.add_folder("Race"):
            self.mode = gui.add_dropdown("Mode", (LIVE, GHOSTS, AGAINST, REPLAY), initial_value=LIVE)
            self.course = gui.add_dropdown("Course", menu.courses, initial_value=first.course)
            self.preset = gui.add_dropdown("Preset", tuple(menu.presets), initial_value=first.preset)
            self.vehicle = gui.add_dropdown("Vehicle", menu.vehicles, initial_value=first.vehicle)
            self.sampler = gui.add_dropdown("Sampler", menu.samplers, initial_value=first.sampler)
            self.second = gui.add_dropdown("and", menu.samplers, initial_value="gaussian")
            self.seed = gui.add_number("Seed", first.seed, min=0, max=10**9, step=1)
            self.laps = gui.add_number("Laps", first.laps, min=0, max=100, step=1, hint="0: as many as the course says")
            self.run = gui.add_dropdown("Run", nothing, initial_value=nothing[0])
            self.other = gui.add_dropdown("and run", nothing, initial_value=nothing[0])
            self.start = gui.add_button("START", icon=viser.Icon.FLAG, color="orange")
        self.start.on_click(lambda _: self.go())
        self.mode.on_update(lambda _: self.arrange())
        self.preset.on_update(lambda _: self._fit_vehicle(menu))
        self.run.on_update(lambda _: self._show_course())
        self.refresh()
        self.arrange()

    def arrange(self) -> None:
        """Only what the mode asks for."""
        live, mode = self.mode.value != REPLAY, self.mode.value
        for control in (self.course, self.preset, self.vehicle, self.sampler, self.seed, self.laps):
            control.visible = live
        self.second.visible = mode == GHOSTS
        self.run.visible = mode in (AGAINST, REPLAY)
        self.other.visible = mode == REPLAY
        self.start.label = "START" if live else "REPLAY"

    def replaying(self, runs: Sequence[Path]) -> None:
        """These are being replayed."""
        self.mode.value = REPLAY
        for control, path in zip((self.run, self.other), runs, strict=False):
            if path.name in control.options:
                control.value = path.name

    def refresh(self) -> None:
        """Runs come and go. Names only; a run is read when it is chosen."""
        names = tuple(path.name for path in self._session.runs()[:200])
        controls: Any = (self.run, self.other)
        for control in controls:
            options = (NONE, *names)
            if control.options != options:
                kept = control.value
                control.options = options
                control.value = kept if kept in options else NONE
        if controls[0].value == NONE and names:
            controls[0].value = names[0]

    def go(self) -> None:
        runs = self._chosen() if self.mode.value in (AGAINST, REPLAY) else []
        if self.mode.value == REPLAY:
            self._session.tell(Race.start, [], runs)
        else:
            samplers = [self.sampler.value] + ([self.second.value] if self.mode.value == GHOSTS else [])
            self._session.tell(Race.start, [self._choices(s) for s in samplers], runs[:1])

    def _choices(self, sampler: str) -> Choices:
        numbers = self.numbers() if sampler == self.sampler.value else None
        who = (self.course.value, self.vehicle.value, self.preset.value, sampler)
        return Choices(*who, int(self.seed.value), int(self.laps.value), numbers)

    def _chosen(self) -> list[Path]:
        by_name = {path.name: path for path in self._session.runs()}
        wanted = [self.run.value] + ([self.other.value] if self.mode.value == REPLAY else [])
        return [by_name[name] for name in wanted if name in by_name]

    def _fit_vehicle(self, menu: Menu) -> None:
        self.vehicle.value = menu.presets[self.preset.value]

    def _show_course(self) -> None:
        """A ghost flies its own course."""
        fits = [c for c in self.course.options if f"_{c}_" in self.run.value]
        if self.mode.value == AGAINST and fits:
            self.course.value = max(fits, key=len)
