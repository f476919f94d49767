"""Pictures with their corners, on which the network that finds gates is trained.

Every picture is rendered as by a flight's pixel camera, with a random look, camera, motion and
pose (domain randomization, Tobin et al. 2017).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import pi
from typing import NamedTuple

import numpy as np

from quadsim.config.build import flight_frames
from quadsim.config.spec import Spec
from quadsim.course import Course, load_course
from quadsim.course.frames import frames
from quadsim.course.random_courses import random_courses
from quadsim.dynamics.quadrotor import State
from quadsim.render.eye import CourseEye
from quadsim.render.look import ORANGE, Look, Paint, drawn_look, venue_look
from quadsim.render.poses import Pose, drawn_poses
from quadsim.rotation import exp, product, turned
from quadsim.sensing.config import PixelCameraConfig
from quadsim.sensing.pixel_camera import TimedPose, row_poses
from quadsim.sensing.pixels.network import WIDTH
from quadsim.streams import look_streams, training_stream, venue_stream

# courses that are never trained on, so that evaluations on them are independent
HELD_OUT = ("figure8", "paper_flat")
TRAINED_ON = (
    "split_s_swift",
    "split_s_song",
    "alphapilot",
    "aigp_physical",
    "lsy_level2",
)
# number of random courses beside these, and the share of pictures that are of them
RANDOM_COURSES = 40
RANDOM_SHARE = 0.5
# pictures that share a course, a look and a camera
TOGETHER = 20
# share of the pictures of a course from its flight, of those elsewhere with any roll
FLOWN = 0.6
ANY_ROLL = 0.2
# standard deviations of a pose from that of the flight [m, rad], and of the motion elsewhere [m/s,
# rad/s]
ASIDE = 0.25
TURNED = 0.08
SPEED = 6.0
RATES = 2.0
# samples of the planner that flies the courses, and longest flight [s]
SAMPLES = 512
LONGEST = 12.0
# [s] between two poses of a motion
STEP = 0.0025
# [m] distance beyond which gates are no task
FARTHEST = 40.0
# [px] least distance from the corners of a gate that are a task to its centre
SMALLEST = 5.0
# least sine of the angle between a gate's plane and the line of sight
SLANT = 0.1
# [m] distance of a corner from pixels of its own frame up to which it counts as seen
BESIDE = 0.07
# share of the pictures without a corner that are kept
EMPTY = 0.3
# most corners of a picture
CORNERS = 64


class Corner(NamedTuple):
    """A corner of a gate's opening in a picture."""

    # right and down [px]
    u: float
    v: float
    # centre of the gate's opening [px]
    centre_u: float
    centre_v: float
    # 1: it has to be found; 0: whether it is found does not matter; nan: there is no such corner
    task: float


@dataclass(frozen=True, eq=False)
class GatePictures:
    """Pictures, and the corners in them."""

    # (n, height, width, 3) uint8
    rgb: np.ndarray
    # rows have the fields of `Corner`; missing corners are nan  (n, CORNERS, 5) float32
    corners: np.ndarray


class Moved(NamedTuple):
    """A pose with a motion: velocity in the world [m/s], body rates [rad/s]."""

    pose: Pose
    velocity: np.ndarray
    rates: np.ndarray


@dataclass(frozen=True)
class Ground:
    """A course of which pictures are taken, with poses of a flight through it."""

    course: Course
    flown: tuple[Moved, ...] = ()

    @cached_property
    def corners(self) -> np.ndarray:
        """The corners of all frames [m]  (gates, 4, 3)."""
        return np.array([gate.corners() for gate in frames(self.course.gates)])


def grounds(seed: int) -> list[Ground]:
    """Return the courses of the training: named ones, which are flown once, and random ones."""
    named = []
    for name in TRAINED_ON:
        course = load_course(name)
        spec = Spec.of(course, laps=1, samples=SAMPLES, seed=seed, timeout=LONGEST)
        flown = []
        for frame in flight_frames(spec):
            x = State(*frame.x)
            pose = Pose(frame.t, x.position, x.attitude)
            flown.append(Moved(pose, np.array(x.velocity), np.array((x.wx, x.wy, x.wz))))
        named.append(Ground(course, tuple(flown)))
    return named + [Ground(course) for course in random_courses(RANDOM_COURSES, seed)]


def draw_pictures(
    places: Sequence[Ground],
    camera: PixelCameraConfig,
    count: int,
    seed: int,
    progress: Callable[[float], None] = lambda share: None,
) -> GatePictures:
    """Return rendered pictures with random looks, cameras, motions and poses.

    Args:
        places: the courses; random courses have no flight.
        camera: camera whose parameters are varied.
        count: number of pictures.
        seed: seed of the pictures.
        progress: function that is called with the share of pictures that is done.
    """
    rng = np.random.default_rng(training_stream(seed))
    flown = [place for place in places if place.flown]
    others = [place for place in places if not place.flown]
    pictures = []
    corners = np.full((count, CORNERS, len(Corner._fields)), np.nan, np.float32)
    venue = -1
    while len(pictures) < count:
        venue += 1
        among = others if others and (rng.random() < RANDOM_SHARE or not flown) else flown
        place = among[int(rng.integers(len(among)))]
        config = _camera(camera, rng)
        look = _look(seed, venue, rng)
        eye = CourseEye(config, venue_stream(seed, venue), place.course, look)
        for moved in _motions(place, config, seed + venue, rng):
            if len(pictures) == count:
                break
            rgb, found = _picture(eye, place, config, moved)
            # Few pictures without a corner are enough.
            if not any(corner.task for corner in found) and rng.random() > EMPTY:
                continue
            for k, corner in enumerate(found[:CORNERS]):
                corners[len(pictures), k] = corner
            pictures.append(rgb)
        progress(len(pictures) / count)
    return GatePictures(np.stack(pictures), corners)


def _camera(camera: PixelCameraConfig, rng: np.random.Generator) -> PixelCameraConfig:
    """Return a camera with varied parameters, whose pictures have the size of the network's input.

    A pixel of a reduced picture is the mean of several pixels, and so has less noise.
    """
    scale = WIDTH / camera.width
    focal = scale * rng.uniform(0.8, 1.3)
    return replace(
        camera,
        width=WIDTH,
        height=round(scale * camera.height),
        fx=camera.fx * focal,
        fy=camera.fy * focal,
        tilt_deg=rng.uniform(0.0, 40.0),
        exposure=rng.uniform(0.0, 0.01),
        readout=rng.uniform(0.0, 0.015),
        brightness=rng.uniform(0.5, 1.4),
        read_noise=rng.uniform(0.0, 4.0),
        shot_noise=rng.uniform(0.0, 0.1),
        jpeg=int(rng.integers(60, 95)) if rng.random() < 0.7 else 0,
        banners=int(rng.integers(0, 16)),
    )


def _look(seed: int, venue: int, rng: np.random.Generator) -> Look:
    """Return a random look with orange gates: half are venues, half have any ground and sky.

    The gates' paint differs in brightness and hue from the colour that the tracker expects.
    """
    streams = look_streams(seed, venue)
    if rng.random() < 0.5:
        look = venue_look(streams)
    else:
        look = drawn_look(streams, ("textures", "light", "background"))
    red, green, blue = np.array(ORANGE) * rng.uniform(0.75, 1.1) + rng.normal(0.0, 0.04, 3)
    paint = Paint(look.gates[0].texture if rng.random() < 0.2 else 0, (red, green, max(blue, 0.0)))
    return replace(look, gates=(paint,))


def _motions(
    place: Ground, config: PixelCameraConfig, seed: int, rng: np.random.Generator
) -> list[Moved]:
    """Return TOGETHER random poses, from a course's flight or around the course."""
    found = []
    for pose in drawn_poses(place.course, config, TOGETHER, seed):
        if place.flown and rng.random() < FLOWN:
            moved = place.flown[int(rng.integers(len(place.flown)))]
            p = (np.array(moved.pose.p) + ASIDE * rng.standard_normal(3)).tolist()
            q = turned(moved.pose.q, (TURNED * rng.standard_normal(3)).tolist())
            found.append(moved._replace(pose=Pose(None, tuple(p), q)))
            continue
        q = pose.q
        if rng.random() < ANY_ROLL:
            # about the optical axis
            axis = rng.uniform(-pi, pi) * config.axes[:, 2]
            q = product(q, exp(axis.tolist()))
        velocity = SPEED * rng.standard_normal(3)
        found.append(Moved(Pose(None, pose.p, q), velocity, RATES * rng.standard_normal(3)))
    return found


def _picture(
    eye: CourseEye, place: Ground, config: PixelCameraConfig, moved: Moved
) -> tuple[np.ndarray, list[Corner]]:
    """Return a rendered picture, and the corners in it."""
    half = 0.5 * (config.exposure + config.readout) + STEP
    eyes, axes = row_poses(config, 0.0, moments(moved, half))
    picture = eye.picture(eyes, axes)
    middle = config.passes // 2
    found = corners_in(place, config, eyes[middle], axes[middle], picture.segmentation)
    return picture.rgb, found


def moments(moved: Moved, half: float) -> list[TimedPose]:
    """Return the poses of a moving vehicle from `half` [s] before to `half` [s] after its pose."""
    pose, velocity, rates = moved
    found = []
    for t in np.linspace(-half, half, int(2 * half / STEP) + 2).tolist():
        p = (np.array(pose.p) + t * velocity).tolist()
        found.append(TimedPose(t, (*p, *turned(pose.q, (t * rates).tolist()))))
    return found


def shown(
    points: np.ndarray, config: PixelCameraConfig, eyes: np.ndarray, axes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels and depths of points of the world, with a rolling shutter.

    Args:
        points: points in the world [m]  (n, 3).
        config: the camera.
        eyes: position of the camera at each row [m]  (height, 3).
        axes: rotation from camera to world axes at each row  (height, 3, 3).

    Returns:
        Pixels, nan if the depth is not positive  (n, 2), and depths [m]  (n,).
    """
    row = np.full(len(points), config.height // 2)
    # The row that shows a point depends on its pixel, which depends on the row's pose.
    for _ in range(3):
        local = np.einsum("ni,nij->nj", points - eyes[row], axes[row])
        pixels, depth = config.to_pixels(local)
        row = np.clip(np.nan_to_num(pixels[:, 1]), 0, config.height - 1).astype(int)
    return pixels, depth


def corners_in(
    place: Ground,
    config: PixelCameraConfig,
    eyes: np.ndarray,
    axes: np.ndarray,
    segmentation: np.ndarray,
) -> list[Corner]:
    """Return the corners of gates in a picture, with the rolling shutter taken into account.

    Args:
        place: the course.
        config: the camera.
        eyes: position of the camera at each row [m]  (height, 3).
        axes: rotation from camera to world axes at each row  (height, 3, 3).
        segmentation: the gate's number in each pixel, from 1  (height, width).
    """
    gates = frames(place.course.gates)
    corners = place.corners
    centres = np.array([gate.position for gate in gates])
    points = np.concatenate([corners, centres[:, None]], axis=1).reshape(-1, 3)
    pixels, depth = shown(points, config, eyes, axes)
    pixels = pixels.reshape(-1, 5, 2)
    depth = depth.reshape(-1, 5)
    eye = eyes[len(eyes) // 2]
    found = []
    for k, gate in enumerate(gates):
        at, centre = pixels[k, :4], pixels[k, 4]
        inside = config.in_picture(at) & (depth[k, :4] > 0.2)
        if not inside.any():
            continue
        away = float(np.linalg.norm(centres[k] - eye))
        # in the segmentation a gate has the number of its first pass
        number = place.course.gates.index(gate) + 1
        ahead = abs(gate.to_local(tuple(eye.tolist())).along)
        # A centre behind the camera has no pixel.
        if np.isnan(centre).any() or depth[k, 4] < 0.2:
            found += [Corner(u, v, u, v, 0.0) for u, v in at[inside].tolist()]
            continue
        x, y = centre.tolist()
        apart = np.linalg.norm(at - centre, axis=1)
        good = away < FARTHEST and ahead > SLANT * away and np.nanmin(apart) > SMALLEST
        for j in np.flatnonzero(inside).tolist():
            reach = int(BESIDE * config.fx / depth[k, j]) + 1
            u, v = at[j].tolist()
            window = segmentation[
                max(int(v) - reach, 0) : int(v) + reach + 1,
                max(int(u) - reach, 0) : int(u) + reach + 1,
            ]
            seen = bool((window == number).any())
            if seen or good:
                found.append(Corner(u, v, x, y, float(seen and good)))
    return found
