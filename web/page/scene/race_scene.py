"""RaceScene: the course, the drones and the sampled trajectories in three dimensions."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count, product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import trimesh
import viser
from viser.transforms import SO3

from quadsim.course import Course, Cylinder, Gate, Obstacle
from quadsim.course.opening import outer_half_sizes
from quadsim.palette import HIT_ON_DARK, NEXT, Style
from quadsim.record.run import CRASHES
from quadsim.web.page.scene.drones import (
    SPAN,
    Drone,
    ExpectedPathsView,
    SampledTrajectoriesView,
    add_lights,
    array_colour,
    single_colour,
)
from quadsim.web.page.scene.estimate import EstimateView
from quadsim.web.page.scene.limit_ghost import LimitGhost
from quadsim.web.race.competitor import Competitor, heat_of
from quadsim.web.race.lap_timing import LapTiming, crashed_gates
from quadsim.web.race.limit_race import limit_race

if TYPE_CHECKING:
    from quadsim.controllers.sampled_trajectories import SampledTrajectories

# colours
PLAIN = array_colour((206, 210, 216))
NEXT_GATE = array_colour(Style(NEXT, ()).rgb)
HIT_GATE = array_colour(Style(HIT_ON_DARK, ()).rgb)
OBSTACLE = (176, 150, 110)
ARROW = (130, 142, 165)
CELL = (48, 53, 61)
SECTION = (84, 94, 110)

GATE = 1.5  # opening of a racing gate [m]
GROUND_MARGIN = 5.0  # width of the ground around the course [m]
IMPACTS = 12  # number of the last impacts that are marked
ARM = 0.35  # half length of the cross at an impact, for a racing gate [m]
SCENES = count()  # numbers of their gates' nodes


class Drawn(NamedTuple):
    """The drawn sampled trajectories."""

    live: SampledTrajectories | None
    stored: float | None  # time of the trajectories of a stored run [s]


class RaceScene:
    """Everything in the scene of one race.

    Args:
        true_size: whether the drones have their true size; otherwise they are enlarged.
        samples: number of drawn sampled trajectories.

    Attributes:
        drone_size: size of the drawn drones [m]
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        entries: Sequence[Competitor],
        true_size: bool = False,
        samples: int = 63,
    ):
        course = entries[0].course
        scale = 1.0 if true_size else visible_scale(course)
        width = gate_scale(course)
        self.drone_size = SPAN * scale
        add_lights(scene)
        self._course = CourseView(scene, course)
        self._impacts = Impacts(scene, width)
        self._drones: list[Drone] = []
        self._estimates: dict[int, EstimateView] = {}
        for k, entry in enumerate(entries):
            drone = Drone(
                scene,
                str(k),
                entry,
                ghost=k > 0,
                is_named=len(entries) > 1,
                scale=scale,
                width=width,
            )
            self._drones.append(drone)
            if entry.sensed:
                self._estimates[k] = EstimateView(scene, str(k), scale)
        # Drones of one world predict each other's paths.
        together = bool(heat_of(entries)) and len(entries) > 1
        self._expected = [
            ExpectedPathsView(scene, str(k), entry, width)
            for k, entry in enumerate(entries if together else ())
        ]
        self._trajectories = SampledTrajectoriesView(scene, samples, width)
        self._drawn = Drawn(None, None)
        self._limit = LimitGhost(scene, limit_race(entries[0]), scale, width)

    def update(
        self, timings: Sequence[LapTiming], by_speed: bool, trajectories: bool = True
    ) -> None:
        """Show the race at one instant.

        Args:
            by_speed: colour trails by speed, else by sampler.
            trajectories: show the sampled trajectories of the first competitor, if any, and the
                predicted paths of drones in one world.
        """
        for drone, s in zip(self._drones, timings, strict=True):
            drone.show(s.entry, s.i, by_speed)
        for k, estimate in self._estimates.items():
            estimate.show(timings[k].entry, timings[k].i)
        for view, s in zip(self._expected, timings, strict=False):
            view.show(s.entry.expected if trajectories and s.is_latest else ())
        self._impacts.show(timings)
        first = timings[0]
        self._course.colour(first.next_gate, crashed_gates(timings))
        self._show_trajectories(first, trajectories)

    def update_limit(self, first: LapTiming, on: bool, by_place: bool) -> None:
        """Show or hide the best known race, at the time or the place of the first competitor."""
        if on:
            self._limit.show(first.t, first.place if by_place else None)
        else:
            self._limit.hide()

    def _show_trajectories(self, first: LapTiming, on: bool) -> None:
        """Show the sampled trajectories of the first competitor."""
        live = first.entry.sampled_trajectories if on and first.is_latest else None
        stored = first.entry.snapshot(first.i) if on else None
        drawn = Drawn(live, stored[0] if stored else None)
        if drawn.live is self._drawn.live and drawn.stored == self._drawn.stored:
            return
        self._drawn = drawn
        if live:
            self._trajectories.show(live.paths, live.plan)
        elif stored:
            _, snapshot = stored
            self._trajectories.show(snapshot.best)
        else:
            self._trajectories.show(None)


def preview(scene: viser.SceneApi, course: Course) -> float:
    """Show a course without a race, and return the size of its drones [m]."""
    add_lights(scene)
    CourseView(scene, course)
    return SPAN * visible_scale(course)


def visible_scale(course: Course) -> float:
    """Return the scale of the drones that makes them visible in a view of the whole course."""
    extent = np.linalg.norm(np.ptp(course.points(frames=False), axis=0))  # [m]
    wanted = np.clip(extent / 8.0, 2.0, 8.0)
    fitting = 0.9 * GATE * gate_scale(course) / SPAN
    return float(min(wanted, fitting))


def gate_scale(course: Course) -> float:
    """Return the factor on arrows, lines and marks.

    The factor is the ratio of the narrowest opening to a racing gate's opening, at most 1.
    """
    narrowest = min(min(gate.opening) for gate in course.gates)
    return min(1.0, narrowest / GATE)


class Impacts:
    """Red crosses at the places of hits so far. scale: factor on their size."""

    def __init__(self, scene: viser.SceneApi, scale: float):
        # half of the diagonals of a cube
        arms = np.array(list(product((-1.0, 1.0), repeat=3))[:4], np.float32)
        self._arms = ARM * scale * np.stack([-arms, arms], axis=1)  # (4, 2, 3)
        self._shown = 0
        self._lines = scene.add_line_segments(
            "/impacts",
            np.zeros((4 * IMPACTS, 2, 3), np.float32),
            single_colour(Style(HIT_ON_DARK, ()).rgb),
            thickness=0.13 * scale,
            visible=False,
        )

    def show(self, timings: Sequence[LapTiming]) -> None:
        """Show the impacts so far."""
        spots = [
            event.position
            for s in timings
            for event in s.entry.events_until(s.t)
            if event.kind in CRASHES
        ]
        if len(spots) == self._shown:
            return
        self._shown = len(spots)
        self._lines.visible = bool(spots)
        last = np.array(spots[-IMPACTS:] or [(0.0, 0.0, 0.0)], np.float32)
        # The array keeps its length: fewer impacts are repeated.
        rows = np.resize(last, (IMPACTS, 3))
        crosses = (rows[:, None, None] + self._arms).reshape(-1, 2, 3)
        self._lines.points = crosses.astype(np.float32)


class CourseView:
    """Gates with their numbers, obstacles, the ground.

    The bars of all gates are one node, so that recolouring them sends one array. The name of this
    node is unique to the scene: a page that replaces a node by one of the same name gives the old
    node new arrays, and may draw it again after its buffers are gone, which logs
    GL_INVALID_OPERATION in the console.

    Attributes:
        bars: the node of the bars of all gates, four each.
        obstacles: the nodes of the obstacles.
    """

    def __init__(self, scene: viser.SceneApi, course: Course):
        self._gates = len(course.gates)
        cube = trimesh.creation.box()
        bars = all_bars_of(course)
        self.bars = scene.add_batched_meshes_simple(
            f"/course/gates/{next(SCENES)}",
            cube.vertices,
            cube.faces,
            batched_wxyzs=bars.quaternions,
            batched_positions=bars.centres,
            batched_scales=bars.sizes,
            batched_colors=np.tile(PLAIN, (len(bars.centres), 1)),
            flat_shading=True,
            side="double",
            lod="off",
        )
        scale = gate_scale(course)
        self._numbers = [
            scene.add_label(f"/course/number/{number}", str(number), position=above(gate, scale))
            for number, gate in enumerate(course.gates, 1)
        ]
        self._arrows = scene.add_line_segments(
            "/course/arrows", arrows(course), single_colour(ARROW), thickness=0.05 * scale
        )
        self.obstacles = [
            _add_obstacle(scene, f"/course/obstacle/{number}", obstacle)
            for number, obstacle in enumerate(course.obstacles, 1)
        ]
        add_ground(scene, course)

    def move(self, course: Course) -> None:
        """Move the gates and obstacles, whose number and sizes are unchanged."""
        bars = all_bars_of(course)
        self.bars.batched_positions = bars.centres
        self.bars.batched_wxyzs = bars.quaternions
        self.bars.batched_scales = bars.sizes
        scale = gate_scale(course)
        for label, gate in zip(self._numbers, course.gates, strict=True):
            label.position = above(gate, scale)
        self._arrows.points = arrows(course)
        for node, obstacle in zip(self.obstacles, course.obstacles, strict=True):
            node.position = obstacle.centre
            node.wxyz = SO3.from_z_radians(_yaw_of(obstacle)).wxyz

    def colour(self, next_gate: int, hit: set[int]) -> None:
        """Colour the next gate and the hit gates.

        Args:
            next_gate, hit: 1-based numbers; 0: no gate is next.
        """
        colours = np.tile(PLAIN, (self._gates + 1, 1))  # the first is of no gate
        colours[list(hit)] = HIT_GATE
        colours[next_gate] = NEXT_GATE
        self.bars.batched_colors = np.repeat(colours[1:], 4, axis=0)


class Bars(NamedTuple):
    """The four bars of a gate in the world."""

    centres: np.ndarray  # [m]  (4, 3)
    sizes: np.ndarray  # [m]  (4, 3)
    quaternions: np.ndarray  # wxyz  (4, 4)


def bars_of(gate: Gate) -> Bars:
    """Return the bars of a gate."""
    centres, halves = np.moveaxis(np.array(gate.bars, np.float32), 1, 0)
    quaternion = SO3.from_matrix(gate.rotation).wxyz
    in_world = centres @ gate.rotation.T + gate.position
    return Bars(in_world, 2 * halves, np.tile(quaternion, (4, 1)))


def all_bars_of(course: Course) -> Bars:
    """Return the bars of all gates, in their order, as float32."""
    bars = [bars_of(gate) for gate in course.gates]
    return Bars(
        centres=np.concatenate([bar.centres for bar in bars]).astype(np.float32),
        sizes=np.concatenate([bar.sizes for bar in bars]).astype(np.float32),
        quaternions=np.concatenate([bar.quaternions for bar in bars]).astype(np.float32),
    )


def above(gate: Gate, scale: float) -> np.ndarray:
    """Return the position of a gate's number [m].  (3,)

    scale: as of `gate_scale`.
    """
    up = outer_half_sizes(gate.opening, gate.frame_width).up + 0.35 * scale
    return np.array(gate.position) + up * gate.rotation[:, 2]


def _yaw_of(obstacle: Obstacle) -> float:
    """Return the direction of an obstacle's x axis [rad]."""
    return 0.0 if isinstance(obstacle, Cylinder) else obstacle.yaw


def _add_obstacle(scene: viser.SceneApi, name: str, obstacle: Obstacle) -> viser.MeshHandle:
    """Add an obstacle to the scene."""
    if isinstance(obstacle, Cylinder):
        body = trimesh.creation.cylinder(obstacle.radius, obstacle.height, sections=24)
    else:
        body = trimesh.creation.box(obstacle.size)
    return scene.add_mesh_simple(
        name,
        body.vertices,
        body.faces,
        color=OBSTACLE,
        flat_shading=True,
        wxyz=SO3.from_z_radians(_yaw_of(obstacle)).wxyz,
        position=obstacle.centre,
    )


def arrows(course: Course) -> np.ndarray:
    """Return an arrow through every gate, along the legal passage.  (segments, 2, 3)"""
    lines = []
    for gate in course.gates:
        along, left, _ = gate_scale(course) * gate.rotation.T
        tail = gate.position - 0.5 * along
        head = gate.position + 0.7 * along
        lines.append((tail, head))
        lines.append((head, head - 0.3 * along + 0.2 * left))
        lines.append((head, head - 0.3 * along - 0.2 * left))
    return np.array(lines, np.float32)


def add_ground(scene: viser.SceneApi, course: Course) -> None:
    """Add the ground below the course."""
    points = course.points(frames=False)[:, :2]
    low = points.min(axis=0)
    high = points.max(axis=0)
    width, height = 2 * np.ceil((high - low) / 2 + GROUND_MARGIN)
    scene.add_grid(
        "/course/ground",
        width,
        height,
        position=(*(low + high) / 2, 0.0),
        cell_size=1.0,
        section_size=5.0,
        cell_color=CELL,
        section_color=SECTION,
    )
