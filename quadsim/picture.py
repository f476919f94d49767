"""Pictures: what the planner thought at some frames of a flight. Kept for the eye, no part of a run's identity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """One look at the planner."""

    best: np.ndarray  # its best sampled paths, the cheapest first [m]  (8, points, 3)
    terms: dict[str, float]  # of the plan's cost J, horizon means, they sum to J; empty: not kept


@dataclass(frozen=True, slots=True, eq=False)
class Pictures:
    """All of a run; nan where a frame has none."""

    best: np.ndarray  # (frames, 8, points, 3)
    terms: dict[str, np.ndarray]  # (frames,) each

    @classmethod
    def of(cls, seen: Sequence[Picture | None]) -> Pictures | None:
        """One entry a frame; None where no frame has a picture. Single precision, it is for the eye."""
        first = next((p for p in seen if p is not None), None)
        if first is None:
            return None
        none = Picture(np.full(first.best.shape, np.nan), dict.fromkeys(first.terms, np.nan))
        whole = [p or none for p in seen]
        terms = {name: np.array([p.terms[name] for p in whole], np.float32) for name in first.terms}
        return cls(np.stack([p.best for p in whole]).astype(np.float32), terms)

    def latest(self, i: int) -> tuple[int, Picture] | None:
        """The last picture up to frame i, with the frame it was taken at."""
        taken = np.flatnonzero(np.isfinite(self.best[: i + 1, 0, 0, 0]))
        if not len(taken):
            return None
        k = int(taken[-1])
        return k, Picture(self.best[k], {name: float(column[k]) for name, column in self.terms.items()})
