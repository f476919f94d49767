"""The planner's numbers: of the flight that is shown, while it flies; before, of the flights that START will fly."""

from __future__ import annotations

from functools import partial
from math import inf
from time import perf_counter

import viser

from web.competitor import Competitor
from web.flight_factory import RANGES, FlightFactory
from web.page.html import box, small, text
from web.page.race_panel import REPLAY, RacePanel
from web.race import Race, Snapshot
from web.session import Session

HOLD = 0.5  # [s] after a slider was moved by hand, before it follows the race again
LABELS = {"sigma": "Sigma scale", "target_ess": "Target ESS"}  # where it is not the name itself


def label_of(name: str) -> str:
    return LABELS.get(name, name.replace("_", " ").capitalize())


class SamplerPanel:
    """A slider moved before START is flown by every sampler of the race, moved in flight by every one that flies."""

    def __init__(self, gui: viser.GuiApi, session: Session, flight_factory: FlightFactory, race: RacePanel):
        self._session, self._flight_factory, self._race = session, flight_factory, race
        self._moved: dict[str, float] = {}  # for the next START
        self._moved_at: dict[str, float] = dict.fromkeys(RANGES, -inf)  # by hand [s]
        self.sliders: dict[str, viser.GuiSliderHandle] = {}
        with gui.add_folder("Planner"):
            self._whose = gui.add_html("")
            for name, value in self._preset().items():
                low, high, step = RANGES[name]
                self.sliders[name] = gui.add_slider(label_of(name), low, high, step, type(low)(value))
                self.sliders[name].on_update(partial(self._moved_by, name))
            self.reset = gui.add_button("Reset to preset", icon=viser.Icon.ARROW_BACK_UP, color="gray")
        self.reset.on_click(lambda _: self._reset())
        race.numbers = lambda: dict(self._moved)
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
        if shown is None:
            moved = ", ".join(label_of(name) for name in self._moved)
            return f"of the next flight; every sampler flies: {moved}" if moved else "of the next flight: the preset's"
        if not flying:
            return f"of {text(shown.name)} at this time"
        return f"of {text(shown.name)}; a slider acts on " + ("every sampler" if flying > 1 else "its next plan")

    def _preset(self) -> dict[str, float]:
        return self._flight_factory.numbers(self._race.preset.value, self._race.sampler.value)

    def _reset(self) -> None:
        self._moved.clear()
        for name in RANGES:
            self._session.tell(Race.tune, name, None)

    async def _moved_by(self, name: str, event: viser.GuiEvent) -> None:
        """Not on another thread, as other callbacks: a START right after it must find the number."""
        if event.client_id is not None:  # by a visitor, not by update()
            self._moved_at[name] = perf_counter()
            self._moved[name] = self.sliders[name].value
            self._session.tell(Race.tune, name, self._moved[name])
