"""A cost term for flights by camera: the nose points along the direction of flight.

    a_v (|b_xy| - b_x) / sqrt(|v|^2 + 1),   b = R(q)^T v

If the velocity lies in the body's x-y plane and is large, the term is a_v (1 - cos of the angle
between the body's x axis and the velocity). A direction that yaw cannot change has no cost, and
neither has hovering. Perception-aware planning as in PAMPC (Falanga, Foehn, Lu and Scaramuzza,
IROS 2018) and in Swift's reward (Kaufmann et al., Nature 2023) keeps a point of interest, the next
gate, in the middle of the picture. Here the direction of flight takes its place: the gate after the
next one may lie behind the vehicle, and a cost of the bearing to the next gate would jump up when a
gate is passed.
"""

from __future__ import annotations

from dataclasses import replace

from numpy import sqrt

from quadsim.controllers.costs import Cost, Term
from quadsim.rotation import to_body


def view(x, x_next, u, target, p):
    """Return the misalignment of the nose with the direction of flight, 0 to about 2."""
    vx, vy, vz = x_next.velocity
    bx, by, _ = to_body(x_next.attitude, x_next.velocity)
    speed = sqrt(vx * vx + vy * vy + vz * vz + 1.0)
    return (sqrt(bx * bx + by * by + 1e-6) - bx) / speed


def with_view(cost: Cost, weight: float) -> Cost:
    """Return the racing cost with the view term."""
    return replace(cost, name="race_view", terms=(*cost.terms, Term(view, weight)))
