"""Races and vehicles of published time-optimal solutions, with way-points in place of gates.

A way-point is a ball that the path has to touch. Their programs are made here of the product's
parts: the intervals, the limits, the optimiser and the check are those of `race limit`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import dist, sqrt

import casadi
import numpy as np

from quadsim.course import Start
from quadsim.dynamics.quadrotor import POSITION, VELOCITY
from quadsim.limit.dynamics import Dynamics, dynamics
from quadsim.limit.guess import SHORT, straight
from quadsim.limit.limits import Solution
from quadsim.limit.solve import minimise
from quadsim.limit.transcription import (
    FASTEST,
    INTERVAL,
    SLOWEST,
    Interval,
    Program,
    close,
    state_limits,
    state_scale,
)
from quadsim.physics.plant_state import start_state
from quadsim.vehicle import Rotors, Vehicle

HALL = ((-40.0, 40.0), (-40.0, 40.0), (0.0, 20.0))
# Speed of the straight lines to start from [m/s]
SPEED = 8.0


@dataclass(frozen=True)
class Waypoints:
    """Way-points in order: from rest at `start` to rest at the last one, or a closed lap."""

    points: list[tuple[float, float, float]]
    tolerance: float
    vehicle: Dynamics
    start: Start | None = None


def solved(case: Waypoints, intervals: int) -> Solution:
    """Return the fastest flight, found from straight lines with `intervals` intervals a leg."""
    model = case.vehicle
    program = Program()
    interval = Interval(model)
    scale = state_scale(model)
    low, high = state_limits(HALL, model)
    first = case.start.position if case.start else case.points[-1]
    guess = straight([first, *case.points], model, SPEED)

    if case.start:
        at_rest = model.of_flight(start_state(case.start, 0.0))[0]
        x = program.variable("x0", at_rest, at_rest, at_rest, scale)
    else:
        x = program.variable("x0", guess.states(np.zeros(1))[0], low, high, scale)
    states, controls, lengths, defects = [x], [], [], []

    began = 0.0
    before = first
    for i, point in enumerate(case.points, start=1):
        h_guess = max(dist(before, point), SHORT * SPEED) / SPEED / intervals
        h = program.variable(
            "h", np.array([h_guess]), FASTEST * h_guess, SLOWEST * h_guess, INTERVAL
        )
        lengths.append(h)
        for k in range(1, intervals + 1):
            t = np.array([began + k * h_guess])
            u_guess = guess.controls(t - 0.5 * h_guess)[0]
            u = program.variable("u", u_guess, model.u_low, model.u_high, model.u_high)
            after = program.variable("x", guess.states(t)[0], low, high, scale)
            defects.append(interval.connect(program, x, u, h, after).defect)
            states.append(after)
            controls.append(u)
            x = after
        if case.start and i == len(case.points):
            program.hold(x[POSITION] - casadi.DM(point), 0.0, 0.0)
            program.hold(x[VELOCITY], 0.0, 0.0)
        else:
            away = casadi.sumsqr(x[POSITION] - casadi.DM(point))
            program.hold(away, 0.0, case.tolerance**2)
        began += intervals * h_guess
        before = point
    if not case.start:
        close(program, states[0], x)

    found = minimise(program, intervals * casadi.sum1(casadi.vertcat(*lengths)))
    z = casadi.vertcat(*program.z)
    outputs = [casadi.horzcat(*states), casadi.horzcat(*controls), casadi.vertcat(*lengths)]
    values = casadi.Function("read", [z], outputs)(found["x"])
    x_found, u_found, h_found = (np.array(value) for value in values)
    multipliers = np.array(found["lam_g"]).ravel()
    return Solution(
        model=model.name,
        t=np.append(0.0, np.cumsum(np.repeat(h_found.ravel(), intervals))),
        x=x_found.T,
        u=u_found.T,
        costate=np.array([multipliers[defect] for defect in defects]) / scale,
        target=np.repeat(np.arange(len(case.points)), intervals),
    )


def without_lag(mass, inertia, arm, kappa, thrust, rate_max, drag) -> Dynamics:
    """A quadrotor whose rotors follow at once, each with up to `thrust` [N], at `arm` [m]."""
    rotors = Rotors(
        arm_l=arm,
        motor_omega_min=0.0,
        motor_omega_max=sqrt(thrust),
        motor_tau=0.0,
        thrust_map=(1.0, 0.0, 0.0),
        kappa=kappa,
    )
    vehicle = Vehicle(
        name="published",
        mass=mass,
        inertia=inertia,
        radius=0.0,
        rate_tau=(0.05,) * 3,
        omega_max=rate_max,
        thrust_max=4 * thrust / mass,
        drag=drag,
        rotors=rotors,
    )
    return dynamics(vehicle, "rotors")


def cpc() -> Waypoints:
    """19 way-points from rest to rest, without drag: Foehn et al., Science Robotics 2021."""
    lap = [
        (-1.1, -1.6, 3.6),
        (9.2, 6.6, 1.0),
        (9.2, -4.0, 1.2),
        (-4.5, -6.0, 3.5),
        (-4.5, -6.0, 0.8),
        (4.75, -0.9, 1.2),
        (-2.8, 6.8, 1.2),
    ]
    end = (4.75, -0.9, 1.2)
    vehicle = without_lag(
        0.85, (1e-3, 1e-3, 1.7e-3), 0.15, 0.05, 6.879, (15.0, 15.0, 3.0), (0.0, 0.0, 0.0)
    )
    points = [lap[i % len(lap)] for i in range(19)]
    return Waypoints([*points, end], 0.3, vehicle, Start((-5.0, 4.5, 1.2), 0.0))


def fast_fly_n7() -> Waypoints:
    """A closed lap of seven way-points with drag: Fast-fly, Zhou et al. 2023, published in NED."""
    ned = [
        (1.1, 1.2, -3.6),
        (8.2, 6.0, -3.0),
        (-7.2, 5.0, -3.2),
        (7.5, -6.5, -3.5),
        (-7.5, -8.0, -2.0),
        (1.0, -6.2, -3.0),
        (-6.0, -2.0, -2.2),
    ]
    vehicle = without_lag(
        1.13, (0.01, 0.01, 0.02), 0.3, 0.0133, 6.9, (6.0, 6.0, 2.0), (0.44, 0.35, 0.31)
    )
    return Waypoints([(y, x, -z) for x, y, z in ned], 0.01, vehicle)
