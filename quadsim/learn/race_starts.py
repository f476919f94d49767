"""Starts of races of several vehicles: on the start grid, see quadsim.heat.grid, or in flight.

A start in flight (`anywhere`) is for training: all racers of a race begin one behind the other on
the way to the same gate.
"""

from __future__ import annotations

from typing import cast

import numpy as np

from controllers.costs import Cost
from controllers.costs.race import RaceParams
from quadsim.course import Course, Start
from quadsim.dynamics.quadrotor import State
from quadsim.heat.distances import default_spacing
from quadsim.heat.grid import SPACING, place_fault, start_grid
from quadsim.learn.starts import ROWS, STANDING, hover_action, in_flight, system_params
from quadsim.physics.domain_randomization import Randomization, draw
from quadsim.physics.plant_state import start_state
from quadsim.streams import racer_vehicle_stream
from quadsim.vehicle import Vehicle

BESIDE = 0.2  # standard deviation of starts in flight about the line of racers, per axis [m]


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


def race_start_rows(
    course: Course,
    cost: Cost,
    vehicle: Vehicle,
    dt: float,
    start: str,
    randomize: float,
    seeds: np.random.SeedSequence,
    racers: int,
) -> np.ndarray:
    """Return the starts of races on a course; row i of all racers is the start of one race.

    Args:
        course, cost, vehicle, dt, start, randomize, seeds: see quadsim.learn.starts.start_rows.
        racers: number of racers.

    Returns:
        (racers, rows, n_x + 1 + n_p + n_u) float32.
    """
    rng = np.random.default_rng(seeds)
    count = ROWS if randomize or start == "anywhere" else 1
    nominal = system_params(vehicle, Randomization(), dt)
    hover = hover_action(vehicle, dt)
    grid = learning_grid(course, racers, vehicle.radius)
    rows: list[list[list[float]]] = [[] for _ in range(racers)]
    for number in range(count):
        varied = [draw(racer_vehicle_stream(seeds, number, a), randomize) for a in range(racers)]
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


def flying_together(
    course: Course, cost: Cost, rng: np.random.Generator, racers: int
) -> tuple[list[State], int]:
    """Draw states on the way to some gate, in a line about SPACING apart, in random order.

    Returns:
        The states, and the row of their common target.
    """
    first, target = in_flight(course, cost, rng)
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
