"""The network that finds gates in pictures, and the pose that explains what it has found."""

import sys
from math import radians

import numpy as np
import pytest
from small import SHORT

import quadsim
from quadsim.course import load_course
from quadsim.course.frames import frames
from quadsim.files.strict_yaml import FileError
from quadsim.render.eye import CourseEye
from quadsim.rotation import from_yaw, matrix, turned
from quadsim.sensing import load_sensing
from quadsim.sensing.camera import BodyPose
from quadsim.sensing.pixel_camera import TimedPose, row_poses
from quadsim.sensing.pixels import network as networks
from quadsim.sensing.pixels import network_pose, tracker
from quadsim.sensing.pixels.edges import Frames
from quadsim.sensing.pixels.network import (
    FAR,
    STRIDE,
    FoundGate,
    GateNetwork,
    corners_of,
    grouped,
    load_network,
)
from quadsim.sensing.pixels.network_pose import Place, explained
from quadsim.sensing.visibility import hidden_corners

# a course from which the network has not learnt
COURSE = load_course("figure8")
GATES = frames(COURSE.gates)
CAMERA = load_sensing("pixels").pixels
# poses that see gates: position [m], yaw [deg]
SEEN = (((-4.0, -4.0, 1.5), 45.0), ((4.0, 2.0, 1.8), 20.0), ((15.5, -4.5, 3.0), 190.0))
# standard deviations of an estimate that is lost [m, rad]
MOVED = 0.5
TURNED = 0.1


def found_at(p, q, rng, noise=1.5):
    """Return what a perfect network would find, with errors [px]."""
    pixels, depth = CAMERA.gate_corners(GATES, p, q)
    found = []
    for at, ahead in zip(pixels, depth, strict=True):
        inside = CAMERA.in_picture(at)
        if inside.any() and ahead.min() > 0.3:
            off = noise * rng.standard_normal((inside.sum(), 2))
            found.append(FoundGate(at.mean(axis=0), at[inside] + off, np.ones(inside.sum())))
    return found


def place_at(p, q):
    """Return the pose of a filter that knows that it is lost."""
    P = np.diag(np.repeat([MOVED**2, TURNED**2], 3))
    late = np.zeros((len(GATES), 4, 2))
    return Place(Frames(GATES), CAMERA, BodyPose(np.array(p), matrix(q)), P, late)


@pytest.mark.parametrize(("p", "yaw"), SEEN)
def test_a_lost_pose_is_found_from_the_gates_in_a_picture(p, yaw):
    rng = np.random.default_rng(4)
    q = from_yaw(radians(yaw))
    believed = np.array(p) + MOVED * rng.standard_normal(3)
    turn = TURNED * rng.standard_normal(3)
    attitude = turned(q, turn.tolist())
    best = explained(found_at(p, q, rng), place_at(believed, attitude))
    assert best
    true, depth = CAMERA.gate_corners(GATES, p, q)
    before, _ = CAMERA.gate_corners(GATES, believed, attitude)
    better = turned(attitude, best.error[3:].tolist())
    after, _ = CAMERA.gate_corners(GATES, believed + best.error[:3], better)
    seen = CAMERA.in_picture(true.reshape(-1, 2)).reshape(-1, 4) & (depth > 0.3)
    assert np.median(np.linalg.norm(before - true, axis=2)[seen]) > 15.0
    assert np.median(np.linalg.norm(after - true, axis=2)[seen]) < 4.0


def test_what_is_no_gate_of_the_map_shows_no_pose():
    rng = np.random.default_rng(5)
    p, yaw = SEEN[0]
    place = place_at(p, from_yaw(radians(yaw)))
    # Four corners on one line, wherever it may be.
    for _ in range(20):
        ends = rng.uniform((0, 0), (640, 360), (2, 2))
        line = ends[0] + np.array([0.0, 0.3, 0.6, 1.0])[:, None] * (ends[1] - ends[0])
        assert explained([FoundGate(line.mean(axis=0), line, np.ones(4))], place) is None


def test_corners_are_read_from_cells_and_belong_to_the_centre_that_they_point_to():
    # two gates, one in the other's opening, as the network puts them into cells
    output = np.zeros((5, 48, 80), np.float32)
    gates = {(100.0, 70.0): 55.0, (110.0, 75.0): 12.0}
    for (u, v), half in gates.items():
        for du, dv in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
            x, y = (u + du * half) / STRIDE, (v + dv * half) / STRIDE
            at = int(y), int(x)
            towards = (-du * half / STRIDE / FAR, -dv * half / STRIDE / FAR)
            output[:, *at] = 0.9, x - int(x) - 0.5, y - int(y) - 0.5, *towards
    found = grouped(corners_of(output))
    assert [len(one.corners) for one in found] == [4, 4]
    centres = sorted(map(tuple, np.round([one.centre for one in found], 3).tolist()))
    assert centres == sorted(gates)


@pytest.fixture(scope="module")
def network():
    pytest.importorskip("onnxruntime", reason="onnxruntime is not installed")
    return load_network("gates")


def picture(p, yaw):
    eye = CourseEye(CAMERA, np.random.SeedSequence(3), COURSE)
    pose = (*p, *from_yaw(radians(yaw)))
    return eye(*row_poses(CAMERA, 0.0, [TimedPose(-0.02, pose), TimedPose(0.02, pose)]))


@pytest.mark.compiled
@pytest.mark.slow
def test_the_network_finds_gates_from_which_it_has_not_learnt(network):
    for p, yaw in SEEN:
        true, _ = CAMERA.gate_corners(GATES, p, from_yaw(radians(yaw)))
        clear = ~hidden_corners(GATES, np.array(p)).any(axis=1)
        clear &= CAMERA.in_picture(true.reshape(-1, 2)).reshape(-1, 4).all(axis=1)
        for k in np.flatnonzero(clear).tolist():
            away = np.subtract(p, GATES[k].position)
            # near, and not seen from the side
            clear[k] = 10.0 > np.linalg.norm(away) < 2.0 * abs(away @ GATES[k].rotation[:, 0])
        corners = np.concatenate([one.corners for one in network(picture(p, yaw))])
        off = np.linalg.norm(true[clear].reshape(-1, 1, 2) - corners, axis=2).min(axis=1)
        assert clear.any()
        assert np.median(off) < 3.0


@pytest.mark.compiled
def test_the_network_finds_nothing_in_the_sky(network):
    assert not network(picture((0.0, 0.0, 60.0), 0.0)[:150])


@pytest.mark.compiled
@pytest.mark.slow
def test_a_flight_begins_at_the_pose_that_the_network_shows(network, monkeypatch):
    asked = []
    whole = network_pose.explained

    def watched(*given):
        asked.append(whole(*given))
        return asked[-1]

    monkeypatch.setattr(tracker, "explained", watched)
    run = quadsim.fly("figure8", sensing="pixels_network", seed=3, **{**SHORT, "timeout": 0.4})
    off = [run.telemetry[f"est_p{axis}"] - run.telemetry[f"p{axis}"] for axis in "xyz"]
    assert asked
    assert asked[0]
    assert np.linalg.norm(off, axis=0)[-1] < 0.15


def test_the_network_says_what_made_it(network):
    assert {"command", "commit", "seed", "courses", "steps", "losses"} <= set(network.about)
    assert "figure8" in network.about["held out"]


def test_a_flight_that_needs_the_network_names_the_package_that_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    networks.load_network.cache_clear()
    with pytest.raises(quadsim.SettingError, match=r"network: onnxruntime is not installed: .*pip"):
        quadsim.Spec.of("figure8", sensing="pixels_network")


def test_a_file_that_is_no_network_is_one_line(tmp_path):
    pytest.importorskip("onnxruntime", reason="onnxruntime is not installed")
    path = tmp_path / "mine.onnx"
    path.write_bytes(b"no network")
    with pytest.raises(FileError, match=r"mine.onnx: expected a network of race train-pixels"):
        GateNetwork(path)
    sensing = load_sensing("pixels").but(pixels={"network": "nowhere.onnx"})
    with pytest.raises(quadsim.SettingError, match=r"FILE.onnx that is there, got 'nowhere.onnx'"):
        quadsim.Spec.of("figure8", sensing=sensing)
