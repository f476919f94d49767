"""RaceScene: the course, the drones and the sampled trajectories in three dimensions, on the page
and in recordings."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count, product

import numpy as np
import trimesh
import viser
from viser.transforms import SO3

from quadsim.course import Course, Cylinder, Gate, Obstacle
from quadsim.course.opening import outer_half_sizes
from quadsim.palette import NEXT, Style
from web.competitor import CRASHES, Competitor
from web.lap_timing import LapTiming, crashed_gates
from web.page.drones import (
    SPAN,
    Drone,
    SampledTrajectoriesView,
    add_lights,
    array_colour,
    single_colour,
)
from web.page.estimate import EstimateView
from web.page.html import RED

PLAIN, NEXT_GATE, HIT_GATE = (
    array_colour(rgb) for rgb in ((206, 210, 216), Style(NEXT, ()).rgb, Style(RED, ()).rgb)
)
OBSTACLE = 176, 150, 110  # colour
GATE = 1.5  # opening of a racing gate [m]
IMPACTS = 12  # most that are marked, the last ones
SCENES = count()  # numbers of their gates' nodes


class RaceScene:
    """Everything in the scene of one race."""

    def __init__(
        self,
        scene: viser.SceneApi,
        entries: Sequence[Competitor],
        true_size: bool = False,
        samples: int = 63,
    ):
        """true_size: of the drones, else enlarged; samples: trajectories that are drawn."""
        course = entries[0].course
        scale, width = 1.0 if true_size else visible_scale(course), gate_scale(course)
        self.drone_size = SPAN * scale  # [m]
        add_lights(scene)
        self._course, self._impacts = CourseView(scene, course), Impacts(scene, width)
        self._drones = [
            Drone(scene, str(k), entry, k > 0, scale, width) for k, entry in enumerate(entries)
        ]
        self._estimates = {
            k: EstimateView(scene, str(k), entry, scale)
            for k, entry in enumerate(entries)
            if entry.sensed
        }
        self._trajectories = SampledTrajectoriesView(scene, samples, width)
        # sampled trajectories of a flight, time of the stored ones [s]
        self._drawn: tuple = (None, None)

    def update(
        self, timings: Sequence[LapTiming], by_speed: bool, trajectories: bool = True
    ) -> None:
        """by_speed: colour trails by speed, else by sampler; trajectories: of the first competitor,
        if it has some."""
        for drone, s in zip(self._drones, timings, strict=True):
            drone.show(s.entry, s.i, by_speed)
        for k, estimate in self._estimates.items():
            estimate.show(timings[k].entry, timings[k].i)
        self._impacts.show(timings)
        first = timings[0]
        self._course.colour(first.next_gate, crashed_gates(timings))
        live, stored = first.entry.sampled_trajectories, first.entry.snapshot(first.i)
        drawn = (live, stored[0] if stored else None) if trajectories else (None, None)
        if drawn[0] is self._drawn[0] and drawn[1] == self._drawn[1]:
            return
        self._drawn = drawn
        if trajectories and live:
            self._trajectories.show(live.paths, live.plan)
        else:
            self._trajectories.show(stored[1].best if trajectories and stored else None)


def preview(scene: viser.SceneApi, course: Course) -> float:
    """A course without a race; -> the size that drones will have [m]."""
    add_lights(scene)
    CourseView(scene, course)
    return SPAN * visible_scale(course)


def visible_scale(course: Course) -> float:
    """Factor on the size of the drones, to be seen where the whole course is in view."""
    wanted = np.clip(np.linalg.norm(np.ptp(course.points(frames=False), axis=0)) / 8.0, 2.0, 8.0)
    return float(min(wanted, 0.9 * GATE * gate_scale(course) / SPAN))


def gate_scale(course: Course) -> float:
    """Factor on arrows, lines and marks: the narrowest opening against that of a racing gate, at
    most 1."""
    return min(1.0, min(min(gate.opening) for gate in course.gates) / GATE)


class Impacts:
    """A red cross in space wherever something was hit so far."""

    def __init__(self, scene: viser.SceneApi, scale: float):
        # half of the diagonals of a cube
        arms = np.array(list(product((-1.0, 1.0), repeat=3))[:4], np.float32)
        self._arms = 0.35 * scale * np.stack([-arms, arms], axis=1)  # (4, 2, 3)
        none = np.zeros((4 * IMPACTS, 2, 3), np.float32)
        colour = single_colour(Style(RED, ()).rgb)
        self._lines = scene.add_line_segments(
            "/impacts", none, colour, thickness=0.13 * scale, visible=False
        )
        self._shown = 0

    def show(self, timings: Sequence[LapTiming]) -> None:
        spots = [
            e.position
            for s in timings
            for e in s.entry.events
            if e.kind in CRASHES and e.t <= s.t + 1e-9
        ]
        if len(spots) != self._shown:
            self._shown, self._lines.visible = len(spots), bool(spots)
            rows = np.resize(
                np.array(spots[-IMPACTS:] or [(0.0, 0.0, 0.0)], np.float32), (IMPACTS, 3)
            )
            crosses = (rows[:, None, None] + self._arms).reshape(-1, 2, 3)
            self._lines.points = crosses.astype(np.float32)


class CourseView:
    """Gates with their numbers, obstacles, the ground. All bars are one node: recolouring them
    sends one array.

    Each scene's has a name of its own. A page that is told to replace a node by another one of the
    same name gives the old one new arrays, and may draw it once more after its buffers are gone:
    GL_INVALID_OPERATION in the console.
    """

    def __init__(self, scene: viser.SceneApi, course: Course):
        self._gates, cube = len(course.gates), trimesh.creation.box()
        bars = [bars_of(gate) for gate in course.gates]
        centres, sizes, quaternions = (np.concatenate(part) for part in zip(*bars, strict=True))
        self._bars = scene.add_batched_meshes_simple(
            f"/course/gates/{next(SCENES)}",
            cube.vertices,
            cube.faces,
            batched_wxyzs=quaternions,
            batched_positions=centres,
            batched_scales=sizes,
            batched_colors=np.tile(PLAIN, (len(centres), 1)),
            flat_shading=True,
            side="double",
            lod="off",
        )
        for number, gate in enumerate(course.gates, 1):
            above = outer_half_sizes(gate.opening, gate.frame_width).up + 0.35 * gate_scale(course)
            top = np.array(gate.position) + above * gate.rotation[:, 2]
            scene.add_label(f"/course/number/{number}", str(number), position=top)
        scene.add_line_segments(
            "/course/arrows",
            _arrows(course),
            single_colour((130, 142, 165)),
            thickness=0.05 * gate_scale(course),
        )
        for number, obstacle in enumerate(course.obstacles, 1):
            _add_obstacle(scene, f"/course/obstacle/{number}", obstacle)
        _add_ground(scene, course)

    def colour(self, next_gate: int, hit: set[int]) -> None:
        """1-based numbers; 0: no gate is next."""
        colours = np.tile(PLAIN, (self._gates + 1, 1))  # the first is of no gate
        colours[list(hit)] = HIT_GATE
        colours[next_gate] = NEXT_GATE
        self._bars.batched_colors = np.repeat(colours[1:], 4, axis=0)


def bars_of(gate: Gate) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres (4, 3), sizes (4, 3) and quaternions wxyz (4, 4) of a gate's four bars in the
    world."""
    centres, halves = np.moveaxis(np.array(gate.bars, np.float32), 1, 0)
    quaternion = SO3.from_matrix(gate.rotation).wxyz
    return centres @ gate.rotation.T + gate.position, 2 * halves, np.tile(quaternion, (4, 1))


def _add_obstacle(scene: viser.SceneApi, name: str, obstacle: Obstacle) -> None:
    if isinstance(obstacle, Cylinder):
        body, yaw = trimesh.creation.cylinder(obstacle.radius, obstacle.height, sections=24), 0.0
    else:
        body, yaw = trimesh.creation.box(obstacle.size), obstacle.yaw
    place = {"wxyz": SO3.from_z_radians(yaw).wxyz, "position": obstacle.centre}
    scene.add_mesh_simple(
        name, body.vertices, body.faces, color=OBSTACLE, flat_shading=True, **place
    )


def _arrows(course: Course) -> np.ndarray:
    """One through every gate, along the legal passage.  (segments, 2, 3)"""
    arrows, scale = [], gate_scale(course)
    for gate in course.gates:
        along, left, _ = scale * gate.rotation.T
        tail, head = gate.position - 0.5 * along, gate.position + 0.7 * along
        arrows += [
            (tail, head),
            (head, head - 0.3 * along + 0.2 * left),
            (head, head - 0.3 * along - 0.2 * left),
        ]
    return np.array(arrows, np.float32)


def _add_ground(scene: viser.SceneApi, course: Course) -> None:
    points = course.points(frames=False)[:, :2]
    low, high = points.min(axis=0), points.max(axis=0)
    width, height = 2 * np.ceil((high - low) / 2 + 5)
    scene.add_grid(
        "/course/ground",
        width,
        height,
        position=(*(low + high) / 2, 0.0),
        cell_size=1.0,
        section_size=5.0,
        cell_color=(48, 53, 61),
        section_color=(84, 94, 110),
    )
