"""The camera: free, behind the drone, or from above. Every client has its own."""

from __future__ import annotations

import numpy as np
import viser

from quadsim.course import Course
from web.competitor import POSITION, VELOCITY
from web.lap_timing import LapTiming

FREE, CHASE, TOP = MODES = ("free", "chase", "top")
FOV = 0.9  # vertical [rad]
FREE_SHARE, ASPECT = 0.97, 0.92  # of the view that the course may fill; width over height between the panels
BEHIND, ABOVE, SMOOTHING = 3.6, 1.3, 0.12  # of the chasing camera: distance [m], height [m], share of the way a frame

Pose = tuple[np.ndarray, np.ndarray]  # position and the point it looks at [m]


class Camera:
    def __init__(self, server: viser.ViserServer):
        self._server, self._mode = server, FREE
        self._course: Course | None = None
        self._position = self._look_at = np.zeros(3)  # of the chasing camera
        server.on_client_connect(self._place)

    def show(self, mode: str, course: Course | None = None) -> None:
        """In this mode for every client, now and on connecting; course: another one from now on."""
        self._mode = mode
        if course:
            self._course = course
            set_initial_camera(self._server, course)
        for client in self._server.get_clients().values():
            self._place(client)

    def follow(self, s: LapTiming) -> None:
        """Move smoothly behind the drone, looking where it flies."""
        if self._mode != CHASE:
            return
        p, v = s.entry.rows(POSITION, s.i), s.entry.rows(VELOCITY, s.i)
        ahead = np.array([v[0], v[1], 0.3 * v[2]])
        if np.linalg.norm(ahead) < 0.5:
            w, z = s.entry.rows(("qw", "qz"), s.i)
            ahead = np.array([w * w - z * z, 2 * w * z, 0.0])
        behind = p - BEHIND * ahead / np.linalg.norm(ahead) + np.array([0.0, 0.0, ABOVE])
        jumped = np.linalg.norm(behind - self._position) > 15.0  # another race, or a scrubbed replay
        share, look_share = (1.0, 1.0) if jumped else (SMOOTHING, 2.5 * SMOOTHING)
        self._position = self._position + share * (behind - self._position)
        self._position[2] = max(self._position[2], 0.4)
        self._look_at = self._look_at + look_share * (p - self._look_at)
        for client in self._server.get_clients().values():
            with client.atomic():
                client.camera.position, client.camera.look_at = self._position, self._look_at

    def _place(self, client: viser.ClientHandle) -> None:
        if self._course is None or self._mode == CHASE:
            return
        with client.atomic():
            client.camera.fov = FOV
            client.camera.up_direction = (0.0, 0.0, 1.0)
            view = top_view if self._mode == TOP else overview
            client.camera.position, client.camera.look_at = view(self._course)


def set_initial_camera(server: viser.ViserServer, course: Course) -> None:
    """Of clients to come, and of recordings."""
    camera = server.initial_camera
    camera.position, camera.look_at = overview(course)
    camera.fov = FOV


def overview(course: Course) -> Pose:
    """The whole course, seen from beside its longer side."""
    width, depth, _ = np.ptp(course.points(frames=False), axis=0)
    return _fit(course, np.array([0.12, -0.76, 0.64] if width >= depth else [0.76, 0.12, 0.64]))


def top_view(course: Course) -> Pose:
    """The same from above; not quite vertical, as a camera cannot look along its own up direction."""
    return _fit(course, np.array([0.0, -0.01, 1.0]))


def _fit(course: Course, direction: np.ndarray) -> Pose:
    """From this direction, as near as every gate and the start still fit into the view."""
    points = course.points()
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    back = direction / np.linalg.norm(direction)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    up, p = np.cross(back, right), points - centre
    half = np.tan(FOV / 2) * FREE_SHARE
    # a point in view: |p . right| <= half ASPECT depth, |p . up| <= half depth, depth = distance - p . back
    wide, high = abs(p @ right) / (half * ASPECT), abs(p @ up) / half
    return centre + back * float((np.maximum(wide, high) + p @ back).max()), centre
