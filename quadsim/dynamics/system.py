"""Models x_{t+1} = x_t + F(x_t, u_t) dt as plain functions over named scalars.

A model is three records and a function: State, Control and Params are NamedTuples of numbers, and
`step(x, u, p, dt)` returns the next State. The same function runs on floats,
on float64 arrays (the oracle of the tests) and in CasADi, which the optimiser uses, and is inlined
into the compiled lanes that MPPI runs. So a step uses only what all of them know: arithmetic,
comparisons joined by `&` and `|`, `abs`, and NumPy's where, minimum, maximum, sqrt, exp, log, sin,
cos, tan, tanh, arctan2; it may call functions of the same kind. A system that CasADi does not need
may use more of NumPy's functions, see quadsim.controllers.lanes.trace.
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
    # limits of the control, which may be infinite  (n_u,)
    low: tuple[float, ...]
    high: tuple[float, ...]
    # the control that holds still, e.g. hover  (n_u,)
    rest: tuple[float, ...]
    # (state, control, params) -> the control that is commanded in its place, where the vehicle
    # cannot follow it
    attainable: Callable[[Any, Any, Any], Any] | None = None
    # (control, earlier system, this system) -> the control that has the effect on this system that
    # the given one had on the earlier system, where params are estimated in flight
    adapted: Callable[[Any, System, System], Any] | None = None

    def __post_init__(self) -> None:
        """Check the system.

        Raises:
            ValueError: a limit or `rest` has the wrong length, a limit is NaN, low exceeds high,
                `rest` is outside the limits, or dt is no positive number.
        """
        for kind, role in ((self.state, "state"), (self.control, "control")):
            if not hasattr(kind, "_fields"):
                raise self._wrong(role, "a NamedTuple of numbers", repr(kind))
        if not (isfinite(self.dt) and self.dt > 0.0):
            raise self._wrong("dt", "a number of seconds > 0", f"{self.dt:g}")
        for role in ("low", "high", "rest"):
            numbers = getattr(self, role)
            if len(numbers) != len(self.controls):
                names = ", ".join(self.controls)
                wanted = f"{len(self.controls)} numbers, one for each of {names}"
                raise self._wrong(role, wanted, str(len(numbers)))
        for name, low, high, rest in zip(
            self.controls, self.low, self.high, self.rest, strict=True
        ):
            if not low <= high:
                raise self._wrong("low", f"low <= high for {name}", f"{low:g} and {high:g}")
            if not low <= rest <= high:
                raise self._wrong("rest", f"{low:g} to {high:g} for {name}", f"{rest:g}")

    def _wrong(self, role: str, wanted: str, found: str) -> ValueError:
        return ValueError(f"{self.name}: {role}: expected {wanted}, got {found}")

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

    def over(self, periods: int) -> System:
        """Return the system whose step lasts several control periods, with one command for them.

        Parameters that depend on the length of a step have a method `over(periods, dt)`, which
        returns the parameters of the longer step.

        Args:
            periods: number of control periods.
        """
        change = getattr(self.params, "over", None)
        params = change(periods, self.dt) if change else self.params
        return replace(self, dt=periods * self.dt, params=params)

    def tightened(self, share: float) -> System:
        """Return the system with this share of the way from rest to each limit unused.

        The unused part is left for corrections, as in tube MPC. A limit that is infinite stays so.
        """

        def tighter(limits: tuple[float, ...]) -> tuple[float, ...]:
            return tuple(
                limit + share * (rest - limit) if isfinite(limit) else limit
                for limit, rest in zip(limits, self.rest, strict=True)
            )

        return replace(self, low=tighter(self.low), high=tighter(self.high))

    def checked_state(self, x: Any) -> np.ndarray:
        """Return a state that was given as an array, a list or a NamedTuple as an array  (n_x,).

        Raises:
            ValueError: x does not hold one number for each state.
        """
        wanted = f"{len(self.states)} numbers: {', '.join(self.states)}"
        try:
            numbers = np.asarray(x, float)
        except (TypeError, ValueError):
            raise self._wrong("state", wanted, type(x).__name__) from None
        if numbers.shape != (len(self.states),):
            got = f"an array of shape {numbers.shape}" if numbers.ndim else type(x).__name__
            raise self._wrong("state", wanted, got)
        return numbers

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
