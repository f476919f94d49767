"""A pinhole camera: where points of the world are seen, and what a camera file may say."""

from dataclasses import replace
from math import atan2, cos, pi, radians, sin, tan

import numpy as np
import pytest

from quadsim.course import load_course
from quadsim.files.strict_yaml import FileError
from quadsim.rotation import from_euler, matrix
from quadsim.sensing.camera import (
    NEAREST,
    BodyPose,
    Camera,
    LensCamera,
    camera_names,
    load_camera,
    parse_camera,
)
from quadsim.sensing.whole_gates import gates_alike, whole_from

LEVEL = (1.0, 0.0, 0.0, 0.0)
CAMERA = Camera(width=640, height=360, fx=320.0, fy=300.0)


def yawed(angle):
    return (cos(angle / 2), 0.0, 0.0, sin(angle / 2))


def seen(camera, point, p=(0.0, 0.0, 0.0), q=LEVEL):
    pixels, depth = camera.project(np.array([point]), p, q)
    return pixels[0], depth[0]


def test_a_point_straight_ahead_is_in_the_middle():
    pixel, depth = seen(CAMERA, (5.0, 0.0, 0.0))
    assert pixel == pytest.approx((320.0, 180.0))
    assert depth == pytest.approx(5.0)


def test_left_and_up_in_the_world_are_left_and_up_in_the_picture():
    pixel, _ = seen(CAMERA, (4.0, 1.0, 0.5))
    assert pixel == pytest.approx((320.0 - 320.0 / 4.0, 180.0 - 300.0 * 0.5 / 4.0))


def test_tilt_turns_the_optical_axis_up():
    camera = Camera(640, 360, 320.0, 320.0, tilt_deg=20.0)
    up = radians(20.0)
    assert seen(camera, (3.0 * cos(up), 0.0, 3.0 * sin(up)))[0] == pytest.approx((320.0, 180.0))
    assert seen(camera, (3.0, 0.0, 0.0))[0][1] > 180.0  # the horizon sinks


def test_the_camera_moves_and_turns_with_the_body():
    camera = Camera(640, 360, 320.0, 320.0, position=(0.2, 0.0, 0.1))
    # it looks along the world's y
    pixel, depth = seen(camera, (1.0, 5.2, 2.1), p=(1.0, 0.0, 2.0), q=yawed(pi / 2))
    assert pixel == pytest.approx((320.0, 180.0))
    assert depth == pytest.approx(5.0)


@pytest.mark.parametrize(("k1", "k2"), [(-0.15, 0.02), (0.1, 0.0), (0.0, 0.0)])
def test_the_rays_of_a_lens_are_the_inverse_of_its_pixels(k1, k2):
    lens = LensCamera(640, 360, 320.0, 300.0, k1=k1, k2=k2)
    pixels = np.random.default_rng(0).uniform((0, 0), (640, 360), (200, 2))
    ahead = np.column_stack([lens.rays(pixels), np.ones(200)])
    again, depth = lens.to_pixels(7.0 * ahead)
    assert depth == pytest.approx(7.0)
    assert again == pytest.approx(pixels, abs=1e-9)
    plain, _ = CAMERA.to_pixels(ahead)
    further = np.linalg.norm(plain - (320, 180), axis=1) - np.linalg.norm(
        pixels - (320, 180), axis=1
    )
    # a barrel draws points towards the middle, a cushion away from it
    assert (np.sign(np.rint(1e6 * further)) == -np.sign(k1)).all()


def test_the_rays_of_a_strong_lens_are_found_too():
    """Newton's steps alone leave the picture."""
    lens = LensCamera(160, 160, 0.07, 0.07, k2=10.0)
    assert lens.problem() == ""
    pixels = np.random.default_rng(0).uniform(0, 160, (200, 2))
    again, _ = lens.to_pixels(np.column_stack([lens.rays(pixels), np.ones(200)]))
    assert again == pytest.approx(pixels, abs=1e-6)


def test_what_a_barrel_folds_back_is_not_in_the_picture():
    barrel = LensCamera(640, 360, 400.0, 400.0, k1=-0.15)
    local = np.array([[3.0, 0.0, 1.0], [0.5, 0.0, 1.0]])
    pixels, _ = barrel.to_pixels(local)
    assert np.isnan(pixels[0]).all()
    assert barrel.in_picture(pixels).tolist() == [False, True]


def test_a_lens_that_does_not_reach_the_corners_is_refused():
    text = "width: 640\nheight: 360\nfx: 200\nfy: 200\nk1: -.3\n"
    with pytest.raises(
        FileError, match=r"mine\.yaml: k1: .* corners, 1\.84 from .* rays up to 0\.\d\d; bring"
    ):
        parse_camera(text, "mine.yaml")


def test_what_is_behind_has_no_pixel_and_is_not_in_the_picture():
    pixels, depth = CAMERA.project(
        np.array([(-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]), (0.0, 0.0, 0.0), LEVEL
    )
    assert np.isnan(pixels).all()
    assert (depth <= 0.0).all()
    assert not CAMERA.in_picture(pixels).any()


def test_the_picture_ends_at_its_edges():
    pixels = np.array([(0.0, 0.0), (639.9, 359.9), (640.0, 10.0), (-0.1, 10.0), (10.0, 360.0)])
    assert CAMERA.in_picture(pixels).tolist() == [True, True, False, False, False]


def test_gate_corners_are_those_of_the_openings():
    gates = load_course("split_s_swift").gates
    p, q = (-20.0, -3.0, 3.0), yawed(0.3)
    pixels, depth = CAMERA.gate_corners(gates, p, q)
    assert pixels.shape == (len(gates), 4, 2)
    one, far = CAMERA.project(gates[2].corners(), p, q)
    np.testing.assert_array_equal(pixels[2], one)
    np.testing.assert_array_equal(depth[2], far)


@pytest.mark.parametrize("name", camera_names())
def test_every_camera_of_the_project_loads_and_has_a_source(name):
    assert load_camera(name).source


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("width: 640\nheight: 360\nfx: 320\n", "1:1: fy: missing, expected a number [px]"),
        (
            "width: 0\nheight: 360\nfx: 320\nfy: 1\n",
            "1:8: width: expected a whole number [px] >= 8 and <= 8192, got 0",
        ),
        (
            "width: 64\nheight: 36\nfx: -1\nfy: 1\n",
            "3:5: fx: expected a number [px] > 0 and <= 100000, got -1",
        ),
        (
            "width: 64\nheight: 36\nfx: 1\nfy: 1\ntilt: 3\n",
            "5:1: tilt: unknown key, did you mean 'tilt_deg' (in degrees)?",
        ),
    ],
)
def test_a_mistake_in_a_camera_file_is_one_line(text, problem):
    with pytest.raises(FileError) as error:
        parse_camera(text, "mine.yaml")
    assert str(error.value) == f"mine.yaml:{problem}"


def test_an_unknown_camera_is_one_line_with_those_that_are_known():
    with pytest.raises(
        FileError, match=r"^no camera 'agp': did you mean 'aigp'\?, or a FILE.yaml$"
    ):
        load_camera("agp")


def test_a_gate_is_whole_from_where_its_lower_edge_comes_into_the_picture():
    """A level camera at the height of the centre: the edge is half the opening below, at d."""
    gate = load_course("aigp_physical").gates[0]
    camera = Camera(width=640, height=360, fx=320.0, fy=320.0, tilt_deg=20.0)
    edge = radians(20.0) - atan2(180.0, 320.0)  # of the picture, above the horizon
    (level,) = whole_from(gate, camera, pitches=[0.0])
    assert level.opening == pytest.approx(0.75 / -tan(edge), abs=0.06)
    assert level.frame == pytest.approx(1.35 / -tan(edge), abs=0.06)
    # One that looks over the horizon sees no gate of its own height whole.
    (over,) = whole_from(gate, replace(camera, tilt_deg=30.0), pitches=[0.0])
    assert (over.opening, over.frame) == (None, None)


def test_gates_of_one_size_and_pitch_are_a_group():
    gates = load_course("aigp_physical").gates
    assert gates_alike(gates) == [list(range(1, 12))]


AWAY = np.array([[4.0, 1.0, 0.5], [2.0, -0.7, 0.9], [9.0, 3.0, -2.0]])
TILTED = Camera(640, 360, 320.0, 300.0, tilt_deg=20.0, position=(0.1, 0.0, 0.02))


def test_seen_points_are_projected_and_move_by_their_derivatives():
    p, q = (-1.0, 0.3, 0.2), from_euler(0.2, -0.1, 0.3)
    pose = BodyPose(np.array(p), matrix(q))
    seen = TILTED.seen(AWAY, pose)
    pixels, depth = TILTED.project(AWAY, p, q)
    np.testing.assert_allclose(seen.pixels, pixels)
    np.testing.assert_allclose(seen.depth, depth)
    for k in range(6):
        small = 1e-5 * np.eye(6)[k]
        ends = [TILTED.seen(AWAY, pose.corrected(s * small)).pixels for s in (1.0, -1.0)]
        np.testing.assert_allclose((ends[0] - ends[1]) / 2e-5, seen.moves[:, :, k], rtol=1e-4)


def test_a_point_nearer_than_the_least_depth_is_seen_as_if_it_had_that_depth():
    pose = BodyPose(np.zeros(3), np.eye(3))
    near, at = (CAMERA.seen(np.array([[x, 0.2, 0.1]]), pose) for x in (-1.0, NEAREST))
    np.testing.assert_allclose(near.pixels, at.pixels)
    np.testing.assert_allclose(near.moves[:, :, :3], at.moves[:, :, :3])
    assert (near.depth, at.depth) == (-1.0, NEAREST)
