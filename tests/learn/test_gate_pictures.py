"""Pictures to learn from: their labels lie where the corners of gates are."""

import numpy as np
import pytest

from quadsim.course import load_course
from quadsim.course.frames import frames
from quadsim.learn.gate_pictures import Ground, Moved, draw_pictures, moments, shown
from quadsim.render.look import ORANGE
from quadsim.render.poses import Pose
from quadsim.sensing import load_sensing
from quadsim.sensing.pixel_camera import row_poses
from quadsim.sensing.pixels.signal import Signal

CAMERA = load_sensing("pixels").pixels
COURSE = load_course("figure8")
PICTURES = 20
# [px] half the window around a corner, and by how much the negative control is off
WINDOW = 3
OFF = 40


def test_a_rolling_shutter_shows_a_point_where_it_is_when_its_row_is_exposed():
    pose = Pose(None, (-4.0, -4.0, 1.5), (0.92, 0.0, 0.0, 0.39))
    moved = Moved(pose, np.array([6.0, 6.0, 1.0]), np.array([2.0, -1.0, 1.0]))
    eyes, axes = row_poses(CAMERA, 0.0, moments(moved, 0.02))
    points = frames(COURSE.gates)[0].corners()
    pixels, depth = shown(points, CAMERA, eyes[0], axes[0])
    assert depth.min() > 0.0
    for point, pixel in zip(points, pixels, strict=True):
        row = int(np.clip(pixel[1], 0, CAMERA.height - 1))
        there, _ = CAMERA.to_pixels((point - eyes[0, row])[None] @ axes[0, row])
        assert np.linalg.norm(there[0] - pixel) < 0.1
    # Without the motion of the rows they would be elsewhere.
    middle, _ = CAMERA.to_pixels((points - eyes[0, 180]) @ axes[0, 180])
    assert np.linalg.norm(middle - pixels, axis=1).max() > 2.0


@pytest.mark.compiled
@pytest.mark.slow
def test_labels_lie_on_the_frames_of_gates():
    pictures = draw_pictures([Ground(COURSE)], CAMERA, PICTURES, seed=2)
    assert pictures.rgb.shape == (PICTURES, 180, 320, 3)
    signal = Signal(ORANGE)
    on, beside = [], []
    for rgb, corners in zip(pictures.rgb, pictures.corners, strict=True):
        weight = signal.of(rgb)
        for u, v, *_, task in corners[~np.isnan(corners[:, 4])].tolist():
            if task and 0 <= v < 180 and OFF < u < 320 - OFF:
                for at, found in ((u, on), (u + (OFF if u < 160 else -OFF), beside)):
                    rows = slice(max(int(v) - WINDOW, 0), int(v) + WINDOW + 1)
                    window = weight[rows, int(at) - WINDOW : int(at) + WINDOW + 1]
                    found.append(float(window.max() - np.median(weight)))
    assert len(on) > 20
    assert np.median(on) > 3.0 * max(np.median(beside), 1.0)
    # The same seed gives the same pictures.
    again = draw_pictures([Ground(COURSE)], CAMERA, 2, seed=2)
    assert np.array_equal(again.rgb, pictures.rgb[:2])
