"""Pictures for perception: labels agree with what is drawn, and a seed decides the poses."""

import json
from dataclasses import replace
from math import radians

import numpy as np
import pytest

from quadsim.course import Course, Gate, Start, load_course
from quadsim.course.obstacles import Box, Cylinder
from quadsim.files.strict_yaml import FileError
from quadsim.render.folder import annotate, claimed
from quadsim.render.frames import Job, Pictures, make_frames, path_of, whole_label
from quadsim.render.labels import label
from quadsim.render.look import VARIED, drawn_look, plain_look
from quadsim.render.poses import Pose, drawn_poses, flown_poses
from quadsim.sensing.camera import Camera, LensCamera
from quadsim.sensing.visibility import hidden
from quadsim.streams import look_streams

CAMERA = Camera(320, 180, 160.0, 160.0, tilt_deg=20.0, position=(0.1, 0.0, 0.0))
SWIFT = load_course("split_s_swift")
LEVEL = (1.0, 0.0, 0.0, 0.0)


def one_gate(x, width=2.0):
    gate = Gate((x, 0.0, 2.0), 0.0, 0.0, 0.0, (width, 2.0), 0.3)
    return Course(
        "one", "", (gate,), Start((0.0, 0.0, 2.0), 0.0), ((-50, 50),) * 3, False, 1, (), ""
    )


@pytest.fixture(scope="module")
def swift():
    from quadsim.render.scene import Scene

    return Scene(SWIFT, CAMERA)


def agreement(pictures, camera):
    """Return how many points on frames next to seen corners there are, and which share agrees.

    A point agrees where it lies on a pixel of its own gate.

    Args:
        pictures: poses with what CAMERA sees there.
        camera: the camera that is taken to have seen it.
    """
    hits = []
    for pose, seen in pictures:
        eye = camera.pose(pose.p, pose.q)[0]
        for number, gate in enumerate(SWIFT.gates, start=1):
            points = gate.corners(gate.frame_width / 2)
            pixels, depth = camera.project(points, pose.p, pose.q)
            free = ~hidden(points, eye, [g for g in SWIFT.gates if g != gate])
            for u, v in pixels[free & (depth < 20.0) & camera.in_picture(pixels)]:
                hits.append(seen[int(v), int(u)] == number)
    return len(hits), np.mean(hits)


@pytest.mark.slow
@pytest.mark.compiled
def test_projected_corners_lie_on_the_frames_that_are_drawn(swift):
    poses = drawn_poses(SWIFT, CAMERA, 12, seed=5)
    pictures = [(pose, swift.shoot(pose.p, pose.q, plain_look()).segmentation) for pose in poses]
    count, share = agreement(pictures, CAMERA)
    assert count > 40
    assert share > 0.97
    tilted = Camera(320, 180, 160.0, 160.0, tilt_deg=24.0, position=(0.1, 0.0, 0.0))
    assert agreement(pictures, tilted)[1] < 0.7  # a camera that is 4 degrees off does not agree


@pytest.mark.slow
@pytest.mark.compiled
def test_a_lens_bends_labels_as_it_bends_pictures():
    from quadsim.render.scene import Scene

    given = (320, 180, 160.0, 160.0, 20.0, 30.0, (0.1, 0.0, 0.0))
    wide = LensCamera(*given, k1=-0.15, k2=0.02)
    scene = Scene(SWIFT, wide)
    poses = drawn_poses(SWIFT, wide, 12, seed=5)
    pictures = [(pose, scene.shoot(pose.p, pose.q, plain_look()).segmentation) for pose in poses]
    count, share = agreement(pictures, wide)
    assert count > 40
    assert share > 0.97
    assert agreement(pictures, LensCamera(*given))[1] < 0.7


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("distance", [3.0, 9.0])
def test_a_frame_fills_the_pixels_whose_centres_it_covers_at_its_depth(distance):
    from quadsim.render.scene import GROUND_ID, Scene

    camera = Camera(320, 240, 160.0, 160.0)
    scene = Scene(one_gate(distance), camera)
    seen = scene.shoot((0.0, 0.0, 2.0), LEVEL, plain_look())
    half = 160.0 * 1.3 / (distance - 0.05)  # of the frame's front face [px]
    rows, columns = np.nonzero(seen.segmentation == 1)
    expected = np.flatnonzero(np.abs(np.arange(320) + 0.5 - 160.0) < half)
    assert (columns.min(), columns.max()) == (expected[0], expected[-1])
    expected = np.flatnonzero(np.abs(np.arange(240) + 0.5 - 120.0) < half)
    assert (rows.min(), rows.max()) == (expected[0], expected[-1])
    assert seen.depth[rows.min(), 160] == pytest.approx(distance - 0.05, rel=1e-3)
    # the ground, 2 m below
    assert seen.depth[239, 2] == pytest.approx(2.0 * 160.0 / 119.5, rel=1e-3)
    assert (seen.segmentation[239, 2], seen.segmentation[0, 2]) == (GROUND_ID, 0)
    assert np.isinf(seen.depth[0, 2])


def test_a_corner_is_seen_hidden_or_outside():
    near, wide = one_gate(5.0).gates[0], one_gate(10.0, width=4.4).gates[0]
    course = Course(
        "two", "", (near, wide), Start((0.0, 0.0, 2.0), 0.0), ((-50, 50),) * 3, False, 1, (), ""
    )
    camera, nothing = Camera(320, 180, 160.0, 160.0), np.zeros((180, 320), np.uint8)
    first, second = label(course, camera, Pose(0.0, (0.0, 0.0, 2.0), LEVEL), nothing)["gates"]
    assert (first["keypoints"][2::3], second["keypoints"][2::3]) == ([2.0] * 4, [1.0] * 4)
    # right bottom
    assert first["keypoints"][:2] == pytest.approx([160.0 + 160.0 / 5.0, 90.0 + 160.0 / 5.0])
    assert label(course, camera, Pose(0.0, (20.0, 0.0, 2.0), LEVEL), nothing)["gates"] == []


@pytest.mark.compiled
def test_obstacles_are_drawn_and_hide_corners():
    from quadsim.render.scene import OBSTACLE, Scene

    camera = Camera(320, 180, 160.0, 160.0)
    pole = Cylinder((4.0, 0.8, 0.0), 0.05, 2.5)
    box = Box((4.0, -0.8, 1.2), (0.1, 0.2, 0.3), yaw=0.3)
    course = replace(one_gate(5.0), obstacles=(pole, box))
    pose = Pose(None, (0.0, 0.0, 2.0), LEVEL)
    scene = Scene(course, camera)
    seen = scene.shoot(pose.p, pose.q, plain_look()).segmentation
    (gate,) = label(course, camera, pose, seen)["gates"]
    # the lower two are hidden, the upper two rise above what hides
    corners = np.reshape(gate["keypoints"], (4, 3))
    assert corners[:, 2].tolist() == [1.0, 2.0, 1.0, 2.0]
    assert [seen[int(v), int(u)] == OBSTACLE for u, v, _ in corners] == [True, False, True, False]


@pytest.mark.compiled
def test_a_picture_that_is_whole_is_kept_and_a_damaged_one_is_made_again_to_the_last_bit(tmp_path):
    pictures = Pictures("split_s_swift", SWIFT.text, CAMERA, 3, VARIED, "drawn")
    poses = list(enumerate(drawn_poses(SWIFT, CAMERA, 2, 3)))
    with claimed(tmp_path, pictures):
        pass
    assert make_frames(Job(pictures, tmp_path, poses)) == [0, 1]
    files = [path_of(tmp_path, kind, 1) for kind in ("rgb", "segmentation", "depth", "labels")]
    before = [path.read_bytes() for path in files]
    files[0].write_bytes(before[0][:100])
    assert whole_label(tmp_path, 0)
    assert whole_label(tmp_path, 1) is None
    make_frames(Job(pictures, tmp_path, poses[1:]))
    assert [path.read_bytes() for path in files] == before
    annotate(tmp_path, pictures, 2)
    document = json.loads((tmp_path / "annotations.json").read_bytes())
    names = [image["file_name"] for image in document["images"]]
    assert names == ["rgb/000000.png", "rgb/000001.png"]
    assert document["annotations"]
    for annotation in document["annotations"]:
        assert len(annotation["keypoints"]) == 12
        assert annotation["image_id"] in (0, 1)


def test_a_folder_of_other_pictures_or_files_is_refused(tmp_path):
    pictures = Pictures("split_s_swift", SWIFT.text, CAMERA, 3, (), "drawn")
    for _ in range(2):
        with claimed(tmp_path / "new", pictures):
            pass
    others = Pictures("split_s_swift", SWIFT.text, CAMERA, 4, ("light",), "drawn")
    with pytest.raises(FileError, match=r"other settings \(seed, vary\)"):
        claimed(tmp_path / "new", others).__enter__()
    with pytest.raises(FileError, match="other files"):
        claimed(tmp_path, pictures).__enter__()


def test_a_folder_that_another_process_fills_is_refused_and_nothing_of_it_is_removed(tmp_path):
    pictures = Pictures("split_s_swift", SWIFT.text, CAMERA, 3, (), "drawn")
    with claimed(tmp_path / "new", pictures):
        writing = tmp_path / "new" / "rgb" / "000000.png.tmp"
        writing.touch()
        with pytest.raises(FileError, match="another process makes pictures there"):
            claimed(tmp_path / "new", pictures).__enter__()
        assert writing.exists()
    # The lock has ended, so the file is that of a killed process.
    with claimed(tmp_path / "new", pictures):
        assert not writing.exists()


def test_drawn_poses_have_room_depend_on_seed_and_number_alone_and_mostly_see_their_gate():
    poses = drawn_poses(SWIFT, CAMERA, 60, 7)
    assert poses[:5] == drawn_poses(SWIFT, CAMERA, 5, 7)
    assert poses[0] != drawn_poses(SWIFT, CAMERA, 1, 8)[0]
    assert min(gate.frame_distance(pose.p) for pose in poses for gate in SWIFT.gates) > 0.3
    sees_a_corner = []
    for pose in poses:
        pixels, _ = CAMERA.gate_corners(SWIFT.gates, pose.p, pose.q)
        sees_a_corner.append(CAMERA.in_picture(pixels.reshape(-1, 2)).any())
    assert np.mean(sees_a_corner) > 0.7


def test_a_flight_is_sampled_at_the_cameras_rate_and_between_its_steps():
    t = np.arange(0.0, 0.101, 0.01)
    turned = t * radians(300.0)
    flight = {"t": t, "px": 20.0 * t, "py": 0 * t, "pz": 1 + 0 * t, "qx": 0 * t, "qy": 0 * t}
    flight |= {"qw": np.cos(turned / 2), "qz": np.sin(turned / 2)}
    flight["qw"][6:] *= -1.0  # the same attitudes, written the other way round
    flight["qz"][6:] *= -1.0
    poses = flown_poses(flight, 40.0)
    assert [pose.t for pose in poses] == pytest.approx([0.0, 0.025, 0.05, 0.075, 0.1])
    assert [pose.p[0] for pose in poses] == pytest.approx([0.0, 0.5, 1.0, 1.5, 2.0])
    yaws = [2 * np.arctan(pose.q[3] / pose.q[0]) for pose in poses]
    assert yaws == pytest.approx([radians(300.0) * pose.t for pose in poses], abs=1e-4)


def test_a_look_varies_in_what_is_asked_for_alone():
    def traits(look):
        return {
            "textures": (look.ground, look.gates),
            "light": look.light,
            "background": look.sky,
        }

    plain = traits(plain_look())
    for varied in VARIED:
        found = traits(drawn_look(look_streams(1, 0), [varied]))
        changed = [name for name in VARIED if str(found[name]) != str(plain[name])]
        assert changed == [varied]
        again = traits(drawn_look(look_streams(1, 0), [varied]))
        assert str(found) == str(again)
