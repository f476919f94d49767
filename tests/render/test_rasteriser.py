"""The rasteriser against rays that are intersected one by one, and the laws of a shutter."""

from dataclasses import replace

import numpy as np
import pytest

from quadsim.course import Course, Gate, Start
from quadsim.course.obstacles import Box, Cylinder
from quadsim.dynamics.quadrotor import State
from quadsim.physics.plant_state import PlantState
from quadsim.render.faces import GROUND, Banner, gate_faces, obstacle_faces
from quadsim.render.look import plain_look
from quadsim.render.raster import ELLIPSE, Film
from quadsim.render.scene import GROUND_ID, Scene, Views
from quadsim.rotation import exp, from_euler, product
from quadsim.sensing.camera import Camera
from quadsim.sensing.config import PixelCameraConfig
from quadsim.sensing.pixel_camera import PixelCamera, TimedPose, row_poses, row_times

pytestmark = pytest.mark.compiled

CAMERA = Camera(160, 90, 80.0, 80.0)
LEVEL = (1.0, 0.0, 0.0, 0.0)
START = Start((0.0, 0.0, 2.0), 0.0)


def course_of(*gates, obstacles=()):
    course = Course("some", "", gates, START, ((-50, 50),) * 3, False, 1, (), "")
    return replace(course, obstacles=obstacles)


# Gates that interlock, one of them around the camera, and obstacles before and behind them
CROWDED = course_of(
    Gate((6.0, 0.0, 2.0), 0.3, 0.2, 0.4, (2.0, 1.5), 0.3),
    Gate((6.0, 0.5, 2.2), 1.2, 0.0, 0.0, (1.6, 1.6), 0.2),
    Gate((0.3, 0.2, 2.0), 0.1, 0.0, 0.2, (1.5, 1.5), 0.3),
    Gate((9.0, -1.0, 1.5), -0.5, 0.0, 0.0, (2.0, 2.0), 0.25),
    obstacles=(Cylinder((5.0, -0.8, 0.0), 0.2, 3.0), Box((7.0, 0.8, 1.0), (0.5, 1.0, 2.0), 0.5)),
)


def cast(course, camera, p, q):
    """Return depth and segmentation of a course by intersecting each ray with each face."""
    eye, axes = camera.pose(p, q)
    u, v = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    x = (u - camera.width / 2) / camera.fx
    y = (v - camera.height / 2) / camera.fy
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ axes.T
    with np.errstate(divide="ignore"):
        depth = np.where(rays[..., 2] < 0.0, -eye[2] / rays[..., 2], np.inf)
    at = eye + np.where(np.isfinite(depth), depth, 1e6)[..., None] * rays
    depth = np.where((abs(at[..., :2]) < GROUND).all(axis=-1), depth, np.inf)
    seen = np.where(np.isfinite(depth), GROUND_ID, 0)
    bodies = [(gate_faces(gate), k) for k, gate in enumerate(course.gates, start=1)]
    bodies += [(obstacle_faces(one), 254) for one in course.obstacles]
    for faces, number in bodies:
        for face in faces:
            normal = np.cross(face.a, face.b)
            with np.errstate(divide="ignore", invalid="ignore"):
                t = normal @ (face.origin - eye) / (rays @ normal)
            at = eye + t[..., None] * rays - face.origin
            a = at @ face.a / (face.a @ face.a)
            b = at @ face.b / (face.b @ face.b)
            inside = (abs(a) <= 1.0) & (abs(b) <= 1.0)
            if face.kind == ELLIPSE:
                inside = a**2 + b**2 <= 1.0
            inside &= ~((abs(a) <= face.hole[0]) & (abs(b) <= face.hole[1]))
            hit = inside & (t > 0.05) & (t < depth) & ((rays @ normal) < 0.0)
            depth = np.where(hit, t, depth)
            seen = np.where(hit, number, seen)
    return depth, seen


@pytest.mark.slow
def test_each_pixel_has_the_face_and_the_depth_that_its_ray_meets_first():
    scene = Scene(CROWDED, CAMERA)
    rng = np.random.default_rng(0)
    agree = []
    turned = []
    for _ in range(6):
        p = (rng.uniform(-1.0, 4.0), rng.uniform(-1.0, 1.0), rng.uniform(0.5, 3.5))
        angles = rng.normal(0.0, (0.4, 0.3, 1.0))
        q = from_euler(*angles.tolist())
        picture = scene.shoot(p, q, plain_look())
        depth, seen = cast(CROWDED, CAMERA, p, q)
        same = picture.segmentation == seen
        agree.append(same.mean())
        near = same & (depth < 50.0)
        assert picture.depth[near] == pytest.approx(depth[near], rel=1e-5)
        # A ray beside the pixel's middle meets other faces in some pixels: the test can fail.
        half = exp((0.0, 0.0, 0.5 / CAMERA.fx))
        turned.append((cast(CROWDED, CAMERA, p, product(q, half))[1] == seen).mean())
    assert min(agree) > 0.9999
    assert max(turned) < 0.9995


def test_banners_are_seen_from_both_sides_and_vehicles_where_they_are_placed():
    gate = Gate((30.0, 0.0, 2.0), 0.0, 0.0, 0.0, (2.0, 2.0), 0.3)
    for yaw in (0.0, np.pi):
        banner = Banner((5.0, 0.0, 2.0), yaw, (1.0, 0.5))
        scene = Scene(course_of(gate), CAMERA, banners=[banner])
        seen = scene.shoot(START.position, LEVEL, plain_look()).segmentation == 254
        # 16 by 8 pixels
        assert np.argwhere(seen).min(axis=0).tolist() == [41, 72]
        assert np.argwhere(seen).max(axis=0).tolist() == [48, 87]
    scene = Scene(course_of(gate), CAMERA, radius=0.5)
    for y in (1.0, -1.0):
        scene.place((5.0, y, 2.0), LEVEL)
        seen = scene.shoot(START.position, LEVEL, plain_look()).segmentation == 254
        assert np.argwhere(seen)[:, 1].mean() == pytest.approx(80.0 - 16.0 * y, abs=1.5)


# A camera that turns about the vertical at 4 rad/s, in front of a wide post
TURN = 4.0
POST = course_of(
    Gate((50.0, 0.0, 2.0), 0.0, 0.0, 0.0, (2.0, 2.0), 0.3),
    obstacles=(Box((5.0, -10.0, 10.0), (0.1, 20.0, 40.0)),),
)


def turning(exposure, readout, passes):
    """Return the red of a picture of a turning camera, whose left half is the post."""
    shutter = {"exposure": exposure, "readout": readout, "passes": passes}
    config = PixelCameraConfig(160, 90, 80.0, 80.0, **shutter)
    times = np.arange(-0.05, 0.05, 1 / 400)
    moments = [TimedPose(t, (*START.position, *exp((0.0, 0.0, TURN * t)))) for t in times.tolist()]
    views = Views(*row_poses(config, 0.0, moments))
    rgb = Scene(POST, config).colours(views, plain_look())
    return rgb[:40, :, 2].astype(float)


def edges(blue):
    """Return the column at which each row changes most, from sky to post.  (rows,)"""
    return np.argmax(abs(np.diff(blue, axis=1)), axis=1) + 1


def test_an_edge_is_blurred_over_the_pixels_that_it_crosses_while_the_shutter_is_open():
    sharp = turning(0.0, 0.0, 1)[20]
    crossed = 80.0 * TURN * 0.03
    blurred = turning(0.03, 0.0, 16)[20]
    between = (blurred < sharp.max() - 8) & (blurred > sharp.min() + 8)
    assert ((sharp < sharp.max() - 8) & (sharp > sharp.min() + 8)).sum() <= 1
    assert between.sum() == pytest.approx(crossed, abs=2.0)
    middle = np.flatnonzero(between).mean() + 0.5
    assert middle == pytest.approx(edges(sharp[None])[0], abs=1.0)


def test_a_rolling_shutter_slants_an_edge_by_what_it_moves_from_row_to_row():
    upright = edges(turning(0.0, 0.0, 1))
    slanted = edges(turning(0.0, 0.04, 1))
    assert np.ptp(upright) == 0
    slope = np.polyfit(np.arange(40), slanted, 1)[0]
    assert slope == pytest.approx(80.0 * TURN * 0.04 / 90, rel=0.05)
    # The middle row is exposed at the time of the picture.
    assert slanted[-1] + 5 * slope == pytest.approx(upright[-1], abs=1.0)


def test_noise_has_the_variance_of_reading_and_of_counting():
    scene = Scene(course_of(Gate((30.0, 0.0, 2.0), 0.0, 0.0, 0.0, (2.0, 2.0), 0.3)), CAMERA)
    eye, axes = CAMERA.pose(START.position, LEVEL)
    views = Views(np.tile(eye, (1, 90, 1)), np.tile(axes, (1, 90, 1, 1)))
    clean = scene.colours(views, plain_look()).astype(float)
    grain = np.random.default_rng(0).standard_normal((3, 100, 170)).astype(np.float32)
    for read, shot in ((3.0, 0.0), (3.0, 0.2)):
        film = Film(gain=0.5, read=read, shot=shot, grain=grain, shift=(3, 5))
        noisy = scene.colours(views, plain_look(), film).astype(float)
        expected = read**2 + shot * 0.5 * clean.mean() + 1 / 12
        assert (noisy - 0.5 * clean).var() == pytest.approx(expected, rel=0.05)


def test_a_picture_is_complete_after_its_last_row_and_has_the_time_of_its_middle():
    config = PixelCameraConfig(8, 8, 8.0, 8.0, rate=100.0, exposure=0.004, readout=0.006)
    taken = []

    def eye(eyes, axes):
        taken.append(eyes[..., 0])
        return np.zeros((8, 8, 3), np.uint8)

    camera = PixelCamera(config, eye, np.random.SeedSequence(0))
    found = []
    for k in range(41):
        place = (3.0 * k / 400, 0.0, 1.0)
        x = State.of(place, (3.0, 0.0, 0.0), LEVEL, (0.0, 0.0, 0.0), 9.81, (0.0, 0.0, 0.0))
        state = PlantState(k / 400, x, ())
        photo = camera.sample(state)
        if photo:
            found.append((k / 400, photo.t))
    # The last one is not complete yet.
    assert [t for _, t in found] == pytest.approx([0.01 * k for k in range(10)])
    assert [now - t for now, t in found] == pytest.approx([0.005] * 10)
    times = row_times(config, 0.05)
    assert taken[5] == pytest.approx(3.0 * times)
    assert (np.ptp(times[0]), np.ptp(times[:, 0])) == pytest.approx((0.006 * 7 / 8, 0.004 * 3 / 4))
    assert times.mean() == pytest.approx(0.05)


def test_a_picture_is_the_same_with_the_same_arguments():
    scene = Scene(CROWDED, CAMERA)
    look = plain_look()
    one = scene.shoot(START.position, LEVEL, look)
    scene.shoot((1.0, 0.0, 2.0), LEVEL, replace(look, sky=look.sky))
    assert np.array_equal(one.rgb, scene.shoot(START.position, LEVEL, look).rgb)
