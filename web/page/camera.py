"""The camera of each visitor: free, behind the drone, from above, or the drone's own (first person
view, FPV)."""

from __future__ import annotations

from collections import defaultdict
from math import radians

import numpy as np
import viser
from viser.transforms import SO3

from quadsim.course import Course
from web.competitor import POSITION, QUATERNION, VELOCITY
from web.lap_timing import LapTiming

FREE, CHASE, TOP, FPV = MODES = ("free", "chase", "top", "FPV")
FOV, NEAR = 0.9, 0.01  # vertical [rad]; nothing nearer is drawn [m]
# of the drone's camera: wide, tilted up, as pilots have it
DRONE_FOV, DRONE_TILT = radians(100.0), radians(45.0)
# width over height: on a narrower canvas the panels are taken to be a sheet at the bottom, as on a
# phone
PHONE = 0.6
HUD, SHEET = 0.2, 0.5  # shares of the canvas's height that the head-up display and the sheet take
MARGIN = 0.04  # of the free part, on each side
# of the chasing camera: distance [m], height [m], share of the way a frame
BEHIND, ABOVE, SMOOTHING = 3.6, 1.3, 0.12
UP = np.array([0.0, 0.0, 1.0])

Pose = tuple[np.ndarray, np.ndarray]  # position and the point it looks at [m]
# left, right, bottom, top of a part of the canvas, each -1..1
Part = tuple[float, float, float, float]


class Camera:
    def __init__(self, server: viser.ViserServer):
        self._server = server
        # of visitors, by their number
        self._modes: defaultdict[int, str] = defaultdict(lambda: FREE)
        # canvas [px] and position when last placed
        self._placed: dict[int, tuple[tuple[int, int], np.ndarray]] = {}
        self._course: Course | None = None
        self._size = 1.0  # of the drone as it is drawn [m]
        self._chase = np.zeros(3), np.zeros(3)
        server.on_client_connect(self._connected)
        server.on_client_disconnect(self._disconnected)

    def show(self, course: Course, size: float) -> None:
        """Another race: another course is framed for everyone. size: of the drones [m]"""
        self._size = size
        if self._course is None or course.text != self._course.text:
            self._course = course
            set_initial_camera(self._server, course)
            for client in self._server.get_clients().values():
                self._place(client)

    def choose(self, client: viser.ClientHandle | None, mode: str | None = None) -> None:
        """For one visitor alone; None: the next mode."""
        if client is not None:
            now = self._modes[client.client_id]
            self._modes[client.client_id] = mode or MODES[(MODES.index(now) + 1) % len(MODES)]
            self._place(client)

    def follow(self, s: LapTiming) -> None:
        """Move the cameras that move with the first drone."""
        visitors = [
            (client, self._modes[number]) for number, client in self._server.get_clients().items()
        ]
        self._chase = chase(s, self._chase)
        for client, mode in visitors:
            if mode == CHASE:
                with client.atomic():
                    client.camera.position, client.camera.look_at = self._chase
            elif mode == FPV:
                (position, ahead), up = fpv(s)
                with client.atomic():
                    client.camera.up_direction = up
                    client.camera.position, client.camera.look_at = position, ahead

    def _connected(self, client: viser.ClientHandle) -> None:
        self._place(client)
        client.camera.on_update(lambda _: self._reported(client))

    def _disconnected(self, client: viser.ClientHandle) -> None:
        self._modes.pop(client.client_id, None)
        self._placed.pop(client.client_id, None)

    def _reported(self, client: viser.ClientHandle) -> None:
        """Frame the course anew where the canvas has another size and the visitor has not turned
        the view, or where the page still shows what it began with.
        """
        camera, (size, position) = (
            client.camera,
            self._placed.get(client.client_id, ((0, 0), np.zeros(3))),
        )
        as_placed = np.allclose(camera.position, position, atol=0.05)
        as_begun = np.allclose(camera.position, self._server.initial_camera.position, atol=0.05)
        resized = size != (camera.image_width, camera.image_height)
        if (as_placed and resized) or (as_begun and not as_placed):
            self._place(client)

    def _place(self, client: viser.ClientHandle) -> None:
        camera, mode = client.camera, self._modes[client.client_id]
        with client.atomic():
            camera.fov, camera.near = (DRONE_FOV, 0.8 * self._size) if mode == FPV else (FOV, NEAR)
            if mode == FPV or self._course is None:
                return
            camera.up_direction = UP
            if mode != CHASE:
                size = camera.image_width, camera.image_height
                pose = (top_view if mode == TOP else overview)(self._course, size)
                camera.position, camera.look_at = pose
                self._placed[client.client_id] = size, pose[0]


def chase(s: LapTiming, last: Pose) -> Pose:
    """Smoothly behind the drone, looking where it flies."""
    p, v = s.entry.rows(POSITION, s.i), s.entry.rows(VELOCITY, s.i)
    ahead = np.array([v[0], v[1], 0.3 * v[2]])
    if np.linalg.norm(ahead) < 0.5:
        w, z = s.entry.rows(("qw", "qz"), s.i)
        ahead = np.array([w * w - z * z, 2 * w * z, 0.0])
    behind = p - BEHIND * ahead / np.linalg.norm(ahead) + np.array([0.0, 0.0, ABOVE])
    jumped = np.linalg.norm(behind - last[0]) > 15.0  # another race, or a scrubbed replay
    share, look_share = (1.0, 1.0) if jumped else (SMOOTHING, 2.5 * SMOOTHING)
    position = last[0] + share * (behind - last[0])
    position[2] = max(position[2], 0.4)
    return position, last[1] + look_share * (p - last[1])


def fpv(s: LapTiming) -> tuple[Pose, np.ndarray]:
    """From the drone's centre along its camera, and the camera's up direction."""
    forward, _, up = SO3(s.entry.rows(QUATERNION, s.i)).as_matrix().T
    along = np.cos(DRONE_TILT) * forward + np.sin(DRONE_TILT) * up
    p = s.entry.rows(POSITION, s.i)
    return (p, p + along), np.cos(DRONE_TILT) * up - np.sin(DRONE_TILT) * forward


def set_initial_camera(server: viser.ViserServer, course: Course) -> None:
    """Of clients to come, and of recordings."""
    camera = server.initial_camera
    camera.position, camera.look_at = overview(course)
    camera.fov = FOV


def free_part(size: tuple[int, int]) -> Part:
    """Of a canvas of this width and height, what the head-up display and a phone's sheet leave
    free."""
    return -1.0, 1.0, 2 * SHEET - 1 if size[0] < PHONE * size[1] else -1.0, 1 - 2 * HUD


def overview(course: Course, size: tuple[int, int] = (900, 900)) -> Pose:
    """The whole course, seen from beside its longer side, in the free part of a canvas of this size
    [px]."""
    width, depth, _ = np.ptp(course.points(frames=False), axis=0)
    return _fit(
        course, np.array([0.12, -0.76, 0.64] if width >= depth else [0.76, 0.12, 0.64]), size
    )


def top_view(course: Course, size: tuple[int, int] = (900, 900)) -> Pose:
    """The same from above; not quite vertical, as a camera cannot look along its own up
    direction."""
    return _fit(course, np.array([0.0, -0.01, 1.0]), size)


def _fit(course: Course, direction: np.ndarray, size: tuple[int, int]) -> Pose:
    """From this direction, as near as every gate and the start still fit into the free part.

    With coordinates x right, y up and z back, a point is in view where left (cz - z) <= x - cx <=
    right (cz - z) for a camera at c: so x + right z <= cx + right cz and x + left z >= cx + left
    cz, and the same of y.
    """
    back = direction / np.linalg.norm(direction)
    right = np.cross(UP, back) / np.linalg.norm(np.cross(UP, back))
    axes = np.array([right, np.cross(back, right), back])
    p = course.points() @ axes.T
    half = np.tan(FOV / 2) * np.array([size[0] / size[1], 1.0])
    left, right_edge, bottom, top = free_part(size)
    bounds = []
    for k, (low, high) in enumerate(((left, right_edge), (bottom, top))):
        margin = MARGIN * (high - low)
        low, high = half[k] * (low + margin), half[k] * (high - margin)
        bounds.append(
            (low, high, (p[:, k] + low * p[:, 2]).min(), (p[:, k] + high * p[:, 2]).max())
        )
    z = max((most - least) / (high - low) for low, high, least, most in bounds)
    x, y = ((most - high * z + least - low * z) / 2 for low, high, least, most in bounds)
    far = z - float(p[:, 2].mean())  # to the middle of the course
    return np.array([x, y, z]) @ axes, np.array([x, y, z - far]) @ axes
