"""Costs q(x): plain functions over tuples of scalars, like the systems (see quadsim.systems).

A cost is `terms(x, x_next, u, target, crashed, p)`: one flat tuple of its weighted terms, then whether
this sample has reached its target and has crashed. `target` is the sample's target row, the numbers that describe
what it flies to; when it is reached, the rollout moves that sample to the next row. `crashed`, 0.0 or 1.0, is latched.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Obstacles:
    """What samples may run into wherever they fly to; who does has crashed, as if `terms` had said so.

    `touches(p0, p1, row)` is compiled like terms: whether the straight line between two positions (3,) touches the
    obstacle of this row. The first six numbers of a row are the corners of a box around it [m]. A sample that has
    reached its last target but one is past the finish and touches nothing.
    """

    touches: Callable
    rows: np.ndarray  # (obstacles, n_obstacle)
    near: Callable  # (x, seconds) -> those rows that may be reached from x in this time
    term: int  # of the crash
    weight: float  # of the crash, per step


@dataclass(frozen=True)
class Cost:
    """A cost with its numbers. J = (1/T) sum_t q_t, q = sum of the terms.

    `terms(x, x_next, u, target, crashed, p)` takes tuples of scalars, x (n_x,), u (n_u,), a row of targets and params,
    and returns the weighted terms, one for each of term_names, then reached and crashed. It is compiled: it may use
    plain arithmetic, comparisons joined by `&` and `|`, abs, and numpy's sqrt, exp, where, minimum, maximum.
    """

    name: str
    term_names: tuple[str, ...]
    terms: Callable  # -> (*n_terms, reached, crashed)
    params: tuple[float, ...]
    targets: np.ndarray  # (targets, n_target) the target rows, from the first target on
    to_go: int | None = None  # column of targets that counts distance still to fly, if any
    obstacles: Obstacles | None = None
    still_in_gate: Callable | None = None  # (x, row) -> whether x has not left the gate of the target just reached
    row_ahead: Callable | None = None  # (target, x) -> its row, where there are more rows than targets
    guide: Callable | None = None  # (target, x, T) -> controls (T, n_u) to perturb beside the plan, in place of rest
    unweighted: tuple[int, ...] = ()  # terms whose weight is zero: rollouts leave them out and save their arithmetic

    def targets_from(self, target: int, x: np.ndarray, dtype: type = np.float32) -> np.ndarray:
        """Rows from the current target on, the distance to go counted from it (small numbers for float32)."""
        target = self.row_ahead(target, x) if self.row_ahead else self._row(min(target, len(self.targets) - 1), x)
        rows = np.array(self.targets[target:], dtype=dtype)
        if self.to_go is not None:
            rows[:, self.to_go] -= rows[0, self.to_go]
        return rows

    def _row(self, target: int, x: np.ndarray) -> int:
        still = self.still_in_gate and target > 0 and self.still_in_gate(x, self.targets[target - 1])
        return target - 1 if still else target
