"""Views of an environment: a viewer's page, or pictures from above (rgb_array).

Gymnasium itself provides the mode "human", which shows the pictures in a window of pygame.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from PIL import Image, ImageDraw

from quadsim.course import Course
from quadsim.course.opening import outer_half_sizes
from quadsim.dynamics.quadrotor import POSITION, VELOCITY
from quadsim.files.values import SettingError
from quadsim.files.yaml_errors import shown_value

RENDER_MODES = ("rgb_array",)

WIDTH = 640  # width of a picture [pixels]
HEIGHT = 480
BORDER = 10  # around the course [pixels]
FRAME = (70, 70, 80)
BACKGROUND = (250, 250, 252)
# colours of vehicles at the floor and at the ceiling
LOW = np.array((30, 90, 200))
HIGH = np.array((220, 60, 30))
AHEAD = 0.1  # a vehicle's velocity is drawn as its displacement in this time [s]
RADIUS = 2.5  # radius of a vehicle [pixels]


class Viewer(Protocol):
    """A viewer displays the vehicles of an environment."""

    def show(self, states: np.ndarray) -> None:
        """Show vehicles by position [m], velocity [m/s] and attitude (wxyz).  (vehicles, 10)"""

    def close(self) -> None:
        """Close the view."""


# (course, vehicles, dt) -> Viewer; dt: duration of a step [s]
ViewerFactory = Callable[[Course, int, float], Viewer]


class Renderer:
    """Pictures of the vehicles of an environment, and its viewer.

    Args:
        mode: None or "rgb_array".
        viewer: function that makes a viewer for every step; None: no viewer.
        course: the course that is shown.
        vehicles: number of vehicles.
        dt: duration of a step [s].

    Raises:
        SettingError: the mode does not exist, or the viewer cannot be called.
    """

    def __init__(
        self,
        mode: str | None,
        viewer: ViewerFactory | None,
        course: Course,
        vehicles: int,
        dt: float,
    ):
        if not (mode is None or (isinstance(mode, str) and mode in RENDER_MODES)):
            wanted = f"expected None or 'rgb_array', got {shown_value(mode)}"
            page = "viewer=quadsim.web.page.env_page.EnvPage shows a page"
            ways = f"gymnasium.make opens a window; {page}"
            raise SettingError("render_mode", f"{wanted}: {ways}" if mode == "human" else wanted)
        if not (viewer is None or callable(viewer)):
            wanted = "expected a class or a function that makes a viewer"
            raise SettingError("viewer", f"{wanted}, got {shown_value(viewer)}")
        self._mode = mode
        self._factory = viewer
        self._course = course
        self._vehicles = vehicles
        self._dt = dt
        self._viewer: Viewer | None = None

    def update(self, states: Callable[[], np.ndarray]) -> None:
        """Show the states in the viewer, after a reset and after each step.

        Args:
            states: function that returns the array for Viewer.show.  (vehicles, 10)
        """
        if self._factory is None:
            return
        if self._viewer is None:
            self._viewer = self._factory(self._course, self._vehicles, self._dt)
        self._viewer.show(states())

    def picture(self, states: np.ndarray) -> np.ndarray | None:
        """Return a picture from above if the mode is rgb_array.  (height, width, 3) uint8"""
        return picture(self._course, states) if self._mode == "rgb_array" else None

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without the open viewer, as a copy opens its own."""
        return self.__dict__ | {"_viewer": None}

    def close(self) -> None:
        """Close the viewer, if there is one."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None


def picture(course: Course, states: np.ndarray) -> np.ndarray:
    """Return a picture of gates and vehicles from above.

    Args:
        course: course with the bounds that fill the picture.
        states: position, velocity and attitude of the vehicles.  (vehicles, 10)

    Returns:
        The picture  (height, width, 3) uint8.
    """
    (x_low, x_high), (y_low, y_high), (z_low, z_high) = course.bounds
    across = (WIDTH - 2 * BORDER) / (x_high - x_low)
    upwards = (HEIGHT - 2 * BORDER) / (y_high - y_low)
    scale = min(across, upwards)  # [pixels/m]

    def pixel(point: np.ndarray) -> tuple[float, float]:
        """Return column and row of a point of the world; x points to the right and y up."""
        column = WIDTH / 2 + (point[0] - (x_low + x_high) / 2) * scale
        row = HEIGHT / 2 - (point[1] - (y_low + y_high) / 2) * scale
        return float(column), float(row)

    image = Image.new("RGB", (WIDTH, HEIGHT), BACKGROUND)
    draw = ImageDraw.Draw(image)
    for gate in course.gates:
        centre = np.array(gate.position)
        half_width = outer_half_sizes(gate.opening, gate.frame_width).left
        edge = half_width * gate.rotation[:, 1]
        draw.line([pixel(centre - edge), pixel(centre + edge)], FRAME, width=3)

    positions = states[:, POSITION]
    velocities = states[:, VELOCITY]
    heights = np.clip((positions[:, 2] - z_low) / (z_high - z_low), 0, 1)
    colours = (LOW + heights[:, None] * (HIGH - LOW)).astype(int).tolist()
    for position, velocity, colour in zip(positions, velocities, colours, strict=True):
        shown = tuple(colour)
        draw.line([pixel(position), pixel(position + AHEAD * velocity)], shown)
        column, row = pixel(position)
        draw.ellipse((column - RADIUS, row - RADIUS, column + RADIUS, row + RADIUS), shown)
    return np.asarray(image)
