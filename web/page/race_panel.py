"""What to fly or to replay, and the button that starts it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import viser

from web.flight_factory import Choices
from web.page.messages import Visitors
from web.race import Race, Snapshot
from web.session import Session

LIVE, GHOSTS, AGAINST, REPLAY = MODES = ("live", "live: two samplers", "live against a run", "replay")
NONE: str = "none"
RUNS = 200  # latest that are offered


@dataclass(frozen=True)
class Menu:
    """What there is to choose from."""

    courses: tuple[str, ...]
    vehicles: tuple[str, ...]
    presets: Mapping[str, str]  # name -> the vehicle it is meant for
    samplers: tuple[str, ...]


class RacePanel:
    def __init__(self, gui: viser.GuiApi, session: Session, menu: Menu, first: Choices, visitors: Visitors):
        """`numbers` is to be replaced by what asks the sliders."""
        self._session, self._menu, self._visitors = session, menu, visitors
        self.numbers: Callable[[], dict[str, float]] = dict  # that are not the preset's
        with gui.add_folder("Race"):
            self.mode = gui.add_dropdown("Mode", MODES, initial_value=LIVE)
            self.course = gui.add_dropdown("Course", menu.courses, initial_value=first.course)
            self.preset = gui.add_dropdown("Preset", tuple(menu.presets), initial_value=first.preset)
            self.vehicle = gui.add_dropdown("Vehicle", menu.vehicles, initial_value=first.vehicle)
            self.sampler = gui.add_dropdown("Sampler", menu.samplers, initial_value=first.sampler)
            self.second = gui.add_dropdown("Second sampler", menu.samplers, initial_value="gaussian")
            self.seed = gui.add_number("Seed", first.seed, min=0, max=10**9, step=1)
            self.laps = gui.add_number("Laps", first.laps, min=0, max=100, step=1, hint="0: as many as the course says")
            self.run = gui.add_dropdown("Run", (NONE,), initial_value=NONE)
            self.second_run = gui.add_dropdown("Second run", (NONE,), initial_value=NONE)
            self.start = gui.add_button("START", icon=viser.Icon.FLAG, color="orange")
            self.stop = gui.add_button("STOP", icon=viser.Icon.PLAYER_STOP, color="red", disabled=True)
        self.start.on_click(self.start_flight)
        self.stop.on_click(self.stop_flight)
        self.mode.on_update(lambda _: self._show_controls())
        self.preset.on_update(lambda _: self._choose_vehicle())
        self.run.on_update(lambda _: self._choose_course())
        self.refresh()
        self._show_controls()

    def show_replay(self, runs: Sequence[Path]) -> None:
        """These are being replayed."""
        self.mode.value = REPLAY
        for control, path in zip((self.run, self.second_run), runs, strict=False):
            if path.name in control.options:
                control.value = path.name

    def refresh(self) -> None:
        """List the stored runs. Names only; a run is read when it is started."""
        options = (NONE, *(path.name for path in self._session.runs()[:RUNS]))
        for control in (self.run, self.second_run):
            if control.options != options:
                control.options = options  # a run that is gone becomes NONE
        if self.run.value == NONE and len(options) > 1:
            self.run.value = options[1]

    def update(self, s: Snapshot) -> None:
        self.stop.disabled = not s.flying

    def _show_controls(self) -> None:
        """Only those that the mode needs."""
        mode = self.mode.value
        for control in (self.course, self.preset, self.vehicle, self.sampler, self.seed, self.laps):
            control.visible = mode != REPLAY
        self.second.visible = mode == GHOSTS
        self.run.visible = mode in (AGAINST, REPLAY)
        self.second_run.visible = mode == REPLAY
        self.start.label = "REPLAY" if mode == REPLAY else "START"

    def start_flight(self, event: viser.GuiEvent | viser.CommandEvent) -> None:
        self._visitors.end_flight(event, self._session.snapshot.flying, self._start)

    def stop_flight(self, event: viser.GuiEvent | viser.CommandEvent) -> None:
        if flying := self._session.snapshot.flying:
            self._visitors.end_flight(event, flying, lambda: self._session.tell(Race.end_flights))

    def restart_flight(self, event: viser.GuiEvent | viser.CommandEvent) -> None:
        self._visitors.end_flight(event, self._session.snapshot.flying, lambda: self._session.tell(Race.restart))

    def _start(self) -> None:
        mode = self.mode.value
        names = {AGAINST: [self.run.value], REPLAY: [self.run.value, self.second_run.value]}.get(mode, [])
        samplers = {REPLAY: [], GHOSTS: [self.sampler.value, self.second.value]}.get(mode, [self.sampler.value])
        stored = {path.name: path for path in self._session.runs()} if names else {}
        runs = [stored[name] for name in names if name in stored]
        self._session.tell(Race.start, [self._choices(sampler) for sampler in samplers], runs)

    def _choices(self, sampler: str) -> Choices:
        return Choices(
            course=self.course.value,
            vehicle=self.vehicle.value,
            preset=self.preset.value,
            sampler=sampler,
            seed=int(self.seed.value),
            laps=int(self.laps.value),
            numbers=self.numbers(),
        )

    def _choose_vehicle(self) -> None:
        self.vehicle.value = self._menu.presets[self.preset.value]

    def _choose_course(self) -> None:
        """A live flight beside a stored run flies the run's course, which its name contains."""
        found = [c for c in self.course.options if f"_{c}_" in self.run.value]
        if self.mode.value == AGAINST and found:
            self.course.value = max(found, key=len)
