"""The controls: what can be chosen, tuned and played. They tell the session; nothing here draws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import viser

from web.choices import RANGES, Choices, Hangar, Numbers
from web.race import Race, Snapshot
from web.session import Session

LIVE, GHOSTS, AGAINST, REPLAY = "live", "live: two samplers", "live against a run", "replay"
NONE = "none"
SPEEDS = ("0.1", "0.25", "0.5", "1", "2", "4")
NAMES = {"sigma": "sigma x", "gamma_rates": "gamma rates", "gamma_thrust": "gamma thrust", "ess": "ESS aim"}


@dataclass(frozen=True)
class Menu:
    """What there is to choose from."""

    courses: tuple[str, ...]
    vehicles: tuple[str, ...]
    presets: tuple[str, ...]
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
            self.preset = gui.add_dropdown("Preset", menu.presets, initial_value=first.preset)
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

    def _show_course(self) -> None:
        """A ghost flies its own course."""
        fits = [c for c in self.course.options if f"_{c}_" in self.run.value]
        if self.mode.value == AGAINST and fits:
            self.course.value = max(fits, key=len)


class SamplerPanel:
    """The planner's numbers, live: they act at the next plan."""

    def __init__(self, gui: viser.GuiApi, session: Session, hangar: Hangar, race: RacePanel):
        self._session, self._hangar, self._race = session, hangar, race
        self.sliders: dict[str, viser.GuiSliderHandle] = {}
        self._preset = hangar.numbers(race.preset.value, race.sampler.value)
        with gui.add_folder("Sampler (live)"):
            for name, (low, high, step) in RANGES.items():
                kind = int if isinstance(getattr(self._preset, name), int) else float
                label, at = NAMES.get(name, name), self._within(name)
                slider = gui.add_slider(label, kind(low), kind(high), kind(step), kind(at))
                slider.on_update(self._changed)
                self.sliders[name] = slider
        race.numbers = self._asked
        race.preset.on_update(lambda _: self.reset())
        race.sampler.on_update(lambda _: self.reset())

    def reset(self) -> None:
        """The numbers of the preset and sampler chosen."""
        self._preset = self._hangar.numbers(self._race.preset.value, self._race.sampler.value)
        for name, slider in self.sliders.items():
            slider.value = self._within(name)

    def enable(self, s: Snapshot) -> None:
        """A stored run cannot be tuned any more."""
        off = bool(s.lanes) and not any(lane.live for lane in s.lanes)
        for slider in self.sliders.values():
            if slider.disabled != off:
                slider.disabled = off

    def _within(self, name: str) -> float | int:
        low, high, _ = RANGES[name]
        value = getattr(self._preset, name)
        return type(value)(min(max(value, low), high))

    def _now(self) -> Numbers:
        kinds = {f.name: type(getattr(self._preset, f.name)) for f in fields(Numbers)}
        return Numbers(**{name: kinds[name](slider.value) for name, slider in self.sliders.items()})

    def _asked(self) -> Numbers | None:
        """None where nobody has moved a slider: then the preset counts, also where it is outside their ranges."""
        return None if all(s.value == self._within(name) for name, s in self.sliders.items()) else self._now()

    def _changed(self, event: viser.GuiEvent) -> None:
        if event.client_id is not None:  # a person, not reset()
            self._session.tell(Race.tune, self._now())


class PlaybackPanel:
    """Pause, step, scrub, speed."""

    def __init__(self, gui: viser.GuiApi, session: Session):
        self._session, self._shown = session, 0.0
        with gui.add_folder("Playback"):
            self.time = gui.add_slider("Time [s]", 0.0, 1.0, 0.01, 0.0)
            self.buttons = gui.add_button_group("", ("<", "pause", ">", "event"))
            self.again = gui.add_button("Restart", icon=viser.Icon.REPEAT, color="gray")
            self.speed = gui.add_dropdown("Speed", SPEEDS, initial_value="1")
        does = {"<": (Race.step, -1), "pause": (Race.play,), ">": (Race.step, 1), "event": (Race.jump,)}
        self.buttons.on_click(lambda e: session.tell(*does[e.target.value]))
        self.again.on_click(lambda _: session.tell(Race.restart))
        self.speed.on_update(lambda _: session.tell(Race.set_speed, float(self.speed.value)))
        self.time.on_update(self._scrubbed)

    def _scrubbed(self, event: viser.GuiEvent) -> None:
        if event.client_id is not None and self.time.value != self._shown:
            self._session.tell(Race.play, False)
            self._session.tell(Race.scrub, float(self.time.value))

    def update(self, s: Snapshot) -> None:
        end = round(max(s.end, 1.0), 2)
        if self.time.max != end:
            self.time.max = end
        if self.time.disabled != s.flying:
            self.time.disabled = s.flying
        at = min(round(s.t, 2), end)
        if self.time.value != at:
            self._shown = at
            self.time.value = at
