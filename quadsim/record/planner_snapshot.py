"""The planner's best sampled paths at some frames of a run, for display.

They do not change a run's digest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from quadsim.controllers.plan import PlannerSnapshot

# Names of arrays in telemetry.npz; TERM is the prefix of a cost term's name
FRAMES = "pictured"
BEST = "best"
TERM = "cost."


@dataclass(frozen=True, slots=True, eq=False)
class PlannerSnapshots:
    """All snapshots of a run, in order of time and in single precision."""

    # Index of the frame that each was taken at  (snapshots,)
    frames: np.ndarray
    # The first states, at most three, along the best paths  (snapshots, 8, points, states)
    best: np.ndarray
    # The cost terms of the plan, each (snapshots,)
    terms: dict[str, np.ndarray]

    @classmethod
    def of(cls, taken: Sequence[tuple[int, PlannerSnapshot]]) -> PlannerSnapshots | None:
        """Return the snapshots of pairs of frame and snapshot, None if there are no pairs."""
        if not taken:
            return None
        frames = [frame for frame, _ in taken]
        snapshots = [snapshot for _, snapshot in taken]
        terms = {
            name: np.array([snapshot.terms[name] for snapshot in snapshots], np.float32)
            for name in snapshots[0].terms
        }
        best = np.array([snapshot.best for snapshot in snapshots], np.float32)
        return cls(np.array(frames), best, terms)

    def latest(self, frame: int) -> tuple[int, PlannerSnapshot] | None:
        """Return the last snapshot up to a frame, and the frame at which it was taken."""
        i = int(np.searchsorted(self.frames, frame, side="right")) - 1
        if i < 0:
            return None
        terms = {name: float(column[i]) for name, column in self.terms.items()}
        return int(self.frames[i]), PlannerSnapshot(self.best[i], terms)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the arrays for a file; each cost term has its own, whose name a replay shows."""
        terms = {TERM + name: column for name, column in self.terms.items()}
        return {FRAMES: self.frames, BEST: self.best, **terms}

    @classmethod
    def taken_out_of(cls, arrays: dict[str, np.ndarray]) -> PlannerSnapshots | None:
        """Remove the snapshots from the arrays of a file and return them, None if there are none.

        Incomplete snapshots are not removed.
        """
        if FRAMES not in arrays or BEST not in arrays:
            return None
        stored_terms = [name for name in arrays if name.startswith(TERM)]
        terms = {name.removeprefix(TERM): arrays.pop(name) for name in stored_terms}
        return cls(arrays.pop(FRAMES), arrays.pop(BEST), terms)

    def check(self, frames: int) -> None:
        """Raise ValueError unless the snapshots fit a run of `frames` frames."""
        self._check_frames(frames)
        self._check_best()
        for name, column in self.terms.items():
            if column.dtype != np.float32 or column.shape != self.frames.shape:
                raise ValueError(
                    f"{TERM}{name}: expected float32 {self.frames.shape}, "
                    f"got {column.dtype} {column.shape}"
                )

    def _check_frames(self, frames: int) -> None:
        k = self.frames
        indices = k.ndim == 1 and k.dtype == np.int64 and len(k) > 0
        if not indices or k[0] < 0 or k[-1] >= frames or (np.diff(k) <= 0).any():
            raise ValueError(
                f"{FRAMES}: expected rising frames below {frames}, got {k.dtype} {k.shape}"
            )

    def _check_best(self) -> None:
        best = self.best
        paths = best.ndim == 4 and len(best) == len(self.frames) and 0 not in best.shape[1:]
        if not paths or best.shape[3] > 3 or best.dtype != np.float32:
            wanted = (len(self.frames), 8, "points", "1 to 3")
            raise ValueError(f"{BEST}: expected float32 {wanted}, got {best.dtype} {best.shape}")
