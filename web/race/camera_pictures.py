"""Pictures of a vehicle's camera for the page, rendered as by `race render`.

A picture takes some milliseconds of processor time, and its JPEG holds Python's global lock, which
would delay a flight. So they are drawn in a process of its own, with a low priority.
"""

from __future__ import annotations

import io
import multiprocessing as mp
import os
import signal
from collections.abc import Mapping
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from time import perf_counter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from PIL import Image

from quadsim.course import parse_course
from quadsim.render.look import plain_look
from quadsim.rotation import Quaternion, Vec3
from quadsim.sensing.camera import Camera, load_camera
from quadsim.sensing.measurements import Corners
from quadsim.web.race.competitor import POSITION, QUATERNION, Competitor

if TYPE_CHECKING:
    from quadsim.render.scene import Scene

DEFAULT_CAMERA = "aigp"  # camera for a vehicle without one, as in `race render`
WIDTH = 400  # approximate width of a picture [px]
PERIOD = 0.25  # least time between two pictures [s]
SHOWN = 0.25  # largest age of corners that are drawn [s]
NICE = 10
QUALITY = 80  # quality of the JPEG
ENDED = "the process that draws the pictures has ended"


class CameraView(NamedTuple):
    """A view to draw: a course from a vehicle's camera."""

    course_name: str
    course_text: str
    camera: Camera
    position: Vec3  # of the vehicle [m]
    attitude: Quaternion  # of the vehicle


class PictureMoment(NamedTuple):
    """A competitor at the moment of a picture."""

    name: str
    t: float  # [s]
    view: CameraView
    # size of the camera's own pictures, to which the corners refer [px]
    size: tuple[int, int]
    corners: Corners | None  # corners found in this picture


class CameraPicture(NamedTuple):
    """A picture of a moment, or the reason why there is none."""

    moment: PictureMoment
    jpeg: bytes
    problem: str = ""


class At(NamedTuple):
    """A competitor at a time [s]."""

    entry: Competitor
    t: float


class CameraPictures:
    """Pictures for several visitors in turn. Only one thread uses it, and calls never wait.

    Attributes:
        last: the last picture of each visitor.
    """

    def __init__(self) -> None:
        self.last: dict[int, CameraPicture] = {}
        self._process: BaseProcess | None = None
        self._pipe: Connection | None = None
        self._asked: PictureMoment | None = None  # the moment that is being drawn
        self._asked_for: list[int] = []  # the visitors who watch it
        self._turns: list[int] = []  # the visitors who had a picture, the last ones at the end
        self._asked_at = -PERIOD  # [s]

    def show(self, wanted: Mapping[int, At]) -> None:
        """Take a finished picture, and request the next one when it is due.

        Args:
            wanted: what each visitor watches, by the visitors' numbers. Those who watch the same
                get one picture.
        """
        self._take()
        self.last = {visitor: one for visitor, one in self.last.items() if visitor in wanted}
        self._turns = [visitor for visitor in self._turns if visitor in wanted]
        if self._asked or perf_counter() - self._asked_at < PERIOD:
            return
        waiting = [visitor for visitor in wanted if visitor not in self._turns]
        for visitor in (*waiting, *self._turns):
            at = wanted[visitor]
            moment = moment_of(*at)
            last = self.last.get(visitor)
            if last is None or not _is_same(moment, last.moment):
                self._asked_for = [one for one in wanted if wanted[one] == at]
                self._ask(moment)
                return

    def close(self) -> None:
        """End the process; the next call of `show` starts another one."""
        if self._process:
            self._process.terminate()
            self._process.join()
        if self._pipe:
            self._pipe.close()
        self._process = None
        self._pipe = None
        self._asked = None

    def _ask(self, moment: PictureMoment) -> None:
        """Request a picture from the process, which is started if needed."""
        self._asked = moment
        self._asked_at = perf_counter()
        pipe = self._pipe or self._start()
        try:
            pipe.send(moment.view)
        except OSError:
            self._took(b"", ENDED)

    def _take(self) -> None:
        """Take the requested picture if it is ready."""
        if self._asked is None or self._pipe is None:
            return
        try:
            if not self._pipe.poll():
                return
            jpeg, problem = self._pipe.recv()
        except (EOFError, OSError):
            jpeg, problem = b"", ENDED
        self._took(jpeg, problem)

    def _took(self, jpeg: bytes, problem: str) -> None:
        """Keep the requested picture. If there is none, restart the process."""
        assert self._asked is not None
        picture = CameraPicture(self._asked, jpeg, problem)
        self.last |= dict.fromkeys(self._asked_for, picture)
        served = [visitor for visitor in self._turns if visitor not in self._asked_for]
        self._turns = [*served, *self._asked_for]
        self._asked = None
        if problem:
            self.close()

    def _start(self) -> Connection:
        """Start the process, and return the pipe to it."""
        # Python would look for its own modules in the current folder first.
        os.environ["PYTHONSAFEPATH"] = "1"
        # A fork would inherit the locks of its parent's threads.
        spawn = mp.get_context("spawn")
        self._pipe, theirs = spawn.Pipe()
        process = spawn.Process(target=draw_all, args=(theirs,), daemon=True)
        process.start()
        self._process = process
        # Close this copy, so that each side notices the end of the other.
        theirs.close()
        return self._pipe


def moment_of(entry: Competitor, t: float) -> PictureMoment:
    """Return the moment of a competitor to be drawn.

    If the vehicle's camera has just found corners, the moment is the time of the camera's last
    picture, so that the corners match it.
    """
    camera = camera_of(entry)
    corners = entry.corners
    if corners and not 0.0 <= t - corners.t <= SHOWN:
        corners = None
    if corners:
        t = corners.t
    position, attitude = pose_at(entry, t)
    view = CameraView(entry.course.name, entry.course.text, smaller(camera), position, attitude)
    return PictureMoment(entry.name, t, view, (camera.width, camera.height), corners)


def camera_of(entry: Competitor) -> Camera:
    """Return the camera of a vehicle; if it has none, the default camera of `race render`."""
    sensing = entry.spec.sensing
    camera = sensing and (sensing.pixels or sensing.camera)
    return camera or load_camera(DEFAULT_CAMERA)


def smaller(camera: Camera) -> Camera:
    """Return the camera with fewer pixels, about WIDTH in a row, and the same field of view."""
    parts = max(round(camera.width / WIDTH), 1)
    width = camera.width // parts
    height = camera.height // parts
    return Camera(
        width=width,
        height=height,
        fx=camera.fx * width / camera.width,
        fy=camera.fy * height / camera.height,
        tilt_deg=camera.tilt_deg,
        position=camera.position,
    )


def pose_at(entry: Competitor, t: float) -> tuple[Vec3, Quaternion]:
    """Return position [m] and attitude of a competitor, between its frames interpolated."""
    after = int(np.searchsorted(entry.t, t).clip(1, max(len(entry.t) - 1, 1)))
    rows = np.array([after - 1, min(after, len(entry.t) - 1)])
    times = entry.t[rows]
    share = float(np.clip((t - times[0]) / max(times[1] - times[0], 1e-9), 0.0, 1.0))
    p0, p1 = entry.rows(POSITION, rows)
    q0, q1 = entry.rows(QUATERNION, rows)
    # q and -q are the same attitude
    q1 = q1 if q0 @ q1 >= 0.0 else -q1
    q = q0 + share * (q1 - q0)
    x, y, z = (p0 + share * (p1 - p0)).tolist()
    w, i, j, k = (q / np.linalg.norm(q)).tolist()
    return (x, y, z), (w, i, j, k)


def _is_same(one: PictureMoment, other: PictureMoment) -> bool:
    """Return whether two moments give the same picture, with the same corners."""
    return one._replace(corners=None) == other._replace(corners=None) and (
        one.corners is other.corners
    )


def draw_all(views: Connection) -> None:
    """Draw views one after another in a separate process, until the other side is closed.

    The answer is a JPEG and a text with a problem; one of the two is empty.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent
    os.nice(NICE)
    painter = Painter()
    while True:
        try:
            view = views.recv()
        except (EOFError, OSError):
            return
        try:
            views.send((painter.draw(view), ""))
        except ValueError as error:
            views.send((b"", str(error)))


class Painter:
    """Draws views, and caches the last scene, as its set-up takes longer than a picture."""

    def __init__(self) -> None:
        self._scene: Scene | None = None
        self._of: tuple[str, Camera] | None = None  # course and camera of the scene

    def draw(self, view: CameraView) -> bytes:
        """Return a view as a JPEG.

        Raises:
            ValueError: the course has too many gates for a picture.
        """
        from quadsim.render.scene import Scene  # imported here, as it loads the compiler

        if self._scene is None or self._of != (view.course_text, view.camera):
            self._scene = Scene(parse_course(view.course_text, view.course_name), view.camera)
            self._of = (view.course_text, view.camera)
        seen = self._scene.shoot(view.position, view.attitude, plain_look())
        data = io.BytesIO()
        Image.fromarray(seen.rgb).save(data, "jpeg", quality=QUALITY)
        return data.getvalue()
