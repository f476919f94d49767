"""PlannerSnapshots: the planner's best sampled paths at some frames of a run, for display; no part
of its digest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controllers.plan import PlannerSnapshot

# names of arrays in telemetry.npz; TERM before that of a cost term
FRAMES, BEST, TERM = "pictured", "best", "cost."


@dataclass(frozen=True, slots=True, eq=False)
class PlannerSnapshots:
    """All of a run, in order, in single precision."""

    frames: np.ndarray  # index of the frame that each was taken at  (snapshots,)
    # the first states, at most three, along the best paths  (snapshots, 8, points, states)
    best: np.ndarray
    terms: dict[str, np.ndarray]  # (snapshots,) each

    @classmethod
    def of(cls, taken: Sequence[tuple[int, PlannerSnapshot]]) -> PlannerSnapshots | None:
        """From (frame, snapshot); None where there are none."""
        if not taken:
            return None
        each = [snapshot for _, snapshot in taken]
        terms = {
            name: np.array([s.terms[name] for s in each], np.float32) for name in each[0].terms
        }
        return cls(
            np.array([k for k, _ in taken]), np.array([s.best for s in each], np.float32), terms
        )

    def latest(self, frame: int) -> tuple[int, PlannerSnapshot] | None:
        """The last one up to this frame, with the frame it was taken at."""
        i = int(np.searchsorted(self.frames, frame, side="right")) - 1
        if i < 0:
            return None
        terms = {name: float(column[i]) for name, column in self.terms.items()}
        return int(self.frames[i]), PlannerSnapshot(self.best[i], terms)

    def arrays(self) -> dict[str, np.ndarray]:
        """As they are stored: one array for each term, so that a replay can name it."""
        return {FRAMES: self.frames, BEST: self.best} | {
            TERM + name: x for name, x in self.terms.items()
        }

    @classmethod
    def taken_out_of(cls, arrays: dict[str, np.ndarray]) -> PlannerSnapshots | None:
        """Those among the arrays of a file, which are removed there; None where it has none."""
        if FRAMES not in arrays and BEST in arrays:
            _compact(arrays)
        if not {FRAMES, BEST} <= arrays.keys():
            return None
        terms = {
            name.removeprefix(TERM): arrays.pop(name)
            for name in list(arrays)
            if name.startswith(TERM)
        }
        return cls(arrays.pop(FRAMES), arrays.pop(BEST), terms)

    def check(self, frames: int) -> None:
        """Raises ValueError, one line, unless they fit a run of so many frames."""
        k, best = self.frames, self.best
        if (
            k.ndim != 1
            or k.dtype != np.int64
            or not len(k)
            or k[0] < 0
            or k[-1] >= frames
            or (np.diff(k) <= 0).any()
        ):
            raise ValueError(
                f"{FRAMES}: expected rising frames below {frames}, got {k.dtype} {k.shape}"
            )
        shaped = (
            best.ndim == 4
            and 0 not in best.shape[1:]
            and len(best) == len(k)
            and best.shape[3] <= 3
        )
        if not shaped or best.dtype != np.float32:
            wanted = (len(k), 8, "points", "1 to 3")
            raise ValueError(f"{BEST}: expected float32 {wanted}, got {best.dtype} {best.shape}")
        for name, column in self.terms.items():
            if column.dtype != np.float32 or column.shape != k.shape:
                raise ValueError(
                    f"{TERM}{name}: expected float32 {k.shape}, got {column.dtype} {column.shape}"
                )


def _compact(arrays: dict[str, np.ndarray]) -> None:
    """An early layout had a row for every frame, nan where no snapshot was taken."""
    best = arrays[BEST]
    if best.dtype != np.float32 or best.ndim != 4 or 0 in best.shape:
        return
    arrays[FRAMES] = taken = np.flatnonzero(np.isfinite(best[:, 0, 0, 0]))
    for name in [BEST, *(name for name in arrays if name.startswith(TERM))]:
        if arrays[name].shape[:1] == best.shape[:1]:
            arrays[name] = arrays[name][taken]
