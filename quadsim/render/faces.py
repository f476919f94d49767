"""The faces of a scene's objects: gates, obstacles, ground, banners and vehicles."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import pi
from typing import NamedTuple

import numpy as np

from quadsim.course import Gate
from quadsim.course.obstacles import ROUND, Box, Cylinder, Obstacle
from quadsim.course.opening import half_sizes, outer_half_sizes
from quadsim.render.raster import ELLIPSE, RECTANGLE
from quadsim.rotation import Vec3

# half the ground's edge [m]
GROUND = 600.0
# edge of one repetition of a texture on the ground and on anything else [m]
GROUND_TILE = 8.0
TILE = 1.0
X = np.array([1.0, 0.0, 0.0])
Y = np.array([0.0, 1.0, 0.0])
Z = np.array([0.0, 0.0, 1.0])


class Face(NamedTuple):
    """A flat face, as quadsim.render.raster draws it."""

    # centre, and half axes, of which the cross product points out of the body [m]  (3,)
    origin: np.ndarray
    a: np.ndarray
    b: np.ndarray
    kind: int = RECTANGLE
    # half sizes of the hole in shares of a and b; 0: no hole
    hole: tuple[float, float] = (0.0, 0.0)
    two_sided: bool = False
    # edge of one repetition of its texture [m]
    tile: float = TILE


class Banner(NamedTuple):
    """An upright flat sheet that is seen from both sides."""

    # [m]
    centre: Vec3
    # direction of its normal [rad]
    yaw: float
    # width and height [m]
    size: tuple[float, float]


class Part(NamedTuple):
    """Boxes or upright cylinders of one colour. Lengths are in radii of the vehicle."""

    # 0 to 1
    colour: Vec3
    # half the extents; a cylinder has the first one as its radius
    half: Vec3
    # centres in the body frame
    places: tuple[Vec3, ...]
    # directions of the boxes' x axes [rad]
    yaws: tuple[float, ...]
    round: bool = False


# A cross-shaped quadrotor with front rotors of a different colour.
PARTS = (
    Part((0.1, 0.1, 0.12), (1.1, 0.09, 0.06), ((0, 0, 0), (0, 0, 0)), (pi / 4, -pi / 4)),
    Part((0.85, 0.1, 0.1), (0.43, 0.21, 0.18), ((0, 0, 0.07),), (0.0,)),
    Part(
        (0.95, 0.85, 0.2),
        (0.53, 0.53, 0.03),
        ((0.78, 0.78, 0.21), (0.78, -0.78, 0.21)),
        (0.0, 0.0),
        round=True,
    ),
    Part(
        (0.2, 0.2, 0.25),
        (0.53, 0.53, 0.03),
        ((-0.78, 0.78, 0.21), (-0.78, -0.78, 0.21)),
        (0.0, 0.0),
        round=True,
    ),
)


def ground_faces() -> list[Face]:
    """Return the ground as a square at height 0."""
    return [Face(np.zeros(3), GROUND * X, GROUND * Y, tile=GROUND_TILE)]


def gate_faces(gate: Gate) -> list[Face]:
    """Return the front, the back, and the inner and outer sides of a gate's frame."""
    passage, left, up = gate.rotation.T
    centre = np.array(gate.position)
    inner = half_sizes(gate.opening)
    outer = outer_half_sizes(gate.opening, gate.frame_width)
    deep = gate.frame_depth / 2 * passage
    hole = (inner.left / outer.left, inner.up / outer.up)
    across = outer.left * left
    high = outer.up * up
    faces = [
        Face(centre + deep, across, high, hole=hole),
        Face(centre - deep, -across, high, hole=hole),
    ]
    # Outer sides face away from the centre, inner sides towards it.
    for half, towards in ((outer, 1.0), (inner, -1.0)):
        side = half.left * left
        top = half.up * up
        for sign in (1.0, -1.0):
            faces.append(Face(centre + sign * side, towards * sign * top, deep))
            faces.append(Face(centre + sign * top, towards * sign * deep, side))
    return faces


def box_faces(centre: np.ndarray, axes: np.ndarray, half: Sequence[float]) -> list[Face]:
    """Return the six faces of a box.

    Args:
        centre: centre of the box in the world [m]  (3,).
        axes: rotation from box to world axes  (3, 3).
        half: half of the box's size along its axes [m]  (3,).
    """
    x, y, z = axes.T * np.asarray(half)[:, None]
    faces = []
    for one, second, third in ((x, y, z), (y, z, x), (z, x, y)):
        faces.append(Face(centre + one, second, third))
        faces.append(Face(centre - one, third, second))
    return faces


def cylinder_faces(
    centre: np.ndarray, axes: np.ndarray, radius: float, half: float, sides: int = ROUND
) -> list[Face]:
    """Return the sides and both ends of a cylinder along its z axis.

    The ends are exact circles. The sides are flat, and touch the circle in their middle.

    Args:
        centre: centre of the cylinder in the world [m]  (3,).
        axes: rotation from cylinder to world axes  (3, 3).
        radius: radius of the cylinder [m].
        half: half of the cylinder's length [m].
        sides: number of the flat sides.
    """
    x, y, z = axes.T
    faces = [
        Face(centre + half * z, radius * x, radius * y, kind=ELLIPSE),
        Face(centre - half * z, radius * y, radius * x, kind=ELLIPSE),
    ]
    wide = radius * np.tan(pi / sides)
    for k in range(sides):
        angle = 2.0 * pi * k / sides
        out = np.cos(angle) * x + np.sin(angle) * y
        along = np.cos(angle) * y - np.sin(angle) * x
        faces.append(Face(centre + radius * out, wide * along, half * z))
    return faces


def obstacle_faces(obstacle: Obstacle) -> list[Face]:
    """Return the faces of a box or of an upright cylinder."""
    centre = np.array(obstacle.centre)
    match obstacle:
        case Box():
            return box_faces(centre, np.array(obstacle.axes).T, obstacle.half)
        case Cylinder():
            return cylinder_faces(centre, np.eye(3), obstacle.radius, obstacle.height / 2)


def banner_faces(banner: Banner) -> list[Face]:
    """Return the one face of a banner."""
    width, height = banner.size
    across = np.array([-np.sin(banner.yaw), np.cos(banner.yaw), 0.0])
    return [
        Face(np.array(banner.centre), width / 2 * across, height / 2 * Z, two_sided=True),
    ]


def vehicle_faces(radius: float) -> Iterable[tuple[Vec3, Face]]:
    """Yield the colour and faces of a vehicle of this radius [m], in its body frame."""
    for part in PARTS:
        for place, yaw in zip(part.places, part.yaws, strict=True):
            centre = radius * np.array(place)
            x, y, z = (radius * half for half in part.half)
            c = np.cos(yaw)
            s = np.sin(yaw)
            axes = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            if part.round:
                found = cylinder_faces(centre, axes, x, z, sides=12)
            else:
                found = box_faces(centre, axes, (x, y, z))
            for face in found:
                yield part.colour, face
