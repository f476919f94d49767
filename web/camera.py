"""Where people look from: freely, behind the drone, or from above. Every client has its own camera."""

from __future__ import annotations

import numpy as np
import viser

from quadsim.course import Course
from web.lap_timing import LapTiming
from web.scene import extent

FREE, CHASE, TOP = "free", "chase", "top"
FOV = 0.9  # vertical [rad]
FREE_SHARE, ASPECT = 0.97, 0.92  # of the picture that the course may fill; width over height between the panels
BEHIND, OVER, SMOOTH = 3.6, 1.3, 0.12  # of the chasing camera: distance [m], height [m], share of the way a picture


class Camera:
    def __init__(self, server: viser.ViserServer):
        self._server, self.mode = server, FREE
        self._course: Course | None = None
        self._at = self._look = np.zeros(3)
        server.on_client_connect(self._welcome)

    def frame(self, course: Course) -> None:
        """Show the whole course to everybody, now and on connecting."""
        self._course = course
        initial = self._server.initial_camera
        initial.position, initial.look_at = overview(course)
        initial.fov = FOV
        for client in self._server.get_clients().values():
            self._place(client)

    def set(self, mode: str) -> None:
        self.mode = mode
        for client in self._server.get_clients().values():
            self._place(client)

    def next(self) -> str:
        modes = (FREE, CHASE, TOP)
        self.set(modes[(modes.index(self.mode) + 1) % 3])
        return self.mode

    def follow(self, s: LapTiming) -> None:
        """Glide behind the drone, looking where it flies."""
        if self.mode != CHASE:
            return
        x, i = s.competitor.x, s.i
        p, v = (np.array([x[k][i] for k in names]) for names in (("px", "py", "pz"), ("vx", "vy", "vz")))
        flat = np.array([v[0], v[1], 0.3 * v[2]])
        if np.linalg.norm(flat) < 0.5:
            w, z = x["qw"][i], x["qz"][i]
            flat = np.array([w * w - z * z, 2 * w * z, 0.0])
        behind = p - BEHIND * flat / np.linalg.norm(flat) + np.array([0.0, 0.0, OVER])
        far = np.linalg.norm(behind - self._at) > 15.0  # another race, or a jump
        share = 1.0 if far else SMOOTH
        self._at = self._at + share * (behind - self._at)
        self._at[2] = max(self._at[2], 0.4)
        self._look = self._look + (1.0 if far else 2.5 * SMOOTH) * (p - self._look)
        for client in self._server.get_clients().values():
            with client.atomic():
                client.camera.position, client.camera.look_at = self._at, self._look

    def _welcome(self, client: viser.ClientHandle) -> None:
        self._place(client)

    def _place(self, client: viser.ClientHandle) -> None:
        if self._course is None or self.mode == CHASE:
            return
        at, look = above(self._course) if self.mode == TOP else overview(self._course)
        with client.atomic():
            client.camera.fov = FOV
            client.camera.up_direction = (0.0, 0.0, 1.0)
            client.camera.position, client.camera.look_at = at, look


def overview(course: Course) -> tuple[np.ndarray, np.ndarray]:
    """Where to stand and what to look at so that the whole course is in view, seen along its shorter side [m]."""
    (x0, x1), (y0, y1), _ = extent(course)
    return _fit(course, np.array([0.12, -0.76, 0.64]) if x1 - x0 >= y1 - y0 else np.array([0.76, 0.12, 0.64]))


def above(course: Course) -> tuple[np.ndarray, np.ndarray]:
    """The same from straight above; a hair aside, as a camera cannot look along its own up direction."""
    return _fit(course, np.array([0.0, -0.01, 1.0]))


def _fit(course: Course, aside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """As near as every gate and the start still fit into the picture."""
    points = np.vstack([[course.start.position], *(g.corners(g.frame_width) for g in course.gates)])
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    back = aside / np.linalg.norm(aside)
    right = np.cross([0.0, 0.0, 1.0], back) / np.linalg.norm(np.cross([0.0, 0.0, 1.0], back))
    up, p = np.cross(back, right), points - centre
    half = np.tan(FOV / 2) * FREE_SHARE
    # a point in the picture: |p . right| <= half ASPECT depth, |p . up| <= half depth, depth = distance - p . back
    wide, high = abs(p @ right) / (half * ASPECT), abs(p @ up) / half
    return centre + back * float((np.maximum(wide, high) + p @ back).max()), centre
