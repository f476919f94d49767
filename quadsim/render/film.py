"""Films of a flight from a camera behind the vehicle, as animated WebP or GIF files.

The vehicle is drawn enlarged. The path behind the vehicle is coloured by the speed, from dark (at
rest) to bright (the highest speed of the flight).
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from math import atan2, hypot
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib import colormaps
from PIL import Image, ImageDraw
from scipy.ndimage import gaussian_filter1d

from quadsim.course import Course
from quadsim.files.atomic import replace_file
from quadsim.render.look import plain_look
from quadsim.render.poses import Pose, flown_poses
from quadsim.rotation import Quaternion, Vec3, from_euler
from quadsim.sensing.camera import Camera

if TYPE_CHECKING:
    from quadsim.render.scene import Picture

FORMATS = {".webp": "WEBP", ".gif": "GIF"}
# Default size, focal length and rate of a film
CAMERA = Camera(640, 360, 340.0, 340.0, rate=20.0)
# WebP: quality, up to 100, and its slowest method, which makes the smallest file
QUALITY = 70
SMALLEST = 6

# Lengths in radii of the drawn vehicle
LARGER = 1.5  # scale of the drawn vehicle
BEHIND = 13.0  # distance of the film camera behind the vehicle
ABOVE = 3.0  # height of the film camera above the vehicle; small, so that it passes the gates too
AHEAD = 10.0  # distance ahead of the vehicle of the point at which the film camera is aimed
TRAIL = 0.2  # width of the path

LOWEST = 0.3  # least height of the film camera [m]
# Standard deviations of the filters that smooth the motion of the film camera [s]
CALM_DIRECTION = 0.25
CALM_PLACE = 0.07
SLOW = 1.0  # weight of the heading beside the velocity in the direction of the view [m/s]
WIDEST = 5  # largest width of the path in the picture [px]


class FilmFrame(NamedTuple):
    """The poses of the vehicle and of the film camera."""

    vehicle: Pose
    eye: Vec3  # position of the film camera [m]
    attitude: Quaternion  # attitude of the film camera; the optical axis is its x axis


def film(
    course: Course,
    telemetry: Mapping[str, np.ndarray],
    radius: float,
    camera: Camera,
    count: int | None = None,
) -> Iterator[Image.Image]:
    """Yield the pictures of a flight from behind the vehicle, at the camera's rate.

    Args:
        course: gates and obstacles to draw.
        telemetry: columns of a run by name  (frames,).
        radius: radius of the vehicle [m].
        camera: camera whose size, focal lengths and rate are used.
        count: largest number of pictures; None: the whole flight.
    """
    # imported here, as it loads the compiler
    from quadsim.render.scene import Scene

    # The film camera has neither tilt nor offset from its pose.
    lens = Camera(camera.width, camera.height, camera.fx, camera.fy, rate=camera.rate)
    scene = Scene(course, lens, LARGER * radius)
    look = plain_look()
    for view in views(telemetry, camera.rate, LARGER * radius)[:count]:
        scene.place(view.vehicle.p, view.vehicle.q)
        seen = scene.shoot(view.eye, view.attitude, look)
        picture = Image.fromarray(seen.rgb)
        draw_path(picture, seen, lens, view, telemetry, LARGER * radius)
        yield picture


def views(telemetry: Mapping[str, np.ndarray], rate: float, radius: float) -> list[FilmFrame]:
    """Return the poses of a camera that follows the vehicle from behind and above.

    Args:
        telemetry: columns of a run by name  (frames,).
        rate: views per second [Hz].
        radius: radius of the drawn vehicle [m].
    """
    t = telemetry["t"]
    dt = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
    position = _columns(telemetry, "px", "py", "pz")
    ahead = _directions(telemetry, dt)
    eye = gaussian_filter1d(position, CALM_PLACE / dt, axis=0, mode="nearest")
    eye += radius * (ABOVE * np.array([0.0, 0.0, 1.0]) - BEHIND * ahead)
    eye[:, 2] = np.maximum(eye[:, 2], LOWEST)
    towards = position + AHEAD * radius * ahead - eye

    found = []
    for pose in flown_poses(telemetry, rate):
        place = [float(np.interp(pose.t or 0.0, t, column)) for column in eye.T]
        x, y, z = (float(np.interp(pose.t or 0.0, t, column)) for column in towards.T)
        attitude = from_euler(yaw=atan2(y, x), pitch=-atan2(z, hypot(x, y)), roll=0.0)
        found.append(FilmFrame(pose, (place[0], place[1], place[2]), attitude))
    return found


def draw_path(
    picture: Image.Image,
    seen: Picture,
    camera: Camera,
    view: FilmFrame,
    telemetry: Mapping[str, np.ndarray],
    radius: float,
) -> None:
    """Draw the visible part of the path that the vehicle has flown.

    Args:
        picture: the picture to draw on.
        seen: the same picture with its depth.
        camera: the film camera.
        view: the poses of the vehicle and of the film camera.
        telemetry: columns of a run by name  (frames,).
        radius: radius of the drawn vehicle [m].
    """
    flown = telemetry["t"] <= view.vehicle.t
    points = _columns(telemetry, "px", "py", "pz")[flown]
    pixels, depth = camera.project(points, view.eye, view.attitude)
    inside = camera.in_picture(pixels)
    shown = np.zeros(len(points), bool)
    columns, rows = pixels[inside].astype(int).T
    shown[inside] = depth[inside] < seen.depth[rows, columns]

    speeds = np.linalg.norm(_columns(telemetry, "vx", "vy", "vz"), axis=1)
    # plasma without its darkest eighth
    shares = 0.125 + 0.875 * speeds / max(float(speeds.max()), 1e-9)
    colours = colormaps["plasma"](shares, bytes=True)[:, :3].tolist()
    draw = ImageDraw.Draw(picture)
    for i in np.flatnonzero(shown[:-1] & shown[1:]).tolist():
        width = round(camera.fx * TRAIL * radius / float(depth[i]))
        ends = [tuple(pixels[i].tolist()), tuple(pixels[i + 1].tolist())]
        draw.line(ends, fill=tuple(colours[i]), width=min(max(width, 1), WIDEST))


def write_film(pictures: Sequence[Image.Image], rate: float, path: Path) -> None:
    """Write pictures as a film that repeats; if writing fails, no partial file remains.

    Args:
        pictures: at least one picture.
        rate: pictures per second [Hz]. A GIF file is limited to whole hundredths of a second.
        path: the file; its suffix is one of FORMATS.

    Raises:
        OSError: the file cannot be written.
    """
    content = io.BytesIO()
    first, *others = pictures
    first.save(
        content,
        FORMATS[path.suffix.lower()],
        save_all=True,
        append_images=others,
        duration=round(1000.0 / rate),
        loop=0,
        quality=QUALITY,
        method=SMALLEST,
    )
    replace_file(path, content.getvalue())


def _columns(telemetry: Mapping[str, np.ndarray], *names: str) -> np.ndarray:
    """Return columns of the telemetry side by side.  (frames, names)"""
    return np.column_stack([telemetry[name] for name in names])


def _directions(telemetry: Mapping[str, np.ndarray], dt: float) -> np.ndarray:
    """Return smoothed unit vectors along the flight, world frame.  (frames, 3)"""
    w, x, y, z = _columns(telemetry, "qw", "qx", "qy", "qz").T
    # the horizontal direction of the body's x axis
    nose = np.column_stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 0.0 * w])
    along = _columns(telemetry, "vx", "vy", "vz") + SLOW * nose
    along = gaussian_filter1d(along, CALM_DIRECTION / dt, axis=0, mode="nearest")
    return along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
