"""The number of samples that a plan has drawn, and the plans that were later than their deadline.

Under a deadline a planner draws fewer samples than its setting. The number is known while the
flight is live; a record has the setting and the deadline alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from quadsim.web.race.competitor import Competitor


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
