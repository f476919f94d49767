"""Functions that several scripts of docs/ share.

They set the style of figures, time control steps, and find the corners of gates in pictures.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quadsim import Spec
from quadsim.config.build import planner_of, with_threads
from quadsim.course import Course, Gate
from quadsim.figures.style import STYLE
from quadsim.physics.plant_state import start_state
from quadsim.render.poses import Pose
from quadsim.rotation import turned
from quadsim.sensing.camera import Camera
from quadsim.sensing.nominal import Nominal
from quadsim.sensing.pixel_camera import TimedPose
from quadsim.sensing.state import FilterState
from quadsim.sensing.visibility import hidden_corners

DOCS = Path(__file__).parent
# The folder of a script, docs, is on its path, and not the package docs.
sys.path.insert(0, str(DOCS.parent))

# A gate counts if at least CORNERS of its corners are in view and it is nearer than DISTANCE [m].
# It is found if two of its corners are found with an error below WITHIN [px].
CORNERS = 3
DISTANCE = 15.0
WITHIN = 6.0
# standard deviations of an estimate [m, rad], and of velocity [m/s] and body rates [rad/s]
POSITION = 0.05
TURN = 0.01
SPEED = 4.0
RATES = 1.5


def use_style() -> None:
    """Draw the following figures in the style of the pages."""
    plt.rcParams.update(dict(STYLE))
    plt.rcParams.update({"figure.dpi": 130, "figure.constrained_layout.use": True})


def save(figure: Figure, name: str, dpi: int | None = None) -> None:
    """Save a figure under a name in docs/."""
    figure.savefig(DOCS / name, dpi=dpi or "figure")


def control_steps(spec: Spec, steps: int, clock: Callable[[], float]) -> np.ndarray:
    """Return the times of control steps from the start of a flight, without compiling.

    Args:
        spec: the flight, with its number of threads.
        steps: control steps to time.
        clock: a clock [s], such as time.process_time.

    Returns:
        Their times [ms].  (steps,)
    """
    planner = planner_of(with_threads(spec))
    x = np.array(start_state(spec.course.start, spec.vehicle.radius))
    planner.control(x)  # compiles, and makes the first plan
    taken = np.empty(steps)
    for i in range(steps):
        began = clock()
        planner.control(x)
        taken[i] = 1e3 * (clock() - began)
    return taken


def moving(pose: Pose, velocity: np.ndarray, rates: np.ndarray) -> list[TimedPose]:
    """Return poses of a vehicle that moves through a pose."""
    moments = []
    for t in np.arange(-0.02, 0.0201, 0.0025).tolist():
        p = (np.array(pose.p) + t * velocity).tolist()
        moments.append(TimedPose(t, (*p, *turned(pose.q, (t * rates).tolist()))))
    return moments


def estimated(pose: Pose, velocity: np.ndarray, rng: np.random.Generator) -> FilterState:
    """Return an estimate of a pose that knows its uncertainty."""
    p = np.array(pose.p) + POSITION * rng.standard_normal(3)
    q = turned(pose.q, (TURN * rng.standard_normal(3)).tolist())
    variances = np.repeat([POSITION**2, 0.01, TURN**2, 0.01, 0.01], 3)
    nominal = Nominal(0.0, tuple(p.tolist()), tuple(velocity.tolist()), q)
    return FilterState(nominal, np.zeros(0), np.zeros((0, 3)), np.diag(variances))


class Corners(NamedTuple):
    """A camera sees the corners of gates at these places of its picture."""

    # [px]  (gates, 4, 2)
    pixels: np.ndarray
    # which of them are inside the picture, and which another frame or an obstacle hides  (gates, 4)
    inside: np.ndarray
    hidden: np.ndarray

    @property
    def in_view(self) -> np.ndarray:
        """Whether each corner is inside the picture and not hidden.  (gates, 4)"""
        return self.inside & ~self.hidden


def corners_of(camera: Camera, gates: Sequence[Gate], course: Course, pose: Pose) -> Corners:
    """Return where a camera at a pose sees the corners of gates.

    Args:
        camera: the camera.
        gates: the frames of the course.
        course: its obstacles may hide corners.
        pose: the pose of the vehicle.
    """
    pixels, depth = camera.gate_corners(gates, pose.p, pose.q)
    inside = camera.in_picture(pixels.reshape(-1, 2)).reshape(-1, 4) & (depth > 0.1)
    eye, _ = camera.pose(pose.p, pose.q)
    return Corners(pixels, inside, hidden_corners(gates, eye, course.obstacles))


def frame_picture(panel: Axes, camera: Camera) -> None:
    """Let a panel show the picture of a camera, and no more."""
    panel.set_xlim(0, camera.width)
    panel.set_ylim(camera.height, 0)
    panel.set_axis_off()
