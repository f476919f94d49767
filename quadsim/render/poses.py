"""Poses of the vehicle for pictures, from a stored flight or random ones around a course."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import asin, atan2, radians

import numpy as np

from quadsim.course import Course
from quadsim.rotation import Quaternion, Vec3, from_euler
from quadsim.sensing.camera import Camera
from quadsim.streams import pose_stream

# standard deviation of the distance from the straight lines between the gates, per axis [m]
ASIDE = 1.0
# standard deviations about the direction to the next gate [rad]
TURN = radians(25)
PITCH = radians(12)
ROLL = radians(25)
CLEAR = 0.3  # least clearance to frames and obstacles [m]
LOWEST = 0.3  # least height [m]
TRIES = 1000  # largest number of draws for one pose


@dataclass(frozen=True)
class Pose:
    """The pose of the vehicle, not of the camera."""

    t: float | None  # time in the flight [s]; None: not of a flight
    p: Vec3  # [m]
    q: Quaternion


def flown_poses(telemetry: Mapping[str, np.ndarray], rate: float) -> list[Pose]:
    """Return the poses of a flight at equal time steps.

    Between control steps positions are interpolated linearly, and attitudes by slerp. At 20 m/s and
    4 g, half way between two steps of 10 ms, the position is off by 0.5 mm.

    Args:
        telemetry: columns of a run by name  (frames,).
        rate: poses per second [Hz].
    """
    t = telemetry["t"]
    at = np.arange(0.0, t[-1] + 1e-9, 1.0 / rate)
    p = np.column_stack([np.interp(at, t, telemetry[name]) for name in ("px", "py", "pz")])
    q = np.column_stack([telemetry[name] for name in ("qw", "qx", "qy", "qz")])
    # q and -q are the same attitude
    turns = np.cumprod(np.where((q[1:] * q[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))
    q[1:] *= turns[:, None]
    q = np.column_stack([np.interp(at, t, column) for column in q.T])
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    rows = zip(at.tolist(), p.tolist(), q.tolist(), strict=True)
    return [Pose(time, (*position,), (*attitude,)) for time, position, attitude in rows]


def drawn_poses(course: Course, camera: Camera, count: int, seed: int) -> list[Pose]:
    """Return random poses around the course; pose i depends only on the seed and i.

    Each is near the straight line to a gate, with the optical axis near the direction to that gate.

    Raises:
        ValueError: the course has no room.
    """
    rngs = (np.random.default_rng(pose_stream(seed, i)) for i in range(count))
    return [_draw(course, camera, rng) for rng in rngs]


def _draw(course: Course, camera: Camera, rng: np.random.Generator) -> Pose:
    """Return one random pose. Raises ValueError if the course has no room."""
    ends = [np.array(gate.position) for gate in course.gates]
    first = ends[-1] if course.loop else np.array(course.start.position)
    starts = [first, *ends[:-1]]
    # the probability of a leg is proportional to its length
    lengths = np.array([np.linalg.norm(b - a) for a, b in zip(starts, ends, strict=True)]) + 0.1
    for _ in range(TRIES):
        k = rng.choice(len(ends), p=lengths / lengths.sum())
        on_leg = starts[k] + rng.random() * (ends[k] - starts[k])
        p = on_leg + ASIDE * rng.standard_normal(3)
        if _free(course, p):
            ahead = course.gates[k].corners().mean(axis=0) - p
            return Pose(None, tuple(p.tolist()), _looking(ahead, camera, rng))
    raise ValueError(f"{course.name}: expected room around the course, found none in {TRIES} draws")


def _free(course: Course, p: np.ndarray) -> bool:
    """Return whether a position is within the bounds and clear of frames and obstacles."""
    x, y, z = p.tolist()
    within = all(low <= x <= high for x, (low, high) in zip(p, course.bounds, strict=True))
    to_frames = [gate.frame_distance((x, y, z)) for gate in course.gates]
    to_obstacles = [obstacle.distance((x, y, z)) for obstacle in course.obstacles]
    return within and z > LOWEST and min(to_frames + to_obstacles) > CLEAR


def _looking(ahead: np.ndarray, camera: Camera, rng: np.random.Generator) -> Quaternion:
    """Return a random attitude with the camera's axis near a direction in the world."""
    x, y, z = (ahead / max(float(np.linalg.norm(ahead)), 1e-9)).tolist()
    yaw = atan2(y, x) + TURN * rng.standard_normal()
    # positive: nose down
    pitch = radians(camera.tilt_deg) - asin(z) + PITCH * rng.standard_normal()
    roll = ROLL * rng.standard_normal()
    return from_euler(yaw, pitch, roll)
