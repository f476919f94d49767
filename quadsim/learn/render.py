"""What environments show: a page in the browser (human), or pictures of gates and vehicles from
above (rgb_array)."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from quadsim.course import Course
from quadsim.course.opening import outer_half_sizes
from quadsim.dynamics.quadrotor import POSITION, VELOCITY
from quadsim.spec.settings import SettingError

RENDER_MODES = ("human", "rgb_array")

SIZE = (480, 640)  # height, width [pixels]
FRAME, BACKGROUND = (70, 70, 80), (250, 250, 252)
# colours of vehicles at the floor and at the ceiling
LOW, HIGH = np.array((30, 90, 200)), np.array((220, 60, 30))


class Renderer:
    """Shows the vehicles of an environment in its render_mode. Raises SettingError for one that
    there is not."""

    def __init__(self, mode: str | None, course: Course, vehicles: int, dt: float):
        if mode not in (None, *RENDER_MODES):
            raise SettingError(
                "render_mode", f"expected None, 'human' or 'rgb_array', got {mode!r}"
            )
        self._mode, self._of = mode, (course, vehicles, dt)
        self._page: Any = None

    def update(self, states: Callable[[], np.ndarray]) -> None:
        """Show the states on the page of mode human, after a reset and each step.  -> (vehicles,
        10): p, v, q wxyz"""
        if self._mode != "human":
            return
        if self._page is None:  # imported by name: the page is a layer above, and loads viser
            self._page = import_module("web.page.env_page").EnvPage(*self._of)
        self._page.show(states())

    def picture(self, states: np.ndarray) -> np.ndarray | None:
        """Of render(): (height, width, 3) uint8 where the mode is rgb_array."""
        return picture(self._of[0], states) if self._mode == "rgb_array" else None

    def close(self) -> None:
        if self._page is not None:
            self._page.close()
            self._page = None


def picture(course: Course, states: np.ndarray) -> np.ndarray:
    """states: (vehicles, 10), position, velocity, attitude. -> (height, width, 3) uint8"""
    (x_low, x_high), (y_low, y_high), (z_low, z_high) = course.bounds
    height, width = SIZE
    scale = min((width - 20) / (x_high - x_low), (height - 20) / (y_high - y_low))  # [pixels/m]
    found = np.full((height, width, 3), BACKGROUND, np.uint8)

    def pixels(points: np.ndarray) -> np.ndarray:
        columns = width / 2 + (points[..., 0] - (x_low + x_high) / 2) * scale
        rows = height / 2 - (points[..., 1] - (y_low + y_high) / 2) * scale
        return np.stack([np.clip(rows, 2, height - 3), np.clip(columns, 2, width - 3)], -1).astype(
            int
        )

    def dots(points: np.ndarray, colour: np.ndarray, radius: int) -> None:
        at = pixels(points)
        for dr in range(-radius, radius + 1):
            for dc in range(-radius, radius + 1):
                found[at[:, 0] + dr, at[:, 1] + dc] = colour

    for gate in course.gates:
        left = outer_half_sizes(gate.opening, gate.frame_width).left * gate.rotation[:, 1]
        dots(np.array(gate.position) + np.linspace(-1, 1, 60)[:, None] * left, np.array(FRAME), 1)
    positions, velocities = states[:, POSITION], states[:, VELOCITY]
    share = np.clip((positions[:, 2] - z_low) / (z_high - z_low), 0, 1)[:, None]
    colours = (LOW + share * (HIGH - LOW)).astype(np.uint8)
    # a tenth of a second of flight
    ahead = positions + np.linspace(0, 0.1, 8)[:, None, None] * velocities
    for points in ahead:
        dots(points, colours, 0)
    dots(positions, colours, 2)
    return found
