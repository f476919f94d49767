"""Two double integrators side by side, x' = v, v' = k u: Table II of Vlahov et al. 2024.

Explicit Euler: the position moves with the old velocity. No limits, as float32 understands it.
"""

from __future__ import annotations

from quadsim.systems import System

STATES = ("px", "py", "vx", "vy")
CONTROLS = ("ax_cmd", "ay_cmd")
UNLIMITED = 1e30  # finite, as the compiled lanes assume of every number


def step(x, u, p, dt):
    """x: STATES [m, m/s]. u: CONTROLS. p: acceleration per unit of control, k [m/s^2]."""
    px, py, vx, vy = x
    ux, uy = u
    (k,) = p
    return px + vx * dt, py + vy * dt, vx + k * ux * dt, vy + k * uy * dt


def double_integrator(dt: float) -> System:
    """At control period dt [s], with k = 1."""
    return System(
        name="double_integrator",
        states=STATES,
        controls=CONTROLS,
        step=step,
        params=(1.0,),
        dt=dt,
        low=(-UNLIMITED,) * 2,
        high=(UNLIMITED,) * 2,
        rest=(0.0, 0.0),
    )
