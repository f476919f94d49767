"""The pose that fits lines, and lines that are something else."""

from dataclasses import replace

import numpy as np

from quadsim.course import load_course
from quadsim.course.frames import frames
from quadsim.rotation import from_yaw, matrix
from quadsim.sensing import load_sensing
from quadsim.sensing.camera import BodyPose, CameraPose
from quadsim.sensing.pixels.edges import Frames, seen_well, visible_points
from quadsim.sensing.pixels.pose_fit import Guess, fitted, line_ends, normal_moves

CONFIG = load_sensing("pixels").pixels
assert CONFIG
GATES = frames(load_course("split_s_swift").gates)
POSITION_STD = 0.1
TURN_STD = 0.02
P = np.diag(np.repeat([POSITION_STD**2, TURN_STD**2], 3))
POSE = BodyPose(np.array([-5.0, 4.7, 0.9]), matrix(from_yaw(-0.8)))
GUESS = Guess(POSE, P, np.zeros(len(GATES)))
POINTS = visible_points(Frames(GATES), CONFIG.carried(POSE), CONFIG, CONFIG.range, border=4.0)


def pixels(guess):
    """Return the pixels of the points from a pose.  (n, 2)"""
    return CONFIG.to_pixels(CONFIG.carried(guess.pose).local(POINTS.position))[0]


def errors_of_fits(share, rng):
    """Return errors of fitted turns [rad], where a share of the lines is off by some 15 px."""
    found = []
    for _ in range(20):
        error = np.repeat([POSITION_STD, TURN_STD], 3) * rng.standard_normal(6)
        true = GUESS.corrected(error, P)
        shift = ((pixels(true) - POINTS.pixel) * POINTS.normal).sum(axis=1)
        wrong = rng.random((len(GATES), 8)) < share
        off = 15.0 * rng.choice([-1.0, 1.0], (len(GATES), 8))
        shift += np.where(wrong, off, 0.0)[POINTS.gate, POINTS.edge]
        fit = fitted(GUESS, CONFIG, POINTS, shift).guess
        found.append(np.linalg.norm(fit.pose.body - true.pose.body))
    return np.array(found)


def test_a_quarter_of_wrong_lines_hardly_moves_the_pose():
    rng = np.random.default_rng(0)
    right = errors_of_fits(0.0, rng)
    some = errors_of_fits(0.25, rng)
    # the control: too many wrong lines do move it
    most = errors_of_fits(0.8, rng)
    assert np.median(right) < 0.1 * TURN_STD
    assert np.median(some) < 0.25 * TURN_STD
    assert np.median(most) > 0.5 * TURN_STD


def test_the_spread_of_a_pixel_is_that_of_poses_drawn_from_the_covariance():
    rng = np.random.default_rng(1)
    draws = rng.multivariate_normal(np.zeros(6), 0.01 * P, 400)
    drawn = np.array([pixels(GUESS.corrected(error, P)) for error in draws])
    along = ((drawn - POINTS.pixel) * POINTS.normal).sum(axis=2)
    J = normal_moves(POINTS, CONFIG, POSE)
    expected = np.sqrt(GUESS._replace(P=0.01 * P).spread(J, POINTS.gate)[:, 0, 0])
    assert np.allclose(along.std(axis=0), expected, rtol=0.15)
    # A gate that may stand elsewhere may be seen farther away.
    loose = GUESS._replace(P=0.01 * P, displaced=np.full(len(GATES), 0.1**2))
    assert (loose.spread(J, POINTS.gate)[:, 0, 0] > expected**2).all()


def test_the_ends_of_a_line_are_its_first_and_its_last_point():
    used = np.zeros(len(POINTS.gate), bool)
    ends = set()
    for gate, edge in set(zip(POINTS.gate.tolist(), POINTS.edge.tolist(), strict=True)):
        mine = np.flatnonzero((POINTS.gate == gate) & (POINTS.edge == edge))[1:-1]
        used[mine] = True
        ends |= {*mine[:1].tolist(), *mine[-1:].tolist()}
    assert line_ends(POINTS, used).tolist() == sorted(ends)


def test_a_thin_frame_is_seen_from_nearer_to_its_plane_than_a_thick_one():
    thin = replace(GATES[0], frame_depth=0.02)
    thick = replace(GATES[0], frame_depth=0.1)
    # 5 cm before the plane of the gate
    eye = np.array(thin.position) - 0.05 * np.array(thin.axes[0])
    view = CameraPose(eye, np.eye(3))
    assert seen_well(Frames([thin, thick]), view, longest=10.0).tolist() == [True, False]
