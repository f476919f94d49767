"""The map of the race, from above."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from quadsim.course import Course, Gate, Obstacle
from quadsim.web.page.parts.elements import Element, element
from quadsim.web.race.lap_timing import LapTiming, crashed_gates

# size of the map [px]
WIDTH = 330
HEIGHT = 190
SHORTEST = 9.0  # least length of a gate on the map [px]


class GateMark(NamedTuple):
    """A gate on the map."""

    start: np.ndarray  # beginning of the gate's line [px]  (2,)
    end: np.ndarray
    number: Element


class Map:
    """The course from above, its longer side horizontal, with the drones on it."""

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
        self._course = [element("polyline", look="way", points=self._outline(path))]
        for number, obstacle in enumerate(course.obstacles, 1):
            self._course.append(self._obstacle(number, obstacle))
        self._gates = [self._gate(number, gate) for number, gate in enumerate(course.gates, 1)]

    def draw(self, timings: list[LapTiming]) -> Element:
        """Return the map, with the first competitor's next gate in green and hit gates in red."""
        hit = crashed_gates(timings)
        next_gate = timings[0].next_gate if timings else None
        parts = [*self._course]
        for number, gate in enumerate(self._gates, 1):
            look = "gate"
            if number == next_gate:
                look = "gate next"
            elif number in hit:
                look = "gate hit"
            (x1, y1), (x2, y2) = gate.start.tolist(), gate.end.tolist()
            parts.append(element("line", look=look, x1=x1, y1=y1, x2=x2, y2=y2))
            parts.append(gate.number)
        # the first competitor on top
        for s in reversed(timings):
            x, y = self._pixels(s.entry.rows(("px", "py"), s.i)).tolist()
            values = {"colour": s.entry.style.colour}
            parts.append(element("circle", values=values, cx=x, cy=y, r=6))
        return element("svg", *parts, look="course-map", viewBox=f"0 0 {WIDTH} {HEIGHT}")

    def _pixels(self, p: np.ndarray) -> np.ndarray:
        """Return the position of x, y [m] on the map [px].  (2,)"""
        if self._turned:
            p = p[::-1]
        x, y = (p - self._low) * self._scale + self._margin
        return np.array([x, y if self._turned else HEIGHT - y])

    def _outline(self, points: Sequence[np.ndarray] | np.ndarray) -> str:
        """Return points [m] as SVG coordinates."""
        return " ".join(f"{x:.1f},{y:.1f}" for x, y in map(self._pixels, points))

    def _obstacle(self, number: int, obstacle: Obstacle) -> Element:
        """Return the outline of an obstacle, with its number as a tooltip."""
        title = element("title", f"obstacle {number}")
        outline = self._outline(obstacle.outline())
        return element("polygon", title, look="obstacle", points=outline)

    def _gate(self, number: int, gate: Gate) -> GateMark:
        """Return the line of a gate and its number beside it."""
        left = gate.rotation[:2, 1]
        across = left / max(float(np.linalg.norm(left)), 1e-6)
        centre = np.array(gate.position[:2])
        half = across * max(max(gate.opening), SHORTEST / self._scale) / 2
        a = self._pixels(centre - half)
        b = self._pixels(centre + half)
        x, y = (b + (b - a) / max(float(np.linalg.norm(b - a)), 1e-6) * 8).tolist()
        return GateMark(a, b, element("text", str(number), x=x, y=y + 3))
