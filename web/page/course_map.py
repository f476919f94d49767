"""Where the race is: the course from above, and the time line with laps, gates and hits."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from quadsim.course import Course, Gate, Obstacle
from quadsim.palette import NEXT
from web.competitor import CRASHES, Competitor
from web.lap_timing import MISSES, LapTiming, crashed_gates
from web.page.html import DIM, GREY, MARKER_EDGE, RED, TRACK, svg

WIDTH, HEIGHT = 330, 190  # of the map [px]
LONG, ROW = 500, 11  # of the time line and of one competitor on it [px]
SHORTEST = 9.0  # of a gate on the map [px]


def timeline(entries: Sequence[Competitor], t: float, end: float) -> str:
    """A row a competitor: ticks at gates, taller where a lap ends, red at hits and misses; the
    white line is now."""
    scale, height = LONG / max(end, 1e-3), ROW * len(entries) + 11
    parts = []
    for k, e in enumerate(entries):
        y, last = ROW * k + 1.0, float(e.t[-1]) if len(e.t) else 0.0
        parts.append(svg("rect", x=0, y=y + 3, width=last * scale, height=3, fill=e.style.colour))
        for event in e.events:
            bad = event.kind in (*CRASHES, *MISSES)
            tall = 9.0 if bad or event.gate == e.legs.gates else 5.0
            look = {"stroke": RED if bad else GREY, "stroke_width": 2.5 if bad else 1.2}
            x = event.t * scale
            parts.append(
                svg("line", x1=x, x2=x, y1=y + 4.5 - tall / 2, y2=y + 4.5 + tall / 2, **look)
            )
    for number, (a, b) in enumerate(
        pairwise(max(entries, key=lambda e: len(e.laps)).lap_starts), 1
    ):
        words = {"y": height - 1.0, "fill": DIM, "font_size": 9, "text_anchor": "middle"}
        parts.append(svg("text", f"lap {number}", x=(a + b) / 2 * scale, **words))
    x = min(t, end) * scale
    parts.append(svg("line", x1=x, x2=x, y1=0, y2=height - 10, stroke="#fff", stroke_width=2))
    look = f"width:100%;display:block;margin-top:5px;background:linear-gradient({TRACK},{TRACK}) 0 0/100% 1px no-repeat"
    return svg("svg", "".join(parts), viewBox=f"-3 0 {LONG + 6} {height}", style=look)


class Map:
    """The course from above as SVG, its longer side horizontal, with the drones on it."""

    def __init__(self, course: Course):
        points = course.points(frames=False)[:, :2]
        low, span = points.min(axis=0), np.maximum(np.ptp(points, axis=0), 1.0)
        self._turned = span[1] > span[0]
        if self._turned:
            low, span = low[::-1], span[::-1]
        self._scale = min((WIDTH - 90) / span[0], (HEIGHT - 60) / span[1])
        self._low, self._margin = low, (np.array([WIDTH, HEIGHT]) - span * self._scale) / 2
        path = [*points, points[1]] if course.loop else points
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in map(self._pixels, path))
        self._course = svg(
            "polyline", points=path, fill="none", stroke="#4a5160", stroke_dasharray="3 4"
        )
        self._course += "".join(
            self._obstacle(number, o) for number, o in enumerate(course.obstacles, 1)
        )
        self._gates = [self._gate(number, gate) for number, gate in enumerate(course.gates, 1)]

    def draw(self, timings: list[LapTiming]) -> str:
        """The next gate of the first competitor is green, gates that were hit are red."""
        hit, parts = crashed_gates(timings), [self._course]
        for number, (ends, number_text) in enumerate(self._gates, 1):
            colour = (
                NEXT
                if timings and number == timings[0].next_gate
                else RED
                if number in hit
                else GREY
            )
            parts += [svg("line", stroke=colour, stroke_width=3, **ends), number_text]
        for s in reversed(timings):
            x, y = self._pixels(s.entry.rows(("px", "py"), s.i))
            parts.append(
                svg("circle", cx=x, cy=y, r=6, fill=s.entry.style.colour, stroke=MARKER_EDGE)
            )
        return svg(
            "svg", "".join(parts), viewBox=f"0 0 {WIDTH} {HEIGHT}", style="width:100%;display:block"
        )

    def _pixels(self, p: np.ndarray) -> np.ndarray:
        """From x, y [m]."""
        x, y = ((p[::-1] if self._turned else p) - self._low) * self._scale + self._margin
        return np.array([x, y if self._turned else HEIGHT - y])

    def _obstacle(self, number: int, obstacle: Obstacle) -> str:
        """Its outline, whose stroke makes a thin pole visible; the number is shown under the
        pointer."""
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in map(self._pixels, obstacle.outline()))
        look = {"fill": "#7a6a50", "stroke": "#b0966e", "stroke_width": 2.5}
        return svg("polygon", svg("title", f"obstacle {number}"), points=points, **look)

    def _gate(self, number: int, gate: Gate) -> tuple[dict, str]:
        """The ends of its line, and its number beside it."""
        across = gate.rotation[:2, 1] / max(float(np.linalg.norm(gate.rotation[:2, 1])), 1e-6)
        centre, half = (
            np.array(gate.position[:2]),
            across * max(max(gate.opening), SHORTEST / self._scale) / 2,
        )
        a, b = self._pixels(centre - half), self._pixels(centre + half)
        x, y = b + (b - a) / max(float(np.linalg.norm(b - a)), 1e-6) * 8
        number_text = svg(
            "text", str(number), x=x, y=y + 3, fill="#aab2c0", font_size=10, text_anchor="middle"
        )
        return dict(zip(("x1", "y1", "x2", "y2"), (*a, *b), strict=True)), number_text
