"""The course from above as SVG, with the drones on it."""

from __future__ import annotations

import numpy as np

from quadsim.course import Course
from quadsim.palette import HIT, NEXT, style
from web.standing import Standing
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
        self._scale = min((WIDTH - 40) / span[0], (HEIGHT - 40) / span[1])
        self._low, self._margin = low, (np.array([WIDTH, HEIGHT]) - span * self._scale) / 2
        order_ = [*points, points[1]] if course.loop else points
        way = " ".join(f"{a:.1f},{b:.1f}" for a, b in map(self._at, order_))
        self._course = (
            f'<polyline points="{way}" fill="none" stroke="#4a5160" stroke-width="1.2" stroke-dasharray="3 4"/>'
        )
        self._gates = [
            self._gate(g.position, g.rotation[:2, 1], max(g.opening), k) for k, g in enumerate(course.gates, 1)
        ]

    def _at(self, p: np.ndarray) -> np.ndarray:
        p = np.array(p[1::-1] if self._turn else p[:2], float)
        x, y = (p - self._low) * self._scale + self._margin
        return np.array([x, y if self._turn else HEIGHT - y])

    def _gate(self, position: tuple, left: np.ndarray, width: float, number: int) -> str:
        half = left * max(width, 1.6) / 2
        a, b = self._at(np.array(position[:2]) - half), self._at(np.array(position[:2]) + half)
        beside = b + (b - a) / max(np.linalg.norm(b - a), 1e-6) * 8
        line = (
            f'<line x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}" stroke="STROKE" stroke-width="3"/>'
        )
        label = f'<text x="{beside[0]:.1f}" y="{beside[1] + 3:.1f}" fill="#aab2c0" font-size="10" text-anchor="middle">{number}</text>'
        return line + label

    def draw(self, all_: list[Standing]) -> str:
        following = all_[0].gate if all_ else 0
        hit = hit_gates(all_)
        gates = ""
        for number, gate in enumerate(self._gates, 1):
            gates += gate.replace("STROKE", NEXT if number == following else HIT if number in hit else "#e2e6ec")
        dots = ""
        for k, s in reversed(list(enumerate(all_))):
            x, y = self._at(np.array([s.lane.x["px"][s.i], s.lane.x["py"][s.i]]))
            fill = style(s.lane.sampler).colour
            dots += f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{6 if k == 0 else 5}" fill="{fill}" stroke="#111" stroke-width="1.5"/>'
        return f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" style="width:100%;display:block">{self._course}{gates}{dots}</svg>'
