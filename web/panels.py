"""The controls of a race that is on: the planner's numbers, the playback."""

from __future__ import annotations

from dataclasses import fields
from math import inf
from time import perf_counter

import viser

from web.choices import RANGES, FlightFactory, Numbers
from web.race import Race, Snapshot
from web.race_panel import RacePanel
from web.session import Session

HAND = 0.4  # [s] that the time slider stays where a hand has put it
SPEEDS = ("0.1", "0.25", "0.5", "1", "2", "4")
NAMES = {"sigma": "sigma x", "gamma_rates": "gamma rates", "gamma_thrust": "gamma thrust", "target_ess": "ESS target"}


class SamplerPanel:
    """The planner's numbers, live: they act at the next plan."""

    def __init__(self, gui: viser.GuiApi, session: Session, flight_factory: FlightFactory, race: RacePanel):
        self._session, self._hangar, self._race = session, flight_factory, race
        self.sliders: dict[str, viser.GuiSliderHandle] = {}
        self._preset = flight_factory.numbers(race.preset.value, race.sampler.value)
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
        off = bool(s.competitors) and not any(competitor.live for competitor in s.competitors)
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
        self._scrubbed_at = inf  # when somebody last moved the time [s]
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
            self._scrubbed_at = perf_counter()

    def update(self, s: Snapshot) -> None:
        end = round(max(s.end, 1.0), 2)
        if self.time.max != end:
            self.time.max = end
        if self.time.disabled != s.flying:
            self.time.disabled = s.flying
        self._show(min(round(s.t, 2), end))

    def _show(self, at: float) -> None:
        """The hand on the slider wins for a moment. Then everyone is told again, as an older time, on its way while
        somebody let go, may have been the last to arrive there."""
        since = perf_counter() - self._scrubbed_at
        if 0.0 <= since < HAND:
            return
        if since >= HAND:
            self._scrubbed_at = inf
            self.time.value = self._shown = at + 0.01 if at < 0.01 else at - 0.01  # viser sends changes only
        if self.time.value != at:
            self.time.value = self._shown = at
