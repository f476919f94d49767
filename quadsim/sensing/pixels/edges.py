"""The edges of frames against their background, as a camera sees them, and points on them.

A frame is a box with an opening, and has four inner and four outer sides. Each side ends in two
edges. One of them separates the frame from the background, which the camera sees as a change of
colour: the farther edge of a side that faces the camera, and the nearer edge of a side that is
turned away. The other edge is a mere change of shade, or is not seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from quadsim.course import Gate
from quadsim.course.opening import half_sizes, outer_half_sizes
from quadsim.sensing.camera import NEAREST, Camera, CameraPose
from quadsim.sensing.visibility import BEFORE

# largest number of points on an edge, and their distance in the picture [px]
POINTS = 20
SPACING = 4.0
# number of points of short edges, and their least distance [px]
FEW = 6
NARROWEST = 1.5
# share of an edge at either end that has no points, as two edges meet there
ENDS = 0.06
# [m] by which a line of sight must pass a frame
BESIDE = 0.03
# [m] by which a line of sight must enter the frame of a point's own gate to be stopped
WITHIN = 0.01
# Sides of a rectangle: the row of the axis (0: left, 1: up), and the direction on it
SIDES = ((0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0))
# Edges of a gate: four inner ones, then four outer ones, in the order of SIDES
EDGES = 8


class Points(NamedTuple):
    """Points on edges, which are visible according to the map."""

    # gate and edge of each point  (n,)
    gate: np.ndarray
    edge: np.ndarray
    # in the world [m]  (n, 3)
    position: np.ndarray
    # in the picture [px]  (n, 2)
    pixel: np.ndarray
    # unit normal of the edge in the picture, from the background to the frame  (n, 2)
    normal: np.ndarray
    # from the middle of the edge, along the edge [px]  (n,)
    along: np.ndarray


class Frames:
    """The frames of a map as arrays."""

    def __init__(self, gates: Sequence[Gate]):
        """Compute the arrays from the distinct gates of the map."""
        self.centre = np.array([gate.position for gate in gates])  # (G, 3)
        self.rotation = np.array([gate.rotation for gate in gates])  # (G, 3, 3)
        self.inner = np.array([half_sizes(gate.opening) for gate in gates])  # (G, 2)
        self.outer = np.array([outer_half_sizes(g.opening, g.frame_width) for g in gates])
        self.depth = np.array([gate.frame_depth for gate in gates])  # [m]  (G,)
        self.corners = np.array([gate.corners() for gate in gates])  # (G, 4, 3)

    def moved(self, offsets: np.ndarray) -> Frames:
        """Return the frames displaced by `offsets`.

        Args:
            offsets: displacements from the map [m]  (G, 3).
        """
        other = Frames.__new__(Frames)
        other.__dict__.update(self.__dict__)
        other.centre = self.centre + offsets
        other.corners = self.corners + offsets[:, None]
        return other

    def local(self, points: np.ndarray) -> np.ndarray:
        """Return points of the world in the frame of each gate [m].

        Args:
            points: points for all gates  (n, 3), or for each gate  (G, n, 3) [m].

        Returns:
            The points  (G, n, 3).
        """
        return (points - self.centre[:, None]) @ self.rotation

    def world(self, points: np.ndarray) -> np.ndarray:
        """Return points (G, ..., 3) of each gate's frame in the world [m]."""
        shape = points.shape
        flat = points.reshape(shape[0], -1, 3)
        return (flat @ self.rotation.transpose(0, 2, 1) + self.centre[:, None]).reshape(shape)

    def edges(self, eye: np.ndarray) -> np.ndarray:
        """Return the ends [m] of the edges against the background, seen from a point.

        Args:
            eye: position of the camera in the world [m]  (3,).

        Returns:
            The two ends of each edge in the world  (G, EDGES, 2, 3).
        """
        local = self.local(eye[None])[:, 0]  # (G, 3)
        near = np.sign(local[:, 0]) * self.depth / 2
        ends = np.empty((len(self.centre), EDGES, 2, 3))
        for ring, half in enumerate((self.inner, self.outer)):
            for k, (axis, sign) in enumerate(SIDES):
                out = sign * local[:, 1 + axis] - half[:, axis]
                # An inner side faces the eye from within, an outer side from beyond.
                faces = out < 0.0 if ring == 0 else out > 0.0
                edge = ends[:, 4 * ring + k]
                edge[:, :, 0] = np.where(faces, -near, near)[:, None]
                edge[:, :, 1 + axis] = (sign * half[:, axis])[:, None]
                edge[:, 0, 2 - axis] = -half[:, 1 - axis]
                edge[:, 1, 2 - axis] = half[:, 1 - axis]
        return self.world(ends)

    def hide(
        self, points: np.ndarray, own: np.ndarray, eye: np.ndarray, merged: bool = False
    ) -> np.ndarray:
        """Return which points are hidden from the camera by a frame.  (n,) bool

        Args:
            points: points in the world [m]  (n, 3).
            own: index of each point's gate, of whose frame only the nearer plane hides it  (n,).
            eye: position of the camera in the world [m]  (3,).
            merged: whether points in front of another frame count, too, because an edge in front
                of the same colour is not seen.
        """
        here = self.local(eye[None])  # (G, 1, 3)
        there = self.local(points)  # (G, n, 3)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = here[..., 0] / (here[..., 0] - there[..., 0])  # (G, n)
            crossing = here[..., 1:] + share[..., None] * (there[..., 1:] - here[..., 1:])
        between = (share > 0.0) if merged else (share > 0.0) & (share < 1.0)
        beyond = abs(crossing)
        in_outer = (beyond < self.outer[:, None] + BESIDE).all(axis=-1)
        in_opening = (beyond < self.inner[:, None] - BESIDE).all(axis=-1)
        hidden = between & in_outer & ~in_opening
        column = np.arange(len(points))
        hidden[own, column] = self._hide_own(here[own, 0], there[own, column], own)
        return np.any(hidden, axis=0)

    def _hide_own(self, here: np.ndarray, there: np.ndarray, own: np.ndarray) -> np.ndarray:
        """Return which points are behind the nearer plane of their own frame.  (n,) bool

        Args:
            here: position of the camera in the frame of each point's gate [m]  (n, 3).
            there: the points in the frames of their gates [m]  (n, 3).
            own: index of each point's gate  (n,).
        """
        near = np.sign(here[:, 0]) * self.depth[own] / 2
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (here[:, 0] - near) / (here[:, 0] - there[:, 0])
        beyond = abs(here[:, 1:] + share[:, None] * (there[:, 1:] - here[:, 1:]))
        in_frame = (beyond < self.outer[own] - WITHIN).all(axis=-1)
        in_opening = (beyond < self.inner[own] + WITHIN).all(axis=-1)
        before = (share > 0.0) & (share < BEFORE)
        return before & in_frame & ~in_opening


def visible_points(
    frames: Frames, view: CameraPose, camera: Camera, longest: float, border: float
) -> Points:
    """Return points on the visible parts of all edges that the camera sees.

    Args:
        frames: the frames.
        view: pose of the camera.
        camera: the camera.
        longest: distance beyond which gates are left out [m].
        border: least distance of a point from the border of the picture [px].
    """
    ends = frames.edges(view.eye)
    local = view.local(ends.reshape(-1, 3)).reshape(-1, 2, 3)  # (G EDGES, 2, 3)
    gate = np.repeat(np.arange(len(ends)), EDGES)
    edge = np.tile(np.arange(EDGES), len(ends))
    keep = seen_well(frames, view, longest)[gate] & (local[:, :, 2].max(axis=1) > NEAREST)
    gate = gate[keep]
    edge = edge[keep]
    local = local[keep]

    # The part of each edge in front of the camera, and of that the part in the picture.
    first, last = local[:, 0], local[:, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        cut = (NEAREST - first[:, 2]) / (last[:, 2] - first[:, 2])
        meets = first + cut[:, None] * (last - first)
    a = np.where((first[:, 2] < NEAREST)[:, None], meets, first)
    b = np.where((last[:, 2] < NEAREST)[:, None], meets, last)
    pixel_a, depth_a = camera.to_pixels(a)
    pixel_b, depth_b = camera.to_pixels(b)
    run = pixel_b - pixel_a
    low, high = _inside(pixel_a, run, camera, border)
    length = np.linalg.norm(run, axis=1)
    low = np.maximum(low, ENDS)
    high = np.minimum(high, 1.0 - ENDS)
    visible = (high - low) * length
    count = np.maximum(visible / SPACING, np.minimum(visible / NARROWEST, FEW))
    count = np.clip(count, 0, POINTS).astype(int)

    # Equally spaced points in the picture; 1 / depth is linear along a line in the picture.
    k = np.arange(POINTS)
    chosen = k < count[:, None]
    share = low[:, None] + (high - low)[:, None] * (k + 0.5) / np.maximum(count, 1)[:, None]
    pixel = pixel_a[:, None] + share[..., None] * run[:, None]
    nearness = 1.0 / depth_a[:, None] + share * (1.0 / depth_b - 1.0 / depth_a)[:, None]
    ray = np.concatenate(
        [
            (pixel - (camera.width / 2, camera.height / 2)) / (camera.fx, camera.fy),
            np.ones((*share.shape, 1)),
        ],
        axis=-1,
    )
    position = view.eye + (ray / nearness[..., None]) @ view.axes.T
    unit = run / np.maximum(length, 1e-9)[:, None]
    normal = _towards_frame(frames, view, gate, edge, a, b, unit, camera)
    rows, columns = np.nonzero(chosen)
    points = Points(
        gate=gate[rows],
        edge=edge[rows],
        position=position[rows, columns],
        pixel=pixel[rows, columns],
        normal=normal[rows],
        along=((share - 0.5) * length[:, None])[rows, columns],
    )
    return taken(points, ~frames.hide(points.position, points.gate, view.eye, merged=True))


def taken(points: Points, mask: np.ndarray) -> Points:
    """Return the points that a mask selects."""
    return Points(*(column[mask] for column in points))


def seen_well(frames: Frames, view: CameraPose, longest: float) -> np.ndarray:
    """Return which gates are near enough and not seen edge-on.  (G,) bool"""
    away = np.linalg.norm(frames.centre - view.eye, axis=1)
    ahead = abs(frames.local(view.eye[None])[:, 0, 0])
    return (away < longest) & (ahead > frames.depth)


def _inside(
    start: np.ndarray, run: np.ndarray, camera: Camera, border: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the fractions of segments between which they lie in the picture.  (n,), (n,)"""
    low = np.zeros(len(start))
    high = np.ones(len(start))
    for axis, size in enumerate((camera.width, camera.height)):
        with np.errstate(divide="ignore", invalid="ignore"):
            one = (border - start[:, axis]) / run[:, axis]
            other = (size - border - start[:, axis]) / run[:, axis]
        inside = (start[:, axis] >= border) & (start[:, axis] <= size - border)
        flat = abs(run[:, axis]) < 1e-9
        low = np.maximum(low, np.where(flat, np.where(inside, 0.0, 2.0), np.minimum(one, other)))
        high = np.minimum(high, np.where(flat, 1.0, np.maximum(one, other)))
    return low, high


def _towards_frame(
    frames: Frames,
    view: CameraPose,
    gate: np.ndarray,
    edge: np.ndarray,
    a: np.ndarray,
    b: np.ndarray,
    unit: np.ndarray,
    camera: Camera,
) -> np.ndarray:
    """Return the normals of edges in the picture that point to their frames.  (n, 2)"""
    # A point of the gate's plane beside the middle of the edge, away from the opening for an inner
    # edge and towards it for an outer one.
    middle = 0.5 * (a + b)
    axis = np.array([axis for axis, _ in SIDES])[edge % 4]
    sign = np.array([sign for _, sign in SIDES])[edge % 4] * np.where(edge < 4, 1.0, -1.0)
    towards = frames.rotation[gate, :, 1 + axis] * sign[:, None]
    beside, _ = camera.to_pixels(middle + 0.02 * towards @ view.axes)
    here, _ = camera.to_pixels(middle)
    normal = np.column_stack([-unit[:, 1], unit[:, 0]])
    turned = ((beside - here) * normal).sum(axis=1) < 0.0
    return np.where(turned[:, None], -normal, normal)
