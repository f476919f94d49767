"""A cost term for gates that are known only from nearby: the speed in front of them.

    a_c max(|v| - v_c, 0)^2,   within REACH r of a gate

A gate that stands off the map becomes known at a distance r. The vehicle then has to reach its
opening, which lies up to d aside of the opening on the map. With full thrust f and the largest rate
w of roll or pitch, behind a rate loop that lags by tau, it moves aside by f w (t - tau)^3 / 6
within a time t. The opening itself leaves room for a part of the displacement: a vehicle that aims
at the middle of the opening on the map has to move by d less half of the free opening. That takes

    t = tau + (6 (d - free) / (f w))^(1/3)

and v_c = (r - depth) / t is the largest speed with which it is complete where the frame begins. The
law has no number of its own but REACH, with which braking begins early enough.

A weight on the speed alone is not enough. The openings on the map are flown through in the middle,
by the margin that gates at uncertain places have (EstimatedGate).
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Sequence
from dataclasses import replace
from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy import maximum, sqrt, where

from quadsim.controllers.costs import Cost, Term
from quadsim.controllers.costs.frames import inner_margin
from quadsim.controllers.costs.race_targets import GateTarget
from quadsim.course import Course, EstimatedGate, Gate
from quadsim.course.opening import free_half_sizes, half_depth
from quadsim.dynamics.named_tuples import as_rows
from quadsim.dynamics.quadrotor import ModelParams

# Ratio of the distance within which the speed counts to that within which gates are known
REACH = 1.3


class Sight(NamedTuple):
    """From where gates are known that stand off the map, and how fast they are approached."""

    # horizontal distance within which a gate is known [m]
    known_from: float
    # speed up to which a gate can be flown through that is known from there on [m/s]
    speed: float


def with_unseen(mapped: Course, known: Course, spread: float) -> Course:
    """Return a known course in which the gates that nobody has seen yet are uncertain.

    Args:
        mapped: the course of the map.
        known: the same course as it is known now: gates that were seen stand elsewhere.
        spread: half width of the gates' displacement along x and y [m].
    """
    # of one coordinate, which is uniform
    std = spread / sqrt(3.0)
    gates = [
        EstimatedGate.of(gate, (0.0, 0.0, 0.0), std) if gate == on_map else gate
        for on_map, gate in zip(mapped.gates, known.gates, strict=True)
    ]
    return replace(known, gates=tuple(gates))


def safe_speed(
    course: Course,
    radius: float,
    model: ModelParams,
    period: float,
    spread: float,
    known_from: float,
) -> float:
    """Return the largest speed with which a gate can still be reached once it is known [m/s].

    Args:
        course: course whose narrowest opening counts.
        radius: radius of the vehicle [m].
        model: the planner's model of the vehicle.
        period: control period, which passes before a new plan acts [s].
        spread: half width of the gates' displacement along x and y [m].
        known_from: horizontal distance within which a gate is known [m].

    Returns:
        The speed, infinite if the openings have room for the whole displacement.
    """
    free = min(
        min(free_half_sizes(gate.opening, radius, inner_margin(gate, radius)))
        for gate in course.gates
    )
    aside = spread - free
    if aside <= 0.0:
        return inf
    lag = period + max(model.rate_tau[:2]) + max(model.rate_lags[:2])
    jerk = model.thrust_max * min(model.rate_max[:2])
    seconds = lag + (6.0 * aside / jerk) ** (1.0 / 3.0)
    deepest = max(gate.frame_depth for gate in course.gates)
    return max(known_from - half_depth(radius, depth=deepest), 0.0) / seconds


class Caution(NamedTuple):
    """The numbers of one target row for the term."""

    # Place of the gate [m]
    gate_x: float
    gate_y: float
    # Square of the horizontal distance within which the speed counts, 0 for none [m^2]
    reach2: float
    # [m/s]
    safe_speed: float


# A row of the racing cost with this term: GateTarget, then Caution
CautiousTarget: Any = namedtuple("CautiousTarget", GateTarget._fields + Caution._fields)


def caution(x, x_next, u, gate, p):
    """Return the square of the speed above the safe one near a gate [(m/s)^2]."""
    dx = x_next.px - gate.gate_x
    dy = x_next.py - gate.gate_y
    vx, vy, vz = x_next.velocity
    over = maximum(sqrt(vx * vx + vy * vy + vz * vz + 1e-6) - gate.safe_speed, 0.0)
    return where(dx * dx + dy * dy < gate.reach2, over * over, 0.0)


def with_caution(
    cost: Cost, gates: Sequence[Gate], first: Sequence[int], sight: Sight, weight: float
) -> Cost:
    """Return the racing cost with the term, in front of gates at uncertain places.

    Args:
        cost: the racing cost.
        gates: the gates of all laps.
        first: index at which the rows of each gate begin, and those of the finish.
        sight: from where gates are known.
        weight: weight of the term.
    """
    rows = []
    for k, gate in enumerate((*gates, None)):
        reach = REACH * sight.known_from if isinstance(gate, EstimatedGate) else 0.0
        x, y, _ = gate.position if gate else (0.0, 0.0, 0.0)
        row = Caution(x, y, reach**2, sight.speed)
        rows += [row] * (first[k + 1] - first[k])
    return replace(
        cost,
        name="race_caution",
        terms=(*cost.terms, Term(caution, weight)),
        row=CautiousTarget,
        targets=np.hstack([cost.targets, as_rows(rows, Caution)]),
    )
