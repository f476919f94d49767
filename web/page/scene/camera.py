"""The camera of each visitor: free, behind the drone, from above, or the drone's own (FPV)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from math import radians
from typing import Literal, NamedTuple, get_args

import numpy as np
import viser
from viser.transforms import SO3

from quadsim.course import Course
from quadsim.racing.hand import HAND
from quadsim.web.race.competitor import POSITION, QUATERNION, VELOCITY
from quadsim.web.race.lap_timing import LapTiming, order

Mode = Literal["free", "chase", "top", "FPV"]
MODES: tuple[Mode, ...] = get_args(Mode)
FREE, CHASE, TOP, FPV = MODES
FOV = 0.9  # vertical [rad]
NEAR = 0.01  # nothing nearer is drawn [m]
CHASE_NEAR = 1.5  # the same for the chasing camera, which comes into the frames of gates [m]
LEADER = "the leader"
# The drone's camera is wide and tilted up, as on racing drones.
DRONE_FOV = radians(100.0)
DRONE_TILT = radians(45.0)
# Manual flights are slower than planned ones, and closer to level.
HAND_TILT = radians(20.0)
MARGIN = 0.05  # free margin on each side, as a share of the canvas
# The chasing camera: distance behind [m], height above [m], share of the way that it moves a frame,
# distance from which it jumps instead [m], lowest height [m], speed below which it follows the nose
# [m/s].
BEHIND = 3.6
ABOVE = 1.3
# The chasing camera is aimed half-way between the drone and the next gate, at most this angle off
# the drone, so that the drone stays in the picture [rad].
ASIDE = radians(14.0)
SMOOTHING = 0.2
LOOK_SMOOTHING = 2.5 * SMOOTHING
JUMP = 15.0
LOWEST = 0.4
SLOW = 0.5
UP = np.array([0.0, 0.0, 1.0])
SAME_PLACE = 0.05  # [m]

Size = tuple[int, int]  # width and height of a canvas [px]
SQUARE: Size = (900, 900)


class CameraPose(NamedTuple):
    """The position of a camera [m] and the point at which it is aimed [m]."""

    position: np.ndarray
    look_at: np.ndarray


FAR_AWAY = CameraPose(np.full(3, 1e6), np.zeros(3))


class Chased(NamedTuple):
    """The last pose behind a drone."""

    name: str
    pose: CameraPose


class Placed(NamedTuple):
    """The canvas and the position of the last placement of a camera."""

    size: Size
    position: np.ndarray


class Camera:
    """The cameras of all visitors of a server."""

    def __init__(self, server: viser.ViserServer):
        self._server = server
        # camera modes of the visitors, by the visitor's number
        self._modes: defaultdict[int, str] = defaultdict(lambda: FREE)
        self._placed: dict[int, Placed] = {}
        self._courses: dict[int, Course] = {}  # that each visitor's camera frames
        self._sizes: dict[int, float] = {}  # of the drones that each visitor sees [m]
        # what each visitor follows: name of a competitor, or LEADER
        self._followed: dict[int, str] = {}
        # last pose of each visitor's camera behind the drone of this name
        self._chased: dict[int, Chased] = {}
        server.on_client_connect(self._connected)
        server.on_client_disconnect(self._disconnected)

    def show(self, client: viser.ClientHandle, course: Course) -> None:
        """Frame a course for one visitor, unless it is the one that is framed."""
        framed = self._courses.get(client.client_id)
        if framed is None or course.text != framed.text:
            self._courses[client.client_id] = course
            self._place(client)

    def set_size(self, client: viser.ClientHandle, size: float) -> None:
        """Set the size of the drones that a visitor sees [m]."""
        self._sizes[client.client_id] = size
        if self._modes[client.client_id] == FPV:
            self._place(client)

    def frame_next(self, client: viser.ClientHandle, course: Course) -> None:
        """Frame this course at the next placement of a visitor's camera, without moving it now."""
        self._courses[client.client_id] = course

    def choose(self, client: viser.ClientHandle | None, mode: str | None = None) -> None:
        """Choose a mode for one visitor alone; None: the next mode."""
        if client is None:
            return
        number = client.client_id
        if mode is None:
            now = MODES.index(self._modes[number])
            mode = MODES[(now + 1) % len(MODES)]
        self._modes[number] = mode
        self._place(client)

    def mode_of(self, client: viser.ClientHandle) -> str:
        """Return the mode of one visitor's camera."""
        return self._modes[client.client_id]

    def follow_next(self, client: viser.ClientHandle | None, names: Sequence[str]) -> str:
        """Let one visitor's camera follow another competitor, and after the last one the leader.

        names: the competitors of the race.

        Returns:
            Name of the competitor that the camera follows now; empty: there is none.
        """
        if client is None or not names:
            return ""
        followed = [*names, LEADER]
        now = self._followed.get(client.client_id, followed[0])
        index = followed.index(now) if now in followed else -1
        chosen = followed[(index + 1) % len(followed)]
        self._followed[client.client_id] = chosen
        return chosen

    def follow(self, client: viser.ClientHandle, timings: Sequence[LapTiming]) -> None:
        """Move a visitor's camera if it follows a drone.

        timings: the competitors at the time that the visitor watches.
        """
        number = client.client_id
        camera = client.camera
        mode = self._modes[number]
        if mode not in (CHASE, FPV):
            return
        s = self._followed_by(number, timings)
        if mode == CHASE:
            last = self._chased.get(number)
            is_same = last is not None and last.name == s.entry.name
            pose = chase(s, last.pose if last and is_same else FAR_AWAY)
            self._chased[number] = Chased(s.entry.name, pose)
            with client.atomic():
                camera.position, camera.look_at = pose
        else:
            pose, up = fpv(s)
            with client.atomic():
                camera.up_direction = up
                camera.position, camera.look_at = pose

    def _followed_by(self, number: int, timings: Sequence[LapTiming]) -> LapTiming:
        """Return the competitor that a visitor follows: at first the one flown by hand, or the
        first one.
        """
        chosen = self._followed.get(number)
        if chosen == LEADER:
            return order(timings)[0]
        for s in timings:
            if s.entry.name == chosen:
                return s
        by_hand = (s for s in timings if s.entry.live and s.entry.sampler == HAND)
        return next(by_hand, timings[0])

    def _connected(self, client: viser.ClientHandle) -> None:
        self._place(client)
        client.camera.on_update(lambda _: self._reported(client))

    def _disconnected(self, client: viser.ClientHandle) -> None:
        self._modes.pop(client.client_id, None)
        self._followed.pop(client.client_id, None)
        self._placed.pop(client.client_id, None)
        self._sizes.pop(client.client_id, None)
        self._courses.pop(client.client_id, None)
        self._chased.pop(client.client_id, None)

    def _reported(self, client: viser.ClientHandle) -> None:
        """Frame the course again if the visitor's view still shows the framed course.

        This is the case if the size of the canvas has changed without a turn of the view, and if
        the page still shows its initial view.
        """
        camera = client.camera
        placed = self._placed.get(client.client_id, Placed((0, 0), np.zeros(3)))
        begun = self._server.initial_camera.position
        as_placed = np.allclose(camera.position, placed.position, atol=SAME_PLACE)
        as_begun = np.allclose(camera.position, begun, atol=SAME_PLACE)
        resized = placed.size != (camera.image_width, camera.image_height)
        if (as_placed and resized) or (as_begun and not as_placed):
            self._place(client)

    def _place(self, client: viser.ClientHandle) -> None:
        """Set a visitor's camera according to its mode."""
        camera = client.camera
        mode = self._modes[client.client_id]
        with client.atomic():
            if mode == FPV:
                camera.fov = DRONE_FOV
                # the drone itself is not in view
                camera.near = 0.8 * self._sizes.get(client.client_id, 1.0)
                return
            camera.fov = FOV
            camera.near = CHASE_NEAR if mode == CHASE else NEAR
            course = self._courses.get(client.client_id)
            if course is None:
                return
            camera.up_direction = UP
            if mode == CHASE:
                return
            size = (camera.image_width, camera.image_height)
            view = top_view if mode == TOP else overview
            pose = view(course, size)
            camera.position, camera.look_at = pose
            self._placed[client.client_id] = Placed(size, pose.position)


def chase(s: LapTiming, last: CameraPose) -> CameraPose:
    """Return a pose behind the drone, aimed along its flight towards the next gate.

    The pose moves smoothly from the last pose.
    """
    p = s.entry.rows(POSITION, s.i)
    vx, vy, vz = s.entry.rows(VELOCITY, s.i)
    ahead = np.array([vx, vy, 0.3 * vz])
    if np.linalg.norm(ahead) < SLOW:
        w, z = s.entry.rows(("qw", "qz"), s.i)
        ahead = np.array([w * w - z * z, 2 * w * z, 0.0])
    behind = p - BEHIND * ahead / np.linalg.norm(ahead) + ABOVE * UP
    target = p
    if s.next_gate:
        target = towards(behind, p, s.entry.course.gates[s.next_gate - 1].position)
    if np.linalg.norm(behind - last.position) > JUMP:
        # a new race, or a jump in the replay
        position = behind
        look_at = target
    else:
        position = last.position + SMOOTHING * (behind - last.position)
        look_at = last.look_at + LOOK_SMOOTHING * (target - last.look_at)
    position[2] = max(position[2], LOWEST)
    return CameraPose(position, look_at)


def towards(eye: np.ndarray, p: np.ndarray, gate: tuple[float, ...]) -> np.ndarray:
    """Return the point of aim, at the distance of p and turned from p towards a gate.

    Args:
        eye, p, gate: positions of the camera, the drone and the gate's centre [m]  (3,)
    """
    distance = float(np.linalg.norm(p - eye))
    to_drone = (p - eye) / distance
    to_gate = np.array(gate) - eye
    to_gate /= max(float(np.linalg.norm(to_gate)), 1e-9)
    across = to_gate - (to_gate @ to_drone) * to_drone
    length = float(np.linalg.norm(across))
    if length < 1e-6:
        return p
    angle = min(np.arctan2(length, to_gate @ to_drone) / 2, ASIDE)
    return eye + distance * (np.cos(angle) * to_drone + np.sin(angle) * across / length)


def fpv(s: LapTiming) -> tuple[CameraPose, np.ndarray]:
    """Return the pose of the drone's camera at its centre, and the camera's up direction."""
    forward, _, up = SO3(s.entry.rows(QUATERNION, s.i)).as_matrix().T
    tilt = HAND_TILT if s.entry.sampler == HAND else DRONE_TILT
    along = np.cos(tilt) * forward + np.sin(tilt) * up
    across = np.cos(tilt) * up - np.sin(tilt) * forward
    p = s.entry.rows(POSITION, s.i)
    return CameraPose(p, p + along), across


def set_initial_camera(server: viser.ViserServer, course: Course) -> None:
    """Set the initial camera of new visitors, and of recordings."""
    camera = server.initial_camera
    camera.position, camera.look_at = overview(course)
    camera.fov = FOV


def overview(course: Course, size: Size = SQUARE) -> CameraPose:
    """Return a pose beside the longer side of a course, with the whole course in view."""
    width, depth, _ = np.ptp(course.points(frames=False), axis=0)
    back = [0.12, -0.76, 0.64] if width >= depth else [0.76, 0.12, 0.64]
    return _fit(course, np.array(back), size)


def top_view(course: Course, size: Size = SQUARE) -> CameraPose:
    """Return a pose above a course, with the whole course in view.

    The view is not exactly vertical, as the up direction of a camera must not be its axis.
    """
    return _fit(course, np.array([0.0, -0.01, 1.0]), size)


class Bounds(NamedTuple):
    """Bounds on the camera along one axis of the picture."""

    low: float  # slope of the lower edge of the view
    high: float  # slope of the upper edge of the view
    least: float  # of c + low * cz
    most: float  # of c + high * cz


def _fit(course: Course, direction: np.ndarray, size: Size) -> CameraPose:
    """Return the nearest pose in a direction with the whole course in view.

    With coordinates x right, y up and z back, a point is in view where left (cz - z) <= x - cx <=
    right (cz - z) for a camera at c: so x + right z <= cx + right cz and x + left z >= cx + left
    cz, and likewise for y.
    """
    back = direction / np.linalg.norm(direction)
    right = np.cross(UP, back) / np.linalg.norm(np.cross(UP, back))
    axes = np.array([right, np.cross(back, right), back])
    p = course.points() @ axes.T
    half = np.tan(FOV / 2) * np.array([size[0] / size[1], 1.0])
    bounds = []
    for k in range(2):
        high = half[k] * (1.0 - 2.0 * MARGIN)
        low = -high
        least = (p[:, k] + low * p[:, 2]).min()
        most = (p[:, k] + high * p[:, 2]).max()
        bounds.append(Bounds(low, high, least, most))
    # The axis that needs more distance decides; along the other axis the course is centred.
    z = max((b.most - b.least) / (b.high - b.low) for b in bounds)
    x, y = ((b.most - b.high * z + b.least - b.low * z) / 2 for b in bounds)
    far = z - float(p[:, 2].mean())  # to the middle of the course
    return CameraPose(np.array([x, y, z]) @ axes, np.array([x, y, z - far]) @ axes)
