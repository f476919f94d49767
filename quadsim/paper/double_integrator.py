"""Two double integrators side by side, x' = v, v' = k u: Table II of Vlahov et al. 2024.

Explicit Euler: the position moves with the old velocity. No limits, as float32 understands it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from quadsim.dynamics import System
from quadsim.dynamics.records import units_of

UNLIMITED = 1e30  # finite, as the compiled lanes assume of every number


class State(NamedTuple):
    """Position and velocity in the plane."""

    px: Annotated[float, "m"]
    py: Annotated[float, "m"]
    vx: Annotated[float, "m/s"]
    vy: Annotated[float, "m/s"]


class Control(NamedTuple):
    """Commanded acceleration."""

    ax_cmd: Annotated[float, "m/s^2"]
    ay_cmd: Annotated[float, "m/s^2"]


class Params(NamedTuple):
    """The number of `step`."""

    gain: float  # k, acceleration per unit of control


STATE_UNITS, CONTROL_UNITS = units_of(State), units_of(Control)


def step(x, u, p, dt):
    """Return the State after dt [s] from the State x under the Control u, with Params p."""
    return State(
        px=x.px + x.vx * dt,
        py=x.py + x.vy * dt,
        vx=x.vx + p.gain * u.ax_cmd * dt,
        vy=x.vy + p.gain * u.ay_cmd * dt,
    )


@dataclass(frozen=True)
class PointMass:
    """What is moved."""

    name: str = "point"
    gain: float = 1.0  # acceleration per unit of control, k


POINT = PointMass()


def double_integrator(dt: float, point: PointMass = POINT) -> System:
    """Return the system at control period dt [s]."""
    return System(
        name="double_integrator",
        state=State,
        control=Control,
        step=step,
        params=Params(gain=point.gain),
        dt=dt,
        low=Control(-UNLIMITED, -UNLIMITED),
        high=Control(UNLIMITED, UNLIMITED),
        rest=Control(0.0, 0.0),
    )
