"""The distance from which a whole gate is in the picture of a camera.

The vehicle flies along the gate's passage towards the centre of the opening, with its nose along
the passage and pitched down. A camera that is tilted up looks over a gate at the vehicle's own
height, and a near gate is larger than the picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from typing import NamedTuple

import numpy as np

from quadsim.course import Gate
from quadsim.rotation import from_euler
from quadsim.sensing.camera import Camera

# Distances that are tried [m]
FARTHEST = 40.0
STEP = 0.05
PITCHES = (0.0, 10.0, 20.0, 30.0)  # [deg], the nose down


class WholeFrom(NamedTuple):
    """The least distances from a gate's centre at which the whole gate is in the picture."""

    pitch: float  # of the vehicle, the nose down [deg]
    # of the four corners of the opening [m]; None: at no distance up to FARTHEST
    opening: float | None
    # of the four outer corners of the frame [m]
    frame: float | None


def whole_from(gate: Gate, camera: Camera, pitches: Sequence[float] = PITCHES) -> list[WholeFrom]:
    """Return the distances from which a whole gate is in the picture, for each pitch [deg].

    Examples:
        >>> from quadsim import load_course
        >>> from quadsim.sensing.camera import load_camera
        >>> gate = load_course("aigp_physical").gates[0]
        >>> level, *_ = whole_from(gate, load_camera("aigp"))
        >>> level.opening, level.frame  # [m]
        (4.7, 8.3)
    """
    borders = (0.0, gate.frame_width)
    return [
        WholeFrom(pitch, *(_least_distance(gate, camera, pitch, border) for border in borders))
        for pitch in pitches
    ]


def gates_alike(gates: Sequence[Gate]) -> list[list[int]]:
    """Return the numbers of the gates, from 1, in groups of the same size and pitch."""
    groups: dict[tuple[float, ...], list[int]] = {}
    for number, gate in enumerate(gates, start=1):
        groups.setdefault((*gate.opening, gate.frame_width, gate.pitch), []).append(number)
    return list(groups.values())


def _least_distance(gate: Gate, camera: Camera, pitch: float, border: float) -> float | None:
    """Return the distance [m] beyond which all corners are in the picture, None if there is none.

    Args:
        gate: the gate.
        camera: the camera.
        pitch: pitch of the vehicle, the nose down [deg].
        border: distance of the corners from the opening [m].
    """
    corners = gate.corners(border)
    passage = np.array(gate.axes[0])
    # The vehicle keeps its nose along a passage that leads up or down.
    attitude = from_euler(gate.yaw, gate.pitch + radians(pitch), 0.0)
    least = None
    for k in range(round(FARTHEST / STEP), 0, -1):
        distance = round(k * STEP, 2)
        x, y, z = (np.array(gate.position) - distance * passage).tolist()
        pixels, depth = camera.project(corners, (x, y, z), attitude)
        if not (camera.in_picture(pixels) & (depth > 0.0)).all():
            break
        least = distance
    return least
