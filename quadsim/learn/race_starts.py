"""Starts of races of several vehicles.

Racers stand 1 m apart on an arc around gate 1 and look at it, four in a row. The middle of the
first row is the start of the course, and each further row stands 1 m behind the one before it.
Where gate 1 is nearer than 1.5 m, rows are straight and look where the course's start looks.

A start in flight (`anywhere`) is for training: all racers of a race begin on the way to the same
gate, one behind the other.
"""

from __future__ import annotations

from dataclasses import replace
from math import asin, atan2, cos, hypot, pi, sin
from typing import cast

import numpy as np

from controllers.costs import Cost
from controllers.costs.race import RaceParams
from quadsim.course import Course, Start
from quadsim.course.checks import faults
from quadsim.dynamics.quadrotor import State
from quadsim.learn.starts import ROWS, STANDING, hover_action, in_flight, system_params
from quadsim.physics.domain_randomization import Randomization, draw
from quadsim.physics.plant_state import start_state
from quadsim.streams import racer_vehicle_stream
from quadsim.vehicle import Vehicle

IN_ROW = 4  # racers in a row
SPACING = 1.0  # between neighbours in a row, and between rows [m]
LEAST_RADIUS = 1.5  # of the arc of a row [m]; a smaller one would be half a circle
BESIDE = 0.2  # standard deviation of places in flight about the line of the racers, per axis [m]


def start_grid(course: Course, racers: int) -> list[Start]:
    """Return the start of each racer; racer 0 stands on the right of the first row."""
    x, y, z = course.start.position
    gate_x, gate_y, _ = course.gates[0].position
    radius = hypot(gate_x - x, gate_y - y)
    from_gate = atan2(y - gate_y, x - gate_x)
    starts: list[Start] = []
    for racer in range(racers):
        row, place = divmod(racer, IN_ROW)
        in_this_row = min(IN_ROW, racers - row * IN_ROW)
        aside = place - (in_this_row - 1) / 2  # in SPACING from the middle, to the left
        behind = row * SPACING
        if radius >= LEAST_RADIUS:
            # chords of SPACING; seen from the gate, the left of a racer lies clockwise
            r = radius + behind
            angle = from_gate - aside * 2 * asin(SPACING / 2 / r)
            position = (gate_x + r * cos(angle), gate_y + r * sin(angle), z)
            yaw = angle + pi
        else:
            yaw = course.start.yaw
            left = aside * SPACING
            position = (
                x - behind * cos(yaw) - left * sin(yaw),
                y - behind * sin(yaw) + left * cos(yaw),
                z,
            )
        starts.append(Start(position, yaw))
    return starts


def start_fault(course: Course, racers: int) -> str:
    """Return what is wrong with the place of a racer at the start, "" where nothing is."""
    for number, start in enumerate(start_grid(course, racers)):
        found = next(faults(replace(course, start=start)), None)
        if found:
            x, y, _ = start.position
            place = f"the start of racer_{number} at ({x:.2f}, {y:.2f})"
            return f"no room for {racers}: {place}: {found.problem}"
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
    grid = start_grid(course, racers)
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
    """Draw states on the way to some gate, about SPACING one behind the other, in random order.

    Returns:
        The states, and the row of their target.
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
