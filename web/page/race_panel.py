"""What to fly or to replay, and the button that starts it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import viser

from quadsim.course import Course, load_course
from quadsim.files.strict_yaml import FileError
from quadsim.sensing import PERFECT
from web.flight_factory import Choices
from web.page.messages import Visitors
from web.race import Race, Snapshot
from web.session import Session

LIVE, GHOSTS, AGAINST, REPLAY = MODES = (
    "live",
    "live: two samplers",
    "live against a run",
    "replay",
)
NONE: str = "none"
RUNS = 200  # latest that are offered
LAPS = (1, 2, 3, 5, 10, 20, 50, 100)


@dataclass(frozen=True)
class Menu:
    """What there is to choose from."""

    courses: tuple[str, ...]
    vehicles: tuple[str, ...]
    presets: Mapping[str, str]  # name -> the vehicle it is meant for
    samplers: tuple[str, ...]  # and learned pilots, see web.flight_factory.PILOT
    sensings: tuple[str, ...] = (PERFECT,)


class RacePanel:
    def __init__(
        self, gui: viser.GuiApi, session: Session, menu: Menu, first: Choices, visitors: Visitors
    ):
        """`numbers` and `settings` are to be replaced by what asks the controls of the planner."""
        self._session, self._menu, self._visitors = session, menu, visitors
        self.numbers: Callable[[], dict[str, float]] = dict  # that are not the preset's
        self.settings: Callable[[str], dict[str, Any]] = lambda _: {}  # the same, for a sampler
        self._loaded: tuple[str, Course | None] = "", None
        self._paths: dict[str, Path] = {}  # of the stored runs, by title
        with gui.add_folder("Race"):
            self.mode = gui.add_dropdown("Mode", MODES, initial_value=LIVE)
            self.course = gui.add_dropdown("Course", menu.courses, initial_value=first.course)
            self.preset = gui.add_dropdown(
                "Preset", tuple(menu.presets), initial_value=first.preset
            )
            self.vehicle = gui.add_dropdown("Vehicle", menu.vehicles, initial_value=first.vehicle)
            self.sampler = gui.add_dropdown("Sampler", menu.samplers, initial_value=first.sampler)
            self.second = gui.add_dropdown(
                "Second sampler", menu.samplers, initial_value="gaussian"
            )
            hint = "what the vehicle knows its state by; perfect: the true state"
            self.sensing = gui.add_dropdown(
                "Sensing", menu.sensings, initial_value=first.sensing, hint=hint
            )
            self.seed = gui.add_number("Seed", first.seed, min=0, max=10**9, step=1)
            options = (self._own_laps(), *map(str, sorted({*LAPS, first.laps} - {0})))
            self.laps = gui.add_dropdown(
                "Laps", options, initial_value=str(first.laps) if first.laps else options[0]
            )
            self.run = gui.add_dropdown("Run", (NONE,), initial_value=NONE)
            self.second_run = gui.add_dropdown("Second run", (NONE,), initial_value=NONE)
            self.start = gui.add_button("START", icon=viser.Icon.FLAG, color="orange")
            self.stop = gui.add_button(
                "STOP", icon=viser.Icon.PLAYER_STOP, color="red", disabled=True
            )
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
        titles = {path: title for title, path in self._paths.items()}
        for control, path in zip((self.run, self.second_run), runs, strict=False):
            if path in titles:
                control.value = titles[path]

    def refresh(self) -> None:
        """List the stored runs, the latest first."""
        self._paths = self._session.titled_runs(RUNS)
        options = (NONE, *self._paths)
        for control in (self.run, self.second_run):
            if control.options != options:
                control.options = options  # a run that is gone becomes NONE
        if self.run.value == NONE and len(options) > 1:
            self.run.value = options[1]

    def update(self, s: Snapshot) -> None:
        self.stop.disabled = not s.flying
        # viser sends options also where they stay
        if self.laps.options[0] != (own := self._own_laps()):
            self.laps.options = (own, *self.laps.options[1:])

    def preview(self) -> Course | None:
        """The course that START will fly, None where a stored run is shown instead."""
        return None if self.mode.value == REPLAY else self._course()

    def _course(self) -> Course | None:
        """As it was when it was chosen; None: its file cannot be read, START will say why."""
        if self._loaded[0] != self.course.value:
            self._loaded = self.course.value, None
            with suppress(FileError):
                self._loaded = self.course.value, load_course(self.course.value)
        return self._loaded[1]

    def _own_laps(self) -> str:
        course = self._course()
        return f"course ({course.laps})" if course else "course"

    def _show_controls(self) -> None:
        """Only those that the mode needs."""
        mode = self.mode.value
        for control in (
            self.course,
            self.preset,
            self.vehicle,
            self.sampler,
            self.sensing,
            self.seed,
            self.laps,
        ):
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
        self._visitors.end_flight(
            event, self._session.snapshot.flying, lambda: self._session.tell(Race.restart)
        )

    def _start(self) -> None:
        mode = self.mode.value
        names = {AGAINST: [self.run.value], REPLAY: [self.run.value, self.second_run.value]}.get(
            mode, []
        )
        samplers = {REPLAY: [], GHOSTS: [self.sampler.value, self.second.value]}.get(
            mode, [self.sampler.value]
        )
        runs = [self._paths[name] for name in names if name in self._paths]
        self._session.tell(Race.start, [self._choices(sampler) for sampler in samplers], runs)

    def _choices(self, sampler: str) -> Choices:
        return Choices(
            course=self.course.value,
            vehicle=self.vehicle.value,
            preset=self.preset.value,
            sampler=sampler,
            sensing=self.sensing.value,
            seed=int(self.seed.value),
            laps=int(self.laps.value) if self.laps.value.isdigit() else 0,
            numbers=self.numbers(),
            settings=self.settings(sampler),
        )

    def _choose_vehicle(self) -> None:
        self.vehicle.value = self._menu.presets[self.preset.value]

    def _choose_course(self) -> None:
        """A live flight beside a stored run flies the run's course, which its name contains."""
        path = self._paths.get(self.run.value)
        found = [c for c in self.course.options if path and f"_{c}_" in path.name]
        if self.mode.value == AGAINST and found:
            self.course.value = max(found, key=len)
