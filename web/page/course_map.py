"""The map of the race, from above."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from quadsim.course import Course, Gate, Obstacle
from quadsim.palette import NEXT
from quadsim.web.lap_timing import LapTiming, crashed_gates
from quadsim.web.page.html import GREY, MARKER_EDGE, RED, svg

# size of the map [px]
WIDTH = 330
HEIGHT = 190
SHORTEST = 9.0  # least length of a gate on the map [px]


class GateMark(NamedTuple):
    """A gate on the map."""

    start: np.ndarray  # beginning of the gate's line [px]  (2,)
    end: np.ndarray
    number: str  # as SVG


class Map:
    """The course from above as SVG, its longer side horizontal, with the drones on it."""

    def __init__(self, course: Course):
        points = course.points(frames=False)[:, :2]
        low = points.min(axis=0)
        span = np.maximum(np.ptp(points, axis=0), 1.0)
        self._turned = span[1] > span[0]
        if self._turned:
            low = low[::-1]
            span = span[::-1]
        self._scale = min((WIDTH - 90) / span[0], (HEIGHT - 60) / span[1])  # [px/m]
        self._low = low
        self._margin = (np.array([WIDTH, HEIGHT]) - span * self._scale) / 2
        path = [*points, points[1]] if course.loop else points
        dashed = {"fill": "none", "stroke": "#4a5160", "stroke_dasharray": "3 4"}
        self._course = svg("polyline", points=self._outline(path), **dashed)
        for number, obstacle in enumerate(course.obstacles, 1):
            self._course += self._obstacle(number, obstacle)
        self._gates = [self._gate(number, gate) for number, gate in enumerate(course.gates, 1)]

    def draw(self, timings: list[LapTiming]) -> str:
        """Return the map, with the first competitor's next gate in green and hit gates in red."""
        hit = crashed_gates(timings)
        next_gate = timings[0].next_gate if timings else None
        parts = [self._course]
        for number, gate in enumerate(self._gates, 1):
            colour = GREY
            if number == next_gate:
                colour = NEXT
            elif number in hit:
                colour = RED
            (x1, y1), (x2, y2) = gate.start, gate.end
            parts.append(svg("line", stroke=colour, stroke_width=3, x1=x1, y1=y1, x2=x2, y2=y2))
            parts.append(gate.number)
        # the first competitor on top
        for s in reversed(timings):
            x, y = self._pixels(s.entry.rows(("px", "py"), s.i))
            colour = s.entry.style.colour
            parts.append(svg("circle", cx=x, cy=y, r=6, fill=colour, stroke=MARKER_EDGE))
        look = {"viewBox": f"0 0 {WIDTH} {HEIGHT}", "style": "width:100%;display:block"}
        whole = svg("svg", "".join(parts), **look)
        return whole.replace("<svg ", '<svg class="course-map" ', 1)

    def _pixels(self, p: np.ndarray) -> np.ndarray:
        """Return the position of x, y [m] on the map [px].  (2,)"""
        if self._turned:
            p = p[::-1]
        x, y = (p - self._low) * self._scale + self._margin
        return np.array([x, y if self._turned else HEIGHT - y])

    def _outline(self, points: Sequence[np.ndarray] | np.ndarray) -> str:
        """Return points [m] as SVG coordinates."""
        return " ".join(f"{x:.1f},{y:.1f}" for x, y in map(self._pixels, points))

    def _obstacle(self, number: int, obstacle: Obstacle) -> str:
        """Return the outline of an obstacle, with its number as a tooltip.

        The stroke makes a thin pole visible.
        """
        look = {"fill": "#7a6a50", "stroke": "#b0966e", "stroke_width": 2.5}
        title = svg("title", f"obstacle {number}")
        return svg("polygon", title, points=self._outline(obstacle.outline()), **look)

    def _gate(self, number: int, gate: Gate) -> GateMark:
        """Return the line of a gate and its number beside it."""
        left = gate.rotation[:2, 1]
        across = left / max(float(np.linalg.norm(left)), 1e-6)
        centre = np.array(gate.position[:2])
        half = across * max(max(gate.opening), SHORTEST / self._scale) / 2
        a = self._pixels(centre - half)
        b = self._pixels(centre + half)
        x, y = b + (b - a) / max(float(np.linalg.norm(b - a)), 1e-6) * 8
        look = {"fill": "#aab2c0", "font_size": 15, "text_anchor": "middle"}
        return GateMark(a, b, svg("text", str(number), x=x, y=y + 3, **look))
