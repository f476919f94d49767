"""Draw the tracker's edges for flying_on_pictures.md: `.venv/bin/python docs/pixels_figure.py`.

It prints how many gates are found on random poses, of which kinds, how exactly, and how long a
picture takes.
"""

from __future__ import annotations

from time import process_time
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from shared import (
    CORNERS,
    DISTANCE,
    RATES,
    SPEED,
    WITHIN,
    corners_of,
    estimated,
    frame_picture,
    moving,
    save,
)

from quadsim.course import load_course
from quadsim.course.frames import frames
from quadsim.render.eye import CourseEye
from quadsim.render.poses import Pose, drawn_poses
from quadsim.rotation import turned
from quadsim.sensing import load_sensing
from quadsim.sensing.config import PixelCameraConfig
from quadsim.sensing.measurements import Photo
from quadsim.sensing.pixel_camera import row_poses
from quadsim.sensing.pixels.tracker import Tracked, Tracker

COURSE = load_course("split_s_swift")
GATES = frames(COURSE.gates)


def pixel_camera() -> PixelCameraConfig:
    """Return the camera of the set of sensors `pixels`."""
    camera = load_sensing("pixels").pixels
    assert camera is not None
    return camera


CAMERA = pixel_camera()
POSES = 200
# poses that share a venue, with its look and its banners
TOGETHER = 20
# sine of the angle to its plane from which on a gate is not seen from its side
ASIDE = 0.2
# [px] motion of a gate during the exposure, from which on it counts as blurred
BLURRED = 4.0
SHOWN = (4, 5, 34, 82)


class Case(NamedTuple):
    """A gate in a picture."""

    found: bool
    # from the camera to the gate [m]
    away: float
    # sine of the angle between the line of sight and the plane of the gate
    sine: float
    # corners outside of the picture, and corners that another frame or an obstacle hides
    clipped: int
    hidden: int
    # motion during the exposure [px]
    blur: float


# Kinds of gates
KINDS = {
    "all": lambda case: True,
    "nearer than 5 m": lambda case: case.away < 5.0,
    "5 to 10 m": lambda case: 5.0 <= case.away < 10.0,
    "10 to 15 m": lambda case: case.away >= 10.0,
    "less than 5 degrees to its plane": lambda case: case.sine < 0.087,
    "5 to 12 degrees": lambda case: 0.087 <= case.sine < ASIDE,
    "more than 12 degrees": lambda case: case.sine >= ASIDE,
    "a corner outside of the image": lambda case: case.clipped > 0,
    "a corner behind another gate": lambda case: case.hidden > 0,
    f"moves {BLURRED:.0f} px or more during the exposure": lambda case: case.blur >= BLURRED,
}


def main() -> None:
    rng = np.random.default_rng(0)
    tracker = Tracker(CAMERA, GATES)
    errors: list[float] = []
    found: list[Case] = []
    drawing = []
    tracking = []
    figure, axes = plt.subplots(2, 2, figsize=(12.8, 7.4), layout="constrained")
    for k, pose in enumerate(drawn_poses(COURSE, CAMERA, POSES, seed=3)):
        if k % TOGETHER == 0:
            eye = CourseEye(CAMERA, np.random.SeedSequence(k), COURSE)
        velocity = rng.normal(0.0, SPEED, 3)
        rates = rng.normal(0.0, RATES, 3)
        began = process_time()
        photo = Photo(0.0, eye(*row_poses(CAMERA, 0.0, moving(pose, velocity, rates))))
        drawn = process_time()
        seen = tracker.tracked(photo, estimated(pose, velocity, rng), tuple(rates.tolist()))
        tracking.append(process_time() - drawn)
        drawing.append(drawn - began)
        found += compare(pose, velocity, rates, seen, errors)
        if k in SHOWN:
            draw(axes.flat[SHOWN.index(k)], photo, seen)
    save(figure, "pixels.png", dpi=100)
    for name, kind in KINDS.items():
        hits = [case.found for case in found if kind(case)]
        print(f"{name}: {sum(hits)} of {len(hits)}")
    print(f"{len(errors)} corners, median {np.median(errors):.2f} px", end=", ")
    print(f"95 % within {np.quantile(errors, 0.95):.2f} px")
    print(f"processor time in the median: drawing {1e3 * np.median(drawing):.1f} ms", end=", ")
    print(f"tracking {1e3 * np.median(tracking):.1f} ms")


def compare(
    pose: Pose, velocity: np.ndarray, rates: np.ndarray, seen: Tracked, errors: list[float]
) -> list[Case]:
    """Return the gates of a picture, and add the errors of its corners."""
    corners = corners_of(CAMERA, GATES, COURSE, pose)
    true = corners.pixels
    eye, _ = CAMERA.pose(pose.p, pose.q)
    p = (np.array(pose.p) + CAMERA.exposure * velocity).tolist()
    later, _ = CAMERA.gate_corners(GATES, (*p,), turned(pose.q, (CAMERA.exposure * rates).tolist()))
    cases = []
    for k, gate in enumerate(GATES):
        mine = seen.found.gates == k
        off = np.linalg.norm(seen.found.pixels[mine] - true[k, seen.found.corners[mine]], axis=1)
        errors += off.tolist()
        in_view = corners.in_view[k]
        away = float(np.linalg.norm(np.subtract(gate.position, eye)))
        if in_view.sum() >= CORNERS and away < DISTANCE:
            case = Case(
                found=bool((off < WITHIN).sum() >= 2),
                away=away,
                sine=abs(gate.to_local((*eye.tolist(),)).along) / away,
                clipped=int((~corners.inside[k]).sum()),
                hidden=int(corners.hidden[k].sum()),
                blur=float(np.linalg.norm((later[k] - true[k])[in_view], axis=1).max()),
            )
            cases.append(case)
    return cases


def draw(panel, photo: Photo, seen: Tracked) -> None:
    """Draw a picture with expected edges, found and rejected steps, and found corners."""
    panel.imshow(photo.rgb)
    points = seen.points
    at = points.pixel + seen.steps.shift[:, None] * points.normal
    rejected = seen.steps.found & ~seen.used
    panel.plot(*points.pixel.T, ".", color="white", markersize=2, label="expected edge")
    panel.plot(*at[seen.used].T, ".", color="lime", markersize=3, label="found")
    panel.plot(*at[rejected].T, ".", color="red", markersize=3, label="rejected")
    panel.plot(*seen.found.pixels.T, "+", color="cyan", markersize=9, label="corner")
    frame_picture(panel, CAMERA)
    if panel.get_subplotspec().is_first_row() and panel.get_subplotspec().is_first_col():
        panel.legend(loc="upper left", fontsize=8)


if __name__ == "__main__":
    main()
