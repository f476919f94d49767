"""The planner's numbers of flights that are shown: of one competitor, or of several at once.

A number of several competitors is their common one; if they differ, it is named with each value.
Under a deadline a planner draws fewer samples than its setting. How many is known while the flight
is live; a record has the setting and the deadline alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from quadsim.config.settings import SETTINGS
from quadsim.web.race.competitor import Competitor
from quadsim.web.state.numbers import SLIDERS


class NumberOfSeveral(NamedTuple):
    """A number with a slider, of the competitors that have it."""

    name: str  # of SLIDERS
    values: tuple[float, ...]  # different values, in the order of the competitors

    @property
    def differs(self) -> bool:
        """Whether the competitors have different values."""
        return len(self.values) > 1

    @property
    def words(self) -> str:
        """The number in words, such as "temperature 0.2 / 1"."""
        values = " / ".join(f"{value:g}" for value in self.values)
        return f"{SLIDERS[self.name].label.lower()} {values}"


def numbers_of_several(entries: Sequence[Competitor], t: float) -> list[NumberOfSeveral]:
    """Return the numbers of competitors at t [s]; numbers that no competitor has are left out."""
    found = []
    for name in SLIDERS:
        values = [entry.numbers(t)[name] for entry in entries if has_number(entry, name)]
        if values:
            found.append(NumberOfSeveral(name, tuple(dict.fromkeys(values))))
    return found


def has_number(entry: Competitor, name: str) -> bool:
    """Return whether a competitor's planner has the number of a slider."""
    if not entry.has_planner:
        return False
    setting = SLIDERS[name].setting
    if SETTINGS[setting].group != "sampling" or setting == "sigma":
        return True
    sampling = entry.spec.planner.sampling
    return isinstance(sampling, dict) and setting in sampling


def can_change(entry: Competitor, name: str) -> bool:
    """Return whether a number may change in flight, which it cannot in a shared world."""
    flies = entry.live and entry.outcome is None
    return flies and has_number(entry, name) and entry.spec.heat is None


def remark(entries: Sequence[Competitor], t: float) -> str:
    """Return what the sliders of competitors show, and what moving one does, in one sentence.

    Args:
        entries: the competitors whose numbers are shown.
        t: the time of the race [s].
    """
    names = ", ".join(entry.name for entry in entries)
    if not any(entry.has_planner for entry in entries):
        return f"{names}: a learned pilot, or a person, has none of these numbers"
    flying = any(entry.live and entry.outcome is None for entry in entries)
    if not flying:
        does = f"{names}: the numbers at this time"
    elif any(entry.spec.heat for entry in entries):
        does = "in one world the numbers of START stay: they act in flight as ghosts only"
    else:
        does = f"a slider acts on the next plan of {names}, and on this flight alone"
    differing = [number.words for number in numbers_of_several(entries, t) if number.differs]
    if not differing:
        return does
    return f"{does}. They differ: {', '.join(differing)}; the sliders show the first value"


class DrawnSamples(NamedTuple):
    """The samples of a plan."""

    most: int  # the setting
    count: int | None  # the number drawn; None: it is not known
    deadline_ms: float | None

    @property
    def words(self) -> str:
        """The number in words."""
        if self.deadline_ms is None:
            return f"{self.most} samples"
        deadline = f"the deadline of {self.deadline_ms:g} ms"
        if self.count is None:
            return f"at most {self.most} samples, fewer by {deadline}: how many is not recorded"
        return f"{self.count} samples, of {self.most} by {deadline}"


def drawn_samples(entry: Competitor, i: int) -> DrawnSamples:
    """Return the samples of the plan of frame i."""
    t = float(entry.t[i])
    most = int(entry.numbers(t).get("samples") or entry.spec.planner.mppi.samples)
    deadline_ms = entry.spec.deadline_ms
    if deadline_ms is None:
        return DrawnSamples(most, most, None)
    is_last = entry.live and i == len(entry.t) - 1
    return DrawnSamples(most, entry.drawn_samples if is_last else None, float(deadline_ms))


def late_plans(entry: Competitor, i: int) -> str:
    """Return how many plans up to frame i took longer than the deadline; empty: there is none."""
    deadline_ms = entry.spec.deadline_ms
    if deadline_ms is None:
        return ""
    took = entry.x["plan_ms"][: i + 1]
    late = int(np.sum(took > float(deadline_ms)))
    return f"{late} of {len(took)} plans took longer than the deadline of {deadline_ms:g} ms"
