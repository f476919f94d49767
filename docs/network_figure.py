"""Evaluate the network that finds gates for flying_on_pictures.md, on courses it never learnt from.

    .venv/bin/python docs/network_figure.py

It prints which gates are found by the network alone, by the tracker alone and by both, and how
exactly, and draws pictures with what the network has found. It needs onnxruntime.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from time import process_time
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from shared import (
    CORNERS,
    DISTANCE,
    RATES,
    SPEED,
    WITHIN,
    corners_of,
    estimated,
    frame_picture,
    moving,
    save,
)

from quadsim.course import Course, load_course
from quadsim.course.frames import frames
from quadsim.learn.gate_pictures import HELD_OUT, shown
from quadsim.render.eye import CourseEye
from quadsim.render.poses import Pose, drawn_poses
from quadsim.rotation import Vec3, turned
from quadsim.sensing import load_sensing
from quadsim.sensing.measurements import Corners, Photo
from quadsim.sensing.nominal import Nominal
from quadsim.sensing.pixel_camera import row_poses
from quadsim.sensing.pixels.network import FoundGate, GateNetwork, load_network
from quadsim.sensing.pixels.tracker import Tracker
from quadsim.sensing.state import FilterState

CAMERA = load_sensing("pixels").pixels
assert CAMERA
POSES = 60  # of each course
TOGETHER = 10  # poses that share a venue
DISPLACED = 0.15  # [m] largest displacement of gates along x and y
# standard deviations of an estimate that is lost [m], and of its turn about the vertical and about
# the level axes [rad]: at the start, and after a loss
LOST = {"at the start": (0.15, 0.105, 0.009), "after a loss": (0.5, 0.2, 0.05)}
# A lost pose counts as found again if at least AGAIN corners are found, and if the median of their
# errors is below EXACT [px].
AGAIN = 3
EXACT = 3.0
# [deg] angle to its plane from which on a gate is not seen from its side
ASIDE = 12.0
SHOWN = (1, 8, 17, 26)
# whether a network helps the tracker
CAMERAS = {False: CAMERA, True: replace(CAMERA, network="gates")}
HEAD = (
    "| {} | gates found | | error in the median [px] | 95 % within [px] |\n|---|---|---:|---:|---:|"
)


class Scene(NamedTuple):
    """A picture with the truth about it."""

    photo: Photo
    pose: Pose
    velocity: np.ndarray
    rates: np.ndarray
    # corners at the middle of the exposure, and where their rows show them [px]  (gates, 4, 2)
    true: np.ndarray
    rows: np.ndarray
    # which of them are in view  (gates, 4)
    in_view: np.ndarray
    # distance of each gate [m], and angle of the line of sight to its plane [deg]
    away: np.ndarray
    angle: np.ndarray
    # [px] motion while a row is exposed, of a point far ahead
    blur: float

    @property
    def turning(self) -> Vec3:
        """The body rates [rad/s]."""
        x, y, z = self.rates.tolist()
        return x, y, z


class Gate(NamedTuple):
    """A gate in a picture that should be found."""

    found: bool
    errors: list[float]
    away: float
    angle: float
    blur: float
    corners: int


def scenes(course: Course, map_of: Course) -> Iterator[Scene]:
    """Yield pictures of a course, at poses along its map."""
    assert CAMERA
    rng = np.random.default_rng(0)
    gates = frames(course.gates)
    for k, pose in enumerate(drawn_poses(map_of, CAMERA, POSES, seed=5)):
        if k % TOGETHER == 0:
            eye = CourseEye(CAMERA, np.random.SeedSequence(k + 1000), course)
        velocity = rng.normal(0.0, SPEED, 3)
        rates = rng.normal(0.0, RATES, 3)
        eyes, axes = row_poses(CAMERA, 0.0, moving(pose, velocity, rates))
        corners = corners_of(CAMERA, gates, course, pose)
        middle = CAMERA.passes // 2
        points = np.array([gate.corners() for gate in gates]).reshape(-1, 3)
        rows, _ = shown(points, CAMERA, eyes[middle], axes[middle])
        place, _ = CAMERA.pose(pose.p, pose.q)
        away = np.array([np.linalg.norm(np.subtract(gate.position, place)) for gate in gates])
        ahead = [abs(gate.to_local(tuple(place.tolist())).along) for gate in gates]
        yield Scene(
            photo=Photo(0.0, eye(eyes, axes)),
            pose=pose,
            velocity=velocity,
            rates=rates,
            true=corners.pixels,
            rows=rows.reshape(-1, 4, 2),
            in_view=corners.in_view,
            away=away,
            angle=np.degrees(np.arcsin(np.array(ahead) / away)),
            blur=float(np.linalg.norm(rates[1:])) * CAMERA.exposure * CAMERA.fx,
        )


def tracked_gates(scene: Scene, corners: Corners) -> list[Gate]:
    """Return the gates that should be found, with what the tracker has found."""

    def of(k: int) -> tuple[int, list[float]]:
        mine = corners.gates == k
        off = corners.pixels[mine] - scene.true[k, corners.corners[mine]]
        errors = np.linalg.norm(off, axis=1)
        return int((errors < WITHIN).sum()), errors.tolist()

    return wanted(scene, of)


def network_gates(scene: Scene, found: list[FoundGate]) -> list[Gate]:
    """Return the gates that should be found, with what the network has found.

    A corner belongs to the gate of which it is nearest to a corner.
    """
    flat = scene.rows.reshape(-1, 2)
    near = [np.linalg.norm(one.corners[:, None] - flat, axis=2) for one in found]
    near = [np.where(np.isnan(apart), np.inf, apart) for apart in near]

    def of(k: int) -> tuple[int, list[float]]:
        most = 0
        errors: list[float] = []
        for apart in near:
            mine = apart.argmin(axis=1) // 4 == k
            errors += apart.min(axis=1)[mine].tolist()
            most = max(most, int((apart.min(axis=1)[mine] < WITHIN).sum()))
        return most, errors

    return wanted(scene, of)


def wanted(scene: Scene, of: Callable[[int], tuple[int, list[float]]]) -> list[Gate]:
    """Return the gates that should be found; `of` gives the good corners of one, and all errors."""
    rows = []
    for k in np.flatnonzero((scene.in_view.sum(axis=1) >= CORNERS) & (scene.away < DISTANCE)):
        good, errors = of(int(k))
        angle = float(scene.angle[k])
        corners = int(scene.in_view[k].sum())
        rows.append(Gate(good >= 2, errors, float(scene.away[k]), angle, scene.blur, corners))
    return rows


def lost(pose: Pose, velocity: np.ndarray, how: str, rng: np.random.Generator) -> FilterState:
    """Return an estimate of a pose that is lost, and knows how far."""
    move, heading, level = LOST[how]
    turn = np.array([level, level, heading])
    p = np.array(pose.p) + move * rng.standard_normal(3)
    q = turned(pose.q, (turn * rng.standard_normal(3)).tolist())
    variances = np.concatenate([np.full(3, move**2), np.full(3, 0.01), turn**2, np.full(6, 1e-4)])
    nominal = Nominal(0.0, tuple(p.tolist()), tuple(velocity.tolist()), q)
    return FilterState(nominal, np.zeros(0), np.zeros((0, 3)), np.diag(variances))


def is_found_again(scene: Scene, corners: Corners) -> bool:
    """Return whether the corners show that the pose was found."""
    off = np.linalg.norm(corners.pixels - scene.true[corners.gates, corners.corners], axis=1)
    return len(off) >= AGAIN and float(np.median(off)) < EXACT


def row(name: str, gates: list[Gate]) -> str:
    """Return a row of a table."""
    errors = [error for gate in gates for error in gate.errors]
    hits = sum(gate.found for gate in gates)
    share = f"{hits} of {len(gates)} | {100 * hits / max(len(gates), 1):.1f} %"
    if not errors:
        return f"| {name} | {share} | | |"
    low, high = np.quantile(errors, (0.5, 0.95))
    return f"| {name} | {share} | {low:.2f} | {high:.2f} |"


def upright(gates: list[Gate]) -> list[Gate]:
    """Return the gates that are not seen from their side."""
    return [gate for gate in gates if gate.angle >= ASIDE]


def displaced(course: Course) -> Course:
    """Return a course whose gates stand off the map."""
    rng = np.random.default_rng(7)
    moved = {}
    for gate in dict.fromkeys(course.gates):
        x, y, z = gate.position
        dx, dy = rng.uniform(-DISPLACED, DISPLACED, 2).tolist()
        moved[gate] = replace(gate, position=(x + dx, y + dy, z))
    return replace(course, gates=tuple(moved[gate] for gate in course.gates))


class Compared(NamedTuple):
    """The gates that network, tracker and both find on the held-out courses."""

    # gates found by the network alone, the tracker alone, and both
    alone: list[Gate]
    edges: list[Gate]
    both: list[Gate]
    # whether the pose was found again, by how it was lost and whether with the network
    again: dict[tuple[str, bool], list[bool]]
    # processor time of the network [s]
    spent: list[float]
    # pictures to show
    panels: list[tuple[Scene, list[FoundGate]]]


def compared(network: GateNetwork) -> Compared:
    """Let the network, the tracker and both find gates."""
    result = Compared([], [], [], {}, [], [])
    rng = np.random.default_rng(1)
    for name in HELD_OUT:
        course = load_course(name)
        trackers = {
            helped: Tracker(config, frames(course.gates)) for helped, config in CAMERAS.items()
        }
        for k, scene in enumerate(scenes(course, course)):
            began = process_time()
            found = network(scene.photo.rgb)
            result.spent.append(process_time() - began)
            result.alone.extend(network_gates(scene, found))
            if name == HELD_OUT[0] and k in SHOWN:
                result.panels.append((scene, found))
            state = estimated(scene.pose, scene.velocity, rng)
            for helped, gates in ((False, result.edges), (True, result.both)):
                gates += tracked_gates(scene, trackers[helped](scene.photo, state, scene.turning))
            if not wanted(scene, lambda k: (0, [])):
                continue
            for how in LOST:
                state = lost(scene.pose, scene.velocity, how, rng)
                for helped, tracker in trackers.items():
                    corners = tracker(scene.photo, state, scene.turning)
                    again = result.again.setdefault((how, helped), [])
                    again.append(is_found_again(scene, corners))
    return result


def on_a_map_that_is_off(helped: bool) -> list[Gate]:
    """Let the tracker find gates that stand off the map."""
    rows: list[Gate] = []
    rng = np.random.default_rng(2)
    for name in HELD_OUT:
        course = load_course(name)
        tracker = Tracker(CAMERAS[helped], frames(course.gates))
        for scene in scenes(displaced(course), course):
            state = estimated(scene.pose, scene.velocity, rng)
            # The filter does not know where the gates stand.
            state.P[:3, :3] += DISPLACED**2 / 3 * np.eye(3)
            rows += tracked_gates(scene, tracker(scene.photo, state, scene.turning))
    return rows


def main() -> None:
    result = compared(load_network("gates"))
    print(HEAD.format(""))
    for name, gates in (
        ("network alone", result.alone),
        ("tracker alone", result.edges),
        ("tracker with network", result.both),
        ("tracker alone, map off", on_a_map_that_is_off(False)),
        ("tracker with network, map off", on_a_map_that_is_off(True)),
    ):
        print(row(name, gates))
        print(row(f"the same, not from its side ({ASIDE:g} degrees)", upright(gates)))
    print(f"network: {1e3 * np.median(result.spent):.1f} ms of processor time in the median\n")
    print(HEAD.format("network alone"))
    for label, of, limits in (
        ("{:g} to {:g} m", lambda g: g.away, (0, 5, 10, 15)),
        ("{:g} to {:g} degrees to the plane", lambda g: g.angle, (0, 12, 30, 60, 90)),
        ("{:g} to {:g} px of blur", lambda g: g.blur, (0, 1, 2, 4, 9)),
        ("{:g} corners in view", lambda g: g.corners, (3, 4, 5)),
    ):
        for low, high in pairwise(limits):
            print(row(label.format(low, high), [g for g in result.alone if low <= of(g) < high]))
    print("\n| the pose is found again | without network | with it |\n|---|---|---|")
    for how in LOST:
        parts = [result.again[how, helped] for helped in CAMERAS]
        print(f"| {how} | " + " | ".join(f"{sum(p)} of {len(p)}" for p in parts) + " |")
    figure, axes = plt.subplots(2, 2, figsize=(12.8, 7.4), layout="constrained")
    for panel, (scene, found) in zip(axes.flat, result.panels, strict=True):
        draw(panel, scene, found)
    save(figure, "network.png", dpi=100)


def draw(panel, scene: Scene, found: list[FoundGate]) -> None:
    """Draw a picture with the gates that the network has found."""
    assert CAMERA
    panel.imshow(scene.photo.rgb)
    for one in found:
        for u, v in one.corners:
            panel.plot([u, one.centre[0]], [v, one.centre[1]], "-", color="white", linewidth=0.8)
        panel.plot(*one.corners.T, "+", color="cyan", markersize=11, markeredgewidth=2)
    frame_picture(panel, CAMERA)


if __name__ == "__main__":
    main()
