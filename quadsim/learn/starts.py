"""Initial rows of episodes: state, target row, vehicle parameters and last action.

`standing` is the race's start. `anywhere` is for training: most episodes begin in flight, on the
way to any gate and at any speed, so that every part of a course is learnt from the first minute on
(Song et al. 2021); the rest begins at the race's start. Vehicles that race together begin on the
start grid, see quadsim.heat.grid, or one behind the other on the way to the same gate.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np

from quadsim.controllers.costs import Cost
from quadsim.controllers.costs.race import RaceParams
from quadsim.controllers.costs.race_targets import GateTarget
from quadsim.controllers.learned.observation import normalised
from quadsim.course import Course, Start
from quadsim.dynamics.named_tuples import columns
from quadsim.dynamics.quadrotor import ModelParams, State, quadrotor
from quadsim.heat.distances import default_spacing
from quadsim.heat.grid import SPACING, place_fault, start_grid
from quadsim.physics.domain_randomization import Randomization, draw
from quadsim.physics.plant_state import start_state
from quadsim.rotation import from_yaw, product
from quadsim.streams import start_vehicle_streams
from quadsim.vehicle import GRAVITY, Vehicle

ROWS = 1024  # number of random starts of a course
STANDING = 0.15  # share of `anywhere` that begins at the race's start
SPEED = 9.0  # highest speed of a start in flight [m/s]
TILT = 0.3  # standard deviation of the attitude in flight, per axis [rad]
SPIN = 0.7  # standard deviation of the body rates in flight [rad/s]
AROUND = 0.25  # standard deviation of the position around the leg [m]
BESIDE = 0.2  # standard deviation of racers in flight about their line, per axis [m]
BEHIND = 2.0  # largest distance behind a gate whose successor faces away [m]


class StartInFlight(NamedTuple):
    """A state on the way to a gate."""

    state: State
    target: int  # row of the target


def learning_grid(course: Course, racers: int, radius: float) -> list[Start]:
    """Return the places in which equal racers start.

    Args:
        course: the course.
        racers: number of racers.
        radius: radius of a racer [m].
    """
    return start_grid(course, racers, default_spacing(course, [radius] * racers))


def start_fault(course: Course, racers: int, radius: float) -> str:
    """Return the reason why a racer has no valid start position, "" if all have one.

    Args:
        course: the course.
        racers: number of racers.
        radius: radius of a racer [m].
    """
    for number, start in enumerate(learning_grid(course, racers, radius)):
        problem = place_fault(course, start)
        if problem:
            x, y, _ = start.position
            place = f"the start of racer_{number} at ({x:.2f}, {y:.2f})"
            return f"no room for {racers}: {place}: {problem}"
    return ""


def start_rows(
    course: Course,
    cost: Cost,
    vehicle: Vehicle,
    dt: float,
    start: str,
    randomize: float,
    seeds: np.random.SeedSequence,
    racers: int = 1,
) -> np.ndarray:
    """Return the starts on a course; row i of all racers is the start of one race.

    If nothing is random there is only one row.

    Args:
        course, cost: the course and its racing cost.
        vehicle: the nominal vehicle.
        dt: duration of a step [s].
        start: "standing" or "anywhere".
        randomize: size of domain randomization.
        seeds: seeds of all random numbers.
        racers: number of vehicles that race together.

    Returns:
        State, index of the target row, parameters and last action of each start  (racers, rows, n_x
        + 1 + n_p + n_u) float32.
    """
    rng = np.random.default_rng(seeds)
    count = ROWS if randomize or start == "anywhere" else 1
    nominal = system_params(vehicle, Randomization(), dt)
    hover = hover_action(vehicle, dt)
    grid = learning_grid(course, racers, vehicle.radius)
    rows: list[list[list[float]]] = [[] for _ in range(racers)]
    for number in range(count):
        streams = start_vehicle_streams(seeds, number, racers)
        varied = [draw(stream, randomize, vehicle=vehicle) for stream in streams]
        if start == "anywhere" and number >= STANDING * count:
            states, target = flying_together(course, cost, rng, racers)
        else:
            places = [v.start(place) for v, place in zip(varied, grid, strict=True)]
            states = [start_state(place, vehicle.radius) for place in places]
            target = 0
        for a in range(racers):
            params = system_params(vehicle, varied[a], dt) if randomize else nominal
            rows[a].append([*states[a], target, *params, *hover])
    return np.array(rows, np.float32)


def system_params(vehicle: Vehicle, varied: Randomization, dt: float) -> tuple[float, ...]:
    """Return the model parameters of a randomized vehicle.

    The flight controller assumes the nominal mass, so the thrust gain changes with the true mass.
    """
    model = ModelParams.of(varied.vehicle(vehicle))
    share = 1 / (1 + varied.mass)
    heavier = replace(model, thrust_gain=share, drag=model.drag * share)
    return quadrotor(heavier, dt).params


def hover_action(vehicle: Vehicle, dt: float) -> np.ndarray:
    """Return the action of hovering, scaled to -1..1.  (4,)"""
    system = quadrotor(ModelParams.of(vehicle), dt)
    return normalised(system.rest, system.low, system.high)


def in_flight(course: Course, cost: Cost, rng: np.random.Generator) -> StartInFlight:
    """Return a random state on the way to a random gate."""
    target = int(rng.integers(len(cost.targets) - 1))
    share = rng.uniform(0.0, 0.85)
    speed = rng.uniform(0.0, SPEED)

    # the straight leg to the target from the gate before it, or from the start
    exits = columns(cost.targets, GateTarget, "x", "z")
    passages = columns(cost.targets, GateTarget, "nx", "nz")
    before = exits[target - 1] if target else np.array(course.start.position)
    way = exits[target] - before
    direction = way / max(np.linalg.norm(way), 1e-6)

    # the exit direction of the gate before it
    gate_before = course.gates[(target - 1) % len(course.gates)]
    out = gate_before.rotation[:, 0] if target else direction
    if direction @ passages[target] < 0 or direction @ out < 0:
        # the next gate lies behind or faces away: the vehicle first continues in this direction
        position = before + rng.uniform(0.0, BEHIND) * out
        heading = out
    else:
        position = before + share * way
        heading = (1 - share) * out + share * direction

    p = cast(RaceParams, cost.params)
    low = np.array((p.x_low, p.y_low, p.floor))
    high = np.array((p.x_high, p.y_high, p.z_high))
    position = np.clip(position + rng.normal(0.0, AROUND, 3), low + 0.1, high - 0.1)
    forwards = speed * heading / max(np.linalg.norm(heading), 1e-6)
    velocity = forwards + rng.normal(0.0, 0.5, 3)
    yaw = np.arctan2(heading[1], heading[0]) + rng.normal(0.0, TILT)
    attitude = _attitude(yaw, rng.normal(0.0, TILT, 2))
    state = State.of(
        position=position.tolist(),
        velocity=velocity.tolist(),
        attitude=attitude.tolist(),
        body_rates=rng.normal(0.0, SPIN, 3).tolist(),
        thrust=rng.uniform(5.0, 2 * GRAVITY),
        angular_acceleration=(0.0, 0.0, 0.0),
    )
    return StartInFlight(state, target)


def flying_together(
    course: Course, cost: Cost, rng: np.random.Generator, racers: int
) -> tuple[list[State], int]:
    """Return states in a line on the way to a random gate, about SPACING apart, in random order.

    Returns:
        The states, and the index of their common target row.
    """
    first, target = in_flight(course, cost, rng)
    if racers == 1:
        return [first], target
    velocity = np.array(first.velocity)
    speed = np.linalg.norm(velocity)
    backwards = -velocity / speed if speed > 1e-3 else np.array((-1.0, 0.0, 0.0))
    p = cast(RaceParams, cost.params)
    low = np.array((p.x_low, p.y_low, p.floor)) + 0.1
    high = np.array((p.x_high, p.y_high, p.z_high)) - 0.1
    states: list[State] = []
    for place in rng.permutation(racers):
        position = np.array(first.position) + place * SPACING * backwards
        if place > 0:
            position += rng.normal(0.0, BESIDE, 3)
        position = np.clip(position, low, high)
        own = velocity + rng.normal(0.0, 0.5, 3)
        x, y, z = position.tolist()
        vx, vy, vz = own.tolist()
        states.append(first._replace(px=x, py=y, pz=z, vx=vx, vy=vy, vz=vz))
    return states, target


def _attitude(yaw: float, tilt: np.ndarray) -> np.ndarray:
    """Return the attitude with a yaw and a small tilt, wxyz.  (4,)

    Args:
        yaw: yaw angle [rad].
        tilt: small rotations about body x and y [rad].  (2,)
    """
    half_x, half_y = tilt / 2
    q = np.array(product(from_yaw(yaw), (1.0, half_x, half_y, 0.0)))
    return q / np.linalg.norm(q)
