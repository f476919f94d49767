"""The racing cost of a vehicle that has to find gates by a camera: eq. (8), and a nose that points where it flies.

    q = q_race + a_v (|b_xy| - b_x) / sqrt(|v|^2 + 1),   b = R(q)^T v

a_v (1 - cos of the angle about the body's z axis between its x axis and the velocity) where the velocity lies in the
body's x-y plane; what yaw cannot change costs nothing, and neither does hovering. Perception-aware planning as in PAMPC
(Falanga, Foehn, Lu and Scaramuzza, IROS 2018) and in Swift's reward (Kaufmann et al., Nature 2023), which keep a point
of interest, the next gate, in the middle of the picture. Here it is the direction of flight: the gate after the next
one may stand behind the vehicle, and a cost of the bearing to the next gate would jump up when a gate is passed.
"""

from __future__ import annotations

from dataclasses import replace

from numpy import sqrt

from controllers.costs import Cost
from controllers.costs.race import terms as race_terms
from quadsim.systems.rotation import to_body


def terms(x, x_next, u, target, crashed, p):
    """Those of the racing cost with the view before `reached` and `crashed`; the last of p is its weight."""
    q = race_terms(x, x_next, u, target, crashed, p[:18])
    vx, vy, vz = x_next[3], x_next[4], x_next[5]
    bx, by, _bz = to_body((x_next[6], x_next[7], x_next[8], x_next[9]), (vx, vy, vz))
    speed = sqrt(vx * vx + vy * vy + vz * vz + 1.0)
    view = p[18] * (sqrt(bx * bx + by * by + 1e-6) - bx) / speed
    return q[0], q[1], q[2], q[3], q[4], q[5], q[6], q[7], q[8], view, q[9], q[10]


def with_view(cost: Cost, weight: float) -> Cost:
    """The racing cost with the view term."""
    return replace(
        cost, name="race_view", term_names=(*cost.term_names, "view"), terms=terms, params=(*cost.params, weight)
    )
