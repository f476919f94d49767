"""The first-order lag x' = (x_cmd - x) / tau, solved exactly over a step with a constant command.

    x(t + dt) = x_cmd + remaining (x(t) - x_cmd) = x(t) + response (x_cmd - x(t))

`remaining` and `response` are numbers without unit that add up to 1. With tau = 0 the state follows
its command at once.
"""

from __future__ import annotations

from math import exp


def remaining(tau: float, dt: float) -> float:
    """Return exp(-dt / tau), the share of the error that is left after dt.  tau, dt [s]"""
    return exp(-dt / tau) if tau > 0.0 else 0.0


def response(tau: float, dt: float) -> float:
    """Return 1 - exp(-dt / tau), the share of the error that is gone after dt.  tau, dt [s]"""
    return 1.0 - remaining(tau, dt)


def response_over(response: float, periods: int) -> float:
    """Return the response over several control periods, given that over one."""
    return 1.0 - (1.0 - response) ** periods
