"""Models x_{t+1} = x_t + F(x_t, u_t) dt, each one file of plain functions over tuples of scalars.

The same text is flown on floats (ModelPlant), checked on numpy rows (the float64 oracle of the tests)
and inlined into the compiled lanes that MPPI runs. So a step speaks the words all three understand:
arithmetic, comparisons joined by `&` and `|`, `abs`, and numpy's sqrt, exp, where, minimum, maximum.
"""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class System:
    """A model with its numbers: x_{t+1} = step(x_t, u_t, params, dt)."""

    name: str
    states: tuple[str, ...]  # n_x names
    controls: tuple[str, ...]  # n_u names
    step: Callable
    params: tuple[float, ...]
    dt: float  # [s]
    low: tuple[float, ...]  # (n_u,) control limits
    high: tuple[float, ...]
    rest: tuple[float, ...]  # (n_u,) the control that holds still, e.g. hover
