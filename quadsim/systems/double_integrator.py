"""Two double integrators side by side, x' = v, v' = k u: Table II of Vlahov et al. 2024.

Explicit Euler: the position moves with the old velocity. No limits, as float32 understands it.
"""

from __future__ import annotations

from dataclasses import dataclass

from quadsim.systems import System

STATE_UNITS = {"px": "m", "py": "m", "vx": "m/s", "vy": "m/s"}
CONTROL_UNITS = {"ax_cmd": "m/s^2", "ay_cmd": "m/s^2"}
UNLIMITED = 1e30  # finite, as the compiled lanes assume of every number


def step(x, u, p, dt):
    """x, u: STATE_UNITS and CONTROL_UNITS. p: acceleration per unit of control, k."""
    px, py, vx, vy = x
    ux, uy = u
    (k,) = p
    return px + vx * dt, py + vy * dt, vx + k * ux * dt, vy + k * uy * dt


@dataclass(frozen=True)
class PointMass:
    """What is moved."""

    name: str = "point"
    gain: float = 1.0  # acceleration per unit of control, k


POINT = PointMass()


def double_integrator(dt: float, point: PointMass = POINT) -> System:
    """At control period dt [s]."""
    return System(
        name="double_integrator",
        states=tuple(STATE_UNITS),
        controls=tuple(CONTROL_UNITS),
        step=step,
        params=(point.gain,),
        dt=dt,
        low=(-UNLIMITED,) * 2,
        high=(UNLIMITED,) * 2,
        rest=(0.0, 0.0),
    )
