"""Races and vehicles of published time-optimal solutions, as tasks."""

from __future__ import annotations

from math import sqrt

from quadsim.course import Start
from quadsim.limit.dynamics import Dynamics, dynamics
from quadsim.limit.task import Task, Waypoint
from quadsim.vehicle import Rotors, Vehicle

HALL = ((-40.0, 40.0), (-40.0, 40.0), (0.0, 20.0))


def without_lag(mass, inertia, arm, kappa, thrust, rate_max, drag) -> Dynamics:
    """A quadrotor whose rotors follow at once, each with up to `thrust` [N], at `arm` [m] from the
    centre."""
    side = arm / sqrt(2)
    places = ((side, -side), (-side, side), (side, side), (-side, -side))
    rotors = Rotors(places, (1, 1, -1, -1), (1.0, 0.0, 0.0), 0.0, sqrt(thrust), 0.0, kappa)
    vehicle = Vehicle(
        "published",
        "",
        mass,
        inertia,
        0.0,
        (0.05,) * 3,
        rate_max,
        4 * thrust / mass,
        drag,
        0.0,
        rotors,
    )
    return dynamics(vehicle, "rotors")


def cpc() -> tuple[Task, Dynamics]:
    """19 way-points from rest to rest, without drag: Foehn, Romero, Scaramuzza, Science Robotics
    2021."""
    lap = [
        (-1.1, -1.6, 3.6),
        (9.2, 6.6, 1.0),
        (9.2, -4.0, 1.2),
        (-4.5, -6.0, 3.5),
        (-4.5, -6.0, 0.8),
    ]
    lap += [(4.75, -0.9, 1.2), (-2.8, 6.8, 1.2)]
    targets = tuple(Waypoint(lap[i % 7], 0.3) for i in range(19))
    vehicle = without_lag(
        0.85, (1e-3, 1e-3, 1.7e-3), 0.15, 0.05, 6.879, (15.0, 15.0, 3.0), (0.0, 0.0, 0.0)
    )
    return Task(targets, Start((-5.0, 4.5, 1.2), 0.0), HALL, 0.0, (4.75, -0.9, 1.2)), vehicle


def fast_fly_n7() -> tuple[Task, Dynamics]:
    """A closed lap of seven way-points with drag: Fast-fly, Zhou et al. 2023; way-points published
    in NED."""
    ned = [
        (1.1, 1.2, -3.6),
        (8.2, 6, -3),
        (-7.2, 5, -3.2),
        (7.5, -6.5, -3.5),
        (-7.5, -8, -2),
        (1, -6.2, -3),
    ]
    targets = tuple(
        Waypoint((float(y), float(x), float(-z)), 0.01) for x, y, z in [*ned, (-6, -2, -2.2)]
    )
    vehicle = without_lag(
        1.13, (0.01, 0.01, 0.02), 0.3, 0.0133, 6.9, (6.0, 6.0, 2.0), (0.44, 0.35, 0.31)
    )
    return Task(targets, None, HALL), vehicle
