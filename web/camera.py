"""Where people look from: freely, behind the drone, or from above. Every client has its own camera."""

from __future__ import annotations

import numpy as np
import viser

from quadsim.course import Course
from web.scene import FOV, above, overview
from web.standing import Standing

FREE, CHASE, TOP = "free", "chase", "top"
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

    def follow(self, s: Standing) -> None:
        """Glide behind the drone, looking where it flies."""
        if self.mode != CHASE:
            return
        x, i = s.lane.x, s.i
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
