"""PlannerSnapshots: what the planner thought at some frames of a flight. Kept for the eye, no part of a run's identity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controllers.plan import PlannerSnapshot


@dataclass(frozen=True, slots=True, eq=False)
class PlannerSnapshots:
    """All of a run, in order. Single precision, they are for the eye."""

    frames: np.ndarray  # the frame that each was taken at  (pictures,)
    best: np.ndarray  # (pictures, 8, points, 3)
    terms: dict[str, np.ndarray]  # (pictures,) each

    @classmethod
    def of(cls, seen: Sequence[tuple[int, PlannerSnapshot]]) -> PlannerSnapshots | None:
        """From (frame, picture); None where there are none."""
        if not seen:
            return None
        pictures = [picture for _, picture in seen]
        terms = {name: np.array([p.terms[name] for p in pictures], np.float32) for name in pictures[0].terms}
        return cls(np.array([k for k, _ in seen]), np.array([p.best for p in pictures], np.float32), terms)

    def latest(self, frame: int) -> tuple[int, PlannerSnapshot] | None:
        """The last picture up to this frame, with the frame it was taken at."""
        i = int(np.searchsorted(self.frames, frame, side="right")) - 1
        if i < 0:
            return None
        terms = {name: float(column[i]) for name, column in self.terms.items()}
        return int(self.frames[i]), PlannerSnapshot(self.best[i], terms)
