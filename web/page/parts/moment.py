"""Moment: the race at a time that is watched. Visitors who watch the same time share it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TypeVar

from quadsim.web.page.parts.charts import RaceCurves, curves_of
from quadsim.web.page.parts.elements import Element
from quadsim.web.page.parts.laps import chatter, laps
from quadsim.web.page.parts.sectors import sectors
from quadsim.web.page.parts.timing import events, planner
from quadsim.web.page.parts.tower import Tower, tower_of
from quadsim.web.race.lap_timing import LapTiming, at_place_of_first, lap_timings
from quadsim.web.race.limit_race import limit_race
from quadsim.web.race.snapshot import Snapshot

Made = TypeVar("Made")


class Moment:
    """The race at one time. A part of it is made when a page first shows it, and then kept.

    Args:
        s: the race as a visitor watches it.
    """

    def __init__(self, s: Snapshot):
        self.s = s
        self._made: dict[object, object] = {}

    @cached_property
    def timings(self) -> list[LapTiming]:
        """The competitors that have a frame."""
        return lap_timings(self.s)

    @cached_property
    def _at_place(self) -> list[LapTiming]:
        return at_place_of_first(self.timings)

    def drawn(self, by_place: bool) -> list[LapTiming]:
        """Return the competitors with the frames that the scene shows."""
        return self._at_place if by_place and self.timings else self.timings

    def once(self, name: object, make: Callable[[], Made]) -> Made:
        """Return what was made under this name, or make it."""
        if name not in self._made:
            self._made[name] = make()
        return self._made[name]  # type: ignore[return-value]

    @cached_property
    def tower(self) -> Tower:
        """The table of the competitors."""
        return tower_of(self.timings) if self.timings else Tower([])

    @cached_property
    def planner(self) -> Element:
        """What the planner of the first competitor does."""
        return planner(self.timings[0])

    @cached_property
    def curves(self) -> RaceCurves:
        """The charts that are not over time."""
        return curves_of(self.s.race, self.timings)

    @cached_property
    def chatter(self) -> Element:
        """The chatter of the thrust so far."""
        return chatter([entry.until(self.s.t) for entry in self.s.competitors])

    @cached_property
    def events(self) -> Element:
        """The events so far."""
        return events(self.s.competitors, self.s.t)

    @cached_property
    def laps(self) -> Element:
        """The laps so far, and their sectors."""
        past = [entry.until(self.s.t) for entry in self.s.competitors]
        limit = limit_race(self.s.competitors[0])
        return laps(past, sectors(past, limit))


class Moments:
    """The moments that visitors watch, as long as any of them does."""

    def __init__(self) -> None:
        self._moments: dict[object, Moment] = {}
        self._used: dict[object, Moment] = {}

    def of(self, s: Snapshot) -> Moment:
        """Return the moment of what a visitor watches."""
        key = _key(s)
        moment = self._used.get(key) or self._moments.get(key) or Moment(s)
        self._used[key] = moment
        return moment

    def forget_others(self) -> None:
        """Forget the moments that were not asked for since the last call."""
        self._moments = self._used
        self._used = {}


def _key(s: Snapshot) -> object:
    """Return a value that differs between two snapshots that are shown differently.

    What a flight adds later does not change an earlier time of it.
    """
    how = (s.race, s.t, s.is_live, s.playing, s.flying, s.speed, s.preparing)
    if s.is_live:
        return (*how, s.waiting, s.factor, s.competitors)
    return (*how, tuple((entry.outcome, entry.folder) for entry in s.competitors))
