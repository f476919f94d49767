"""Models x_{t+1} = x_t + F(x_t, u_t) dt as plain functions over named scalars.

A model is three records and a function: State, Control and Params are NamedTuples of numbers, and
`step(x, u, p, dt)` returns the next State. The same function runs on floats,
on float64 arrays (the oracle of the tests) and in CasADi, which the optimiser uses, and is inlined
into the compiled lanes that MPPI runs. So a step uses only what all of them know: arithmetic,
comparisons joined by `&` and `|`, `abs`, and NumPy's where, minimum, maximum, sqrt, exp, log, sin,
cos, tan, tanh, arctan2; it may call functions of the same kind. A system that CasADi does not need
may use more of NumPy's functions, see controllers.lanes.trace.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

import numpy as np


@dataclass(frozen=True)
class System:
    """A model with its numbers: x_{t+1} = step(x_t, u_t, params, dt).

    Examples:
        >>> from typing import NamedTuple
        >>> from numpy import sin
        >>> from quadsim import System
        >>> class State(NamedTuple):
        ...     angle: float  # [rad]
        ...     rate: float  # [rad/s]
        >>> class Control(NamedTuple):
        ...     torque: float  # per moment of inertia [rad/s^2]
        >>> def step(x, u, p, dt):
        ...     rate = x.rate + (u.torque - 9.81 * sin(x.angle)) * dt
        ...     return State(x.angle + rate * dt, rate)
        >>> limits = {"low": (-5.0,), "high": (5.0,), "rest": (0.0,)}
        >>> pendulum = System("pendulum", State, Control, step, (), dt=0.1, **limits)
        >>> x = pendulum.next((0.0, 0.0), (1.0,))
        >>> print(f"{x.angle:.2f} rad, {x.rate:.1f} rad/s")
        0.01 rad, 0.1 rad/s
    """

    name: str
    # NamedTuples of n_x and of n_u scalars
    state: type
    control: type
    # (state, control, params, dt) -> state, see this module's docstring
    step: Callable[[Any, Any, Any, Any], Any]
    # a NamedTuple; () for a step without numbers
    params: tuple[float, ...]
    dt: float  # [s]
    # limits of the control  (n_u,)
    low: tuple[float, ...]
    high: tuple[float, ...]
    # the control that holds still, e.g. hover  (n_u,)
    rest: tuple[float, ...]
    # (state, control, params) -> the control that is commanded in its place, where the vehicle
    # cannot follow it
    attainable: Callable[[Any, Any, Any], Any] | None = None

    @property
    def states(self) -> tuple[str, ...]:
        """The names of the state's numbers."""
        return self.state._fields  # pyright: ignore[reportAttributeAccessIssue]

    @property
    def controls(self) -> tuple[str, ...]:
        """The names of the control's numbers."""
        return self.control._fields  # pyright: ignore[reportAttributeAccessIssue]

    def next(self, x: Sequence[float] | np.ndarray, u: Sequence[float] | np.ndarray) -> Any:
        """Return the state after one step.

        Args:
            x: state (n_x,), or rows of numbers (n_x, n).
            u: control (n_u,), or rows of numbers (n_u, n).

        Returns:
            The record `state`.
        """
        return self.step(self.state(*x), self.control(*u), self.params, self.dt)

    def tightened(self, share: float) -> System:
        """Return the system with this share of the way from rest to each limit unused.

        The unused part is left for corrections, as in tube MPC.
        """

        def tighter(limits: tuple[float, ...]) -> tuple[float, ...]:
            return tuple(
                limit + share * (rest - limit)
                for limit, rest in zip(limits, self.rest, strict=True)
            )

        return replace(self, low=tighter(self.low), high=tighter(self.high))

    def check(self, x: Sequence[float] | np.ndarray) -> None:
        """Raise ValueError unless x holds one finite number for each state."""
        expected = len(self.states)
        bad = [
            f"{name} = {value:g}"
            for name, value in zip(self.states, x, strict=False)
            if not isfinite(value)
        ]
        if bad or len(x) != expected:
            got = ", ".join(bad) or f"{len(x)} numbers"
            raise ValueError(
                f"{self.name}: state: expected {expected} finite numbers, got {got}; "
                "has the plant diverged?"
            )
