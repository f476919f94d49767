"""Models x_{t+1} = x_t + F(x_t, u_t) dt, each one file of plain functions over tuples of scalars.

The same text is flown on floats (ModelPlant), checked on numpy rows (the float64 oracle of the tests)
and inlined into the compiled lanes that MPPI runs. So a step uses only what all three know: plain functions of the same
kind, arithmetic, comparisons joined by `&` and `|`, `abs`, and numpy's sqrt, exp, where, minimum, maximum.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isfinite
from typing import get_type_hints

import numpy as np


@dataclass(frozen=True)
class System:
    """A model with its numbers: x_{t+1} = step(x_t, u_t, params, dt).

    `step` takes tuples of scalars, x (n_x,), u (n_u,) and params, and returns the next x (n_x,). It is compiled: plain
    arithmetic, comparisons joined by `&` and `|`, abs, and numpy's sqrt, exp, where, minimum, maximum.
    """

    name: str
    states: tuple[str, ...]  # n_x names
    controls: tuple[str, ...]  # n_u names
    step: Callable
    params: tuple[float, ...]
    dt: float  # [s]
    low: tuple[float, ...]  # (n_u,) control limits
    high: tuple[float, ...]
    rest: tuple[float, ...]  # (n_u,) the control that holds still, e.g. hover
    attainable: Callable | None = None  # (x, u, params) -> what is commanded in place of u (n_u,), if not u itself

    def tightened(self, share: float) -> System:
        """The same with this share of the way from rest to each limit left unused, for corrections, as in tube MPC."""
        low, high = (
            tuple(limit + share * (rest - limit) for limit, rest in zip(limits, self.rest, strict=True))
            for limits in (self.low, self.high)
        )
        return replace(self, low=low, high=high)

    def check(self, x: np.ndarray) -> None:
        """Raises ValueError unless x holds one finite number for each state."""
        bad = [f"{name} = {value:g}" for name, value in zip(self.states, x, strict=False) if not isfinite(value)]
        if bad or len(x) != len(self.states):
            found = ", ".join(bad) or f"{len(x)} numbers"
            expected = f"expected {len(self.states)} finite numbers"
            raise ValueError(f"{self.name}: state: {expected}, got {found}; has the plant diverged?")


def units_of(record: type) -> dict[str, str]:
    """Return the unit of each field of a NamedTuple of `Annotated[float, unit]`, in the order of the fields."""
    hints = get_type_hints(record, include_extras=True)
    return {name: hints[name].__metadata__[0] for name in record.__annotations__}
