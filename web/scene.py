"""The course in three dimensions: gates, ground, numbers; what stands still."""

from __future__ import annotations

import numpy as np
import viser
from viser.transforms import SO3

from quadsim.course import Course, Gate
from quadsim.palette import HIT, NEXT, Style
from web.mesh import BOX, BOX_FACES

DEPTH = 0.12  # of a gate's bars along its passage [m]
PLAIN = np.array((206, 210, 216), np.uint8)
NEXT_RGB, HIT_RGB = Style(NEXT, ()).rgb, Style(HIT, ()).rgb


class CourseView:
    """All bars of all gates are one node, so that recolouring them is one array."""

    def __init__(self, scene: viser.SceneApi, course: Course):
        self._gates = len(course.gates)
        poses = [_bars(gate) for gate in course.gates]
        positions, sizes, turns = (np.concatenate(part) for part in zip(*poses, strict=True))
        self._colours = np.tile(PLAIN, (len(positions), 1))
        self._bars = scene.add_batched_meshes_simple(
            "/course/gates",
            BOX,
            BOX_FACES,
            batched_wxyzs=turns,
            batched_positions=positions,
            batched_scales=sizes.astype(np.float32),
            batched_colors=self._colours,
            flat_shading=True,
            side="double",
            lod="off",
        )
        for number, gate in enumerate(course.gates, 1):
            top = np.array(gate.position) + gate.rotation[:, 2] * (gate.opening[1] / 2 + gate.frame_width + 0.35)
            scene.add_label(f"/course/number/{number}", str(number), position=top)
        scene.add_line_segments("/course/ways", _ways(course), (120, 132, 150), thickness=0.05)
        _ground(scene, course)

    def colour(self, next_gate: int, hit: set[int]) -> None:
        """1-based numbers; 0: no gate is next."""
        colours = np.tile(PLAIN, (self._gates, 1))
        for number in hit:
            colours[number - 1] = HIT_RGB
        if next_gate:
            colours[next_gate - 1] = NEXT_RGB
        colours = np.repeat(colours, 4, axis=0)
        if not np.array_equal(colours, self._colours):
            self._bars.batched_colors = self._colours = colours


def _bars(gate: Gate) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres (4, 3), sizes (4, 3) and turns wxyz (4, 4) of a gate's four bars."""
    (w, h), f = gate.opening, gate.frame_width
    local = np.array([(0, 0, (h + f) / 2), (0, 0, -(h + f) / 2), (0, (w + f) / 2, 0), (0, -(w + f) / 2, 0)])
    sizes = np.array([(DEPTH, w + 2 * f, f)] * 2 + [(DEPTH, f, h)] * 2)
    turn = SO3.from_matrix(gate.rotation).wxyz
    return local @ gate.rotation.T + gate.position, sizes, np.tile(turn, (4, 1))


def _ways(course: Course) -> np.ndarray:
    """An arrow through every gate, along the legal passage.  (segments, 2, 3)"""
    arrows = []
    for gate in course.gates:
        along, left, _ = gate.rotation.T
        tail, head = gate.position - 0.5 * along, gate.position + 0.7 * along
        arrows += [(tail, head), (head, head - 0.3 * along + 0.2 * left), (head, head - 0.3 * along - 0.2 * left)]
    return np.array(arrows, np.float32)


def _ground(scene: viser.SceneApi, course: Course) -> None:
    (x0, x1), (y0, y1) = extent(course)[:2]
    scene.add_grid(
        "/course/ground",
        width=2 * np.ceil((x1 - x0) / 2 + 5),
        height=2 * np.ceil((y1 - y0) / 2 + 5),
        position=((x0 + x1) / 2, (y0 + y1) / 2, 0.0),
        cell_size=1.0,
        section_size=5.0,
        cell_color=(48, 53, 61),
        section_color=(84, 94, 110),
    )


def extent(course: Course) -> tuple[tuple[float, float], ...]:
    """Of start and gates, ((x, x), (y, y), (z, z)) [m]."""
    points = np.array([course.start.position, *(g.position for g in course.gates)])
    low, high = points.min(axis=0), points.max(axis=0)
    return tuple(zip(low.tolist(), high.tolist(), strict=True))


def visible_scale(course: Course) -> float:
    """How much larger than it is a drone is drawn, to be seen where the whole course is in view."""
    low, high = np.array(extent(course)).T
    return float(np.clip(np.linalg.norm(high - low) / 8.0, 2.0, 8.0))
