"""The course from above as SVG, with the drones on it."""

from __future__ import annotations

import numpy as np

from quadsim.course import Course, Gate
from quadsim.palette import HIT, NEXT, style
from web.html import svg
from web.lap_timing import LapTiming
from web.timing import hit_gates

WIDTH, HEIGHT = 330, 190  # [px]


class Map:
    """The course from above, with the drones on it."""

    def __init__(self, course: Course):
        points = np.array([course.start.position[:2], *(g.position[:2] for g in course.gates)])
        low, span = points.min(axis=0), np.maximum(np.ptp(points, axis=0), 1.0)
        self._turn = span[1] > span[0]  # the longer side lies flat
        if self._turn:
            low, span = low[::-1], span[::-1]
        self._scale = min((WIDTH - 90) / span[0], (HEIGHT - 60) / span[1])
        self._low, self._margin = low, (np.array([WIDTH, HEIGHT]) - span * self._scale) / 2
        order_ = [*points, points[1]] if course.loop else points
        way = " ".join(f"{a:.1f},{b:.1f}" for a, b in map(self._at, order_))
        self._course = svg("polyline", points=way, fill="none", stroke="#4a5160", stroke_dasharray="3 4")
        self._gates = [self._gate(k, gate) for k, gate in enumerate(course.gates, 1)]

    def _at(self, p: np.ndarray) -> np.ndarray:
        p = np.array(p[1::-1] if self._turn else p[:2], float)
        x, y = (p - self._low) * self._scale + self._margin
        return np.array([x, y if self._turn else HEIGHT - y])

    def _gate(self, number: int, gate: Gate) -> tuple[dict, str]:
        """Its line's ends, and its number beside it."""
        half = gate.rotation[:2, 1] * max(*gate.opening, 1.6) / 2
        a, b = self._at(np.array(gate.position[:2]) - half), self._at(np.array(gate.position[:2]) + half)
        x, y = b + (b - a) / max(float(np.linalg.norm(b - a)), 1e-6) * 8
        label = svg("text", str(number), x=x, y=y + 3, fill="#aab2c0", font_size=10, text_anchor="middle")
        return dict(zip(("x1", "y1", "x2", "y2"), (*a, *b), strict=True)), label

    def draw(self, all_: list[LapTiming]) -> str:
        """The next gate of the first competitor is green, gates that were hit are red."""
        hit, parts = hit_gates(all_), [self._course]
        for number, (ends, label) in enumerate(self._gates, 1):
            following = bool(all_) and number == all_[0].gate
            colour = NEXT if following else HIT if number in hit else "#e2e6ec"
            parts += [svg("line", stroke=colour, stroke_width=3, **ends), label]
        for s in reversed(all_):
            x, y = self._at(np.array([s.competitor.x["px"][s.i], s.competitor.x["py"][s.i]]))
            parts.append(svg("circle", cx=x, cy=y, r=6, fill=style(s.competitor.sampler).colour, stroke="#111"))
        return svg("svg", "".join(parts), viewBox=f"0 0 {WIDTH} {HEIGHT}", style="width:100%;display:block")
