"""Where episodes start: rows of state, row of targets, parameters of the system, last action.

`standing` is the race's start. `anywhere` is for training: in flight, somewhere on the way to any
gate, at any speed, so that every part of a course is learnt from the first minute on (Song et al.
2021). A share of it stands.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from controllers.costs import Cost
from controllers.costs.race_targets import GateTarget
from controllers.learned.observation import normalised
from quadsim.course import Course
from quadsim.dynamics.quadrotor import ModelParams, State, quadrotor
from quadsim.dynamics.records import columns
from quadsim.physics.domain_randomization import Randomization, draw
from quadsim.physics.plant_state import start_state
from quadsim.rotation import from_yaw, product
from quadsim.streams import start_vehicle_stream
from quadsim.vehicle import GRAVITY, Vehicle

ROWS = 1024  # different starts of a course, where they differ
STANDING = 0.15  # share of them that stand at the start
SPEED = 9.0  # highest at a start in flight [m/s]
TILT, SPIN = 0.3, 0.7  # standard deviations of attitude [rad] and body rates [rad/s] there
AROUND = 0.25  # standard deviation of the position around the leg [m]


def start_rows(
    course: Course,
    cost: Cost,
    vehicle: Vehicle,
    dt: float,
    start: str,
    randomize: float,
    seeds: np.random.SeedSequence,
) -> np.ndarray:
    """(rows, n_x + 1 + n_p + n_u). One row where nothing is random."""
    rng = np.random.default_rng(seeds)
    many = ROWS if randomize or start == "anywhere" else 1
    rows, nominal = [], system_params(vehicle, Randomization(), dt)
    hover = hover_action(vehicle, dt)
    for number in range(many):
        varied = draw(start_vehicle_stream(seeds, number), randomize)
        x, target = np.array(start_state(varied.start(course.start), vehicle.radius)), 0
        if start == "anywhere" and number >= STANDING * many:
            x, target = in_flight(course, cost, rng)
        rows.append(
            [*x, target, *(system_params(vehicle, varied, dt) if randomize else nominal), *hover]
        )
    return np.array(rows, np.float32)


def system_params(vehicle: Vehicle, varied: Randomization, dt: float) -> tuple[float, ...]:
    """Of the model of a vehicle that differs from the nominal one; its flight controller does not
    know the mass."""
    model, share = ModelParams.of(varied.vehicle(vehicle)), 1 / (1 + varied.mass)
    return quadrotor(replace(model, thrust_gain=share, drag=model.drag * share), dt).params


def hover_action(vehicle: Vehicle, dt: float) -> np.ndarray:
    """The action that hovers, in -1..1.  (4,)"""
    system = quadrotor(ModelParams.of(vehicle), dt)
    return normalised(system.rest, system.low, system.high)


def in_flight(course: Course, cost: Cost, rng: np.random.Generator) -> tuple[np.ndarray, int]:
    """A state on the way to some gate, and the row of that target."""
    target = int(rng.integers(len(cost.targets) - 1))
    gates, share, speed = course.gates, rng.uniform(0.0, 0.85), rng.uniform(0.0, SPEED)
    exits = columns(cost.targets, GateTarget, "x", "z")
    passages = columns(cost.targets, GateTarget, "nx", "nz")
    before = exits[target - 1] if target else np.array(course.start.position)
    way = exits[target] - before
    direction = way / max(np.linalg.norm(way), 1e-6)
    # as the last gate was left
    out = gates[(target - 1) % len(gates)].rotation[:, 0] if target else direction
    # the next gate stands behind or faces away
    if direction @ passages[target] < 0 or direction @ out < 0:
        p = before + rng.uniform(0.0, 2.0) * out
        heading = out
    else:
        p, heading = before + share * way, (1 - share) * out + share * direction
    floor, x_low, x_high, y_low, y_high, z_high = cost.params[-6:]
    low, high = (x_low, y_low, floor), (x_high, y_high, z_high)
    p = np.clip(p + rng.normal(0.0, AROUND, 3), np.add(low, 0.1), np.subtract(high, 0.1))
    v = speed * heading / max(np.linalg.norm(heading), 1e-6) + rng.normal(0.0, 0.5, 3)
    q = _attitude(
        np.arctan2(heading[1], heading[0]) + rng.normal(0.0, TILT), rng.normal(0.0, TILT, 2)
    )
    x = State.of(
        position=p.tolist(),
        velocity=v.tolist(),
        attitude=q.tolist(),
        body_rates=rng.normal(0.0, SPIN, 3).tolist(),
        thrust=rng.uniform(5.0, 2 * GRAVITY),
        angular_acceleration=(0.0, 0.0, 0.0),
    )
    return np.array(x), target


def _attitude(yaw: float, tilt: np.ndarray) -> np.ndarray:
    """Return the attitude turned by a yaw, then by small rotations about body x and y [rad].  wxyz
    (4,)"""
    half_x, half_y = tilt / 2
    q = np.array(product(from_yaw(yaw), (1.0, half_x, half_y, 0.0)))
    return q / np.linalg.norm(q)
