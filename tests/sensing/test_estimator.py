"""The estimator: consistent, indifferent to the order of arrival, deaf to outliers, and finite
without a sensor."""

from dataclasses import replace

import numpy as np
import pytest

from quadsim.course import Start
from quadsim.rotation import between, matrix
from quadsim.sensing import load_sensing, sensing_names
from quadsim.sensing.camera import BodyPose
from quadsim.sensing.config import BarometerConfig, GateCameraConfig, PoseConfig
from quadsim.sensing.estimate_record import ESTIMATE_UNITS, estimate_row
from quadsim.sensing.estimation.estimator import Estimator
from quadsim.sensing.estimation.updates import LEAST_POSITION, CornerUpdate
from quadsim.sensing.measurements import Corners, RotorThrust
from quadsim.sensing.nominal import Nominal
from quadsim.sensing.sensors import Sensors
from quadsim.sensing.state import MOVING, FilterState
from quadsim.vehicle import load_vehicle
from tests.sensing.truth_cases import GATES, circle, states

GATES_ONLY, VIO, SWIFT = load_sensing("gates"), load_sensing("vio"), load_vehicle("swift")
START = circle(0.0)
NAMES = list(ESTIMATE_UNITS)


def begun(sensing, gates=GATES, displaced=0.0):
    """An estimator at the start of the circle, which flies already."""
    x = START.x
    estimator = Estimator(sensing, gates, Start(x[0:3], 0.0), 0.0, displaced)
    nominal = Nominal(0.0, x[0:3], x[3:6], x[6:10])
    estimator.state = estimator._oldest = replace(estimator.state, nominal=nominal)
    return estimator


def flown(sensing, seed, seconds=4.0, true_gates=GATES, displaced=0.0, late=()):
    """Rows of ESTIMATE_UNITS every 10 ms, and the estimator."""
    sensors = Sensors(sensing, np.random.SeedSequence(seed), SWIFT, true_gates)
    estimator, rows = begun(sensing, displaced=displaced), []
    for k, state in enumerate(states(seconds)):
        sensors.observe(state)
        if k % 4 == 0 and k:
            estimator.innovations.clear()
            for measurement in sensors.arrived(state.t):
                if not isinstance(measurement, RotorThrust):
                    estimator.take(measurement)
            rows.append(
                estimate_row(
                    state,
                    estimator.at(state.t),
                    estimator.covariance(state.t),
                    estimator.innovations,
                    (0, 0),
                    0.0,
                )
            )
    return np.array(rows), estimator


def column(rows, name):
    return rows[:, NAMES.index(name)]


# a new file is tested by itself; errors of corners found in pictures have no known distribution
SENSED = [s for s in map(load_sensing, sensing_names()) if not (s.exact or s.pixels)]


@pytest.mark.slow
@pytest.mark.parametrize("sensing", SENSED, ids=lambda s: s.name)
def test_errors_of_an_estimate_are_as_large_as_its_covariance(sensing):
    """NEES over seeds within bounds of chi-square with 9 degrees of freedom; NIS near its own.

    A sensor better than the filter takes any for leaves the covariance too large: then only the
    upper bounds hold.
    """
    exact = sensing.pose is not None and sensing.pose.position_noise < LEAST_POSITION
    late = [flown(sensing, seed, seconds=2.5)[0][100:] for seed in range(3)]
    nees = np.mean([column(rows, "nees").mean() for rows in late])
    assert (0.0 if exact else 4.0) < nees < 11.0
    nis = sum(column(rows, "nis").sum() for rows in late) / sum(
        column(rows, "nis_dof").sum() for rows in late
    )
    assert (0.0 if exact else 0.85) < nis < 1.15


def test_too_little_noise_is_seen_in_the_consistency():
    """The negative control: a sensor five times noisier than the estimator takes it for."""
    worse = replace(GATES_ONLY, camera=replace(GATES_ONLY.camera, noise=10.0))
    sensors = Sensors(worse, np.random.SeedSequence(1), SWIFT, GATES)
    estimator = begun(GATES_ONLY)
    for state in states(2.0):
        sensors.observe(state)
        for measurement in sensors.arrived(state.t):
            estimator.take(measurement)
    taken = estimator.innovations
    refused, used = (sum(getattr(i, name) for i in taken) for name in ("refused", "used"))
    assert refused > 0.3 * used


def test_corners_move_as_the_jacobian_predicts():
    camera = GateCameraConfig(640, 360, 320.0, 300.0, 20.0, position=(0.1, 0.0, 0.02))
    update = CornerUpdate(camera, GATES, free=True)
    x, which, corner = START.x, np.array([0, 0, 1]), np.array([0, 3, 1])
    state = FilterState(
        Nominal(0.0, x[0:3], x[3:6], x[6:10]), np.zeros(0), np.zeros((2, 3)), np.eye(MOVING + 6)
    )

    def pixels(b):
        points = update._map[which, corner] + b.gates[which]
        body = (points - b.nominal.position) @ matrix(b.nominal.attitude)
        return camera.in_view(body)[0].ravel()

    pose = BodyPose(np.array(x[0:3]), matrix(x[6:10]))
    seen = camera.seen(update._map[which, corner], pose)
    H = update._jacobian(state, seen.moves, which)
    steps = 1e-6 * np.eye(MOVING + 6)
    columns = [
        (pixels(state.corrected(d, state.P)) - pixels(state.corrected(-d, state.P))) / 2e-6
        for d in steps
    ]
    np.testing.assert_allclose(H, np.column_stack(columns), atol=1e-4)


@pytest.mark.parametrize(
    ("corners", "known", "moves"), [([1], 0.087, False), ([0, 1], 0.087, True), ([1], 0.02, True)]
)
def test_a_gate_that_is_not_found_yet_is_moved_by_no_lone_corner(corners, known, moves):
    """Gate 2 stands 10 cm farther along x: two of its corners show it, a single one might be
    another gate's.
    known: standard deviation of where it stands [m]."""
    camera = GateCameraConfig(640, 360, 320.0, 320.0, 20.0)
    update, x = CornerUpdate(camera, GATES, free=True), START.x
    P = np.diag([1e-6] * MOVING + [known**2, known**2, 1e-6] * 2)
    state = FilterState(Nominal(0.0, x[0:3], x[3:6], x[6:10]), np.zeros(0), np.zeros((2, 3)), P)
    which = np.ones(len(corners), int)
    points = update._map[which, corners] + (0.1, 0.0, 0.0)
    pixels, _ = camera.in_view((points - x[0:3]) @ matrix(x[6:10]))
    after, innovation = update(state, Corners(0.0, which, np.array(corners), pixels, len(corners)))
    assert (innovation.used > 0) == moves
    assert (np.hypot(*after.gates[1, :2]) > 0.005) == moves
    assert not after.gates[0].any()


def test_a_late_measurement_counts_at_its_own_time():
    """Poses that arrive in another order than they were taken give the same estimate."""
    sensing = replace(load_sensing("mocap"), rotors=None)
    sensing = replace(sensing, pose=replace(sensing.pose, latency=0.06))
    sensors = Sensors(sensing, np.random.SeedSequence(3), SWIFT, GATES)
    for state in states(1.0):
        sensors.observe(state)
    measurements = sensors.arrived(2.0)
    inertial = [m for m in measurements if hasattr(m, "gyro")]
    poses = [m for m in measurements if hasattr(m, "attitude")][-8:]
    ends = []
    for order in (range(8), (1, 0, 3, 2, 6, 5, 4, 7)):
        estimator = begun(sensing)
        for one in [*inertial, *(poses[k] for k in order)]:
            estimator.take(one)
        ends.append(estimator)
    np.testing.assert_allclose(ends[0].at(1.0).position, ends[1].at(1.0).position, atol=1e-9)
    np.testing.assert_allclose(ends[0].covariance(1.0), ends[1].covariance(1.0), atol=1e-12)


@pytest.mark.slow
def test_spikes_and_false_corners_do_not_move_the_estimate():
    spiky = PoseConfig(rate=100, position_noise=0.01, attitude_noise_deg=0.5, spikes=0.1, spike=2.0)
    rows, _ = flown(replace(VIO, pose=spiky, camera=None), 2)
    errors = np.linalg.norm(
        rows[:, 0:3] - [circle(0.01 * (k + 1)).x.position for k in range(len(rows))], axis=1
    )
    assert errors.max() < 0.1
    assert column(rows, "refused").sum() > 0
    many = replace(GATES_ONLY, camera=replace(GATES_ONLY.camera, outliers=0.2, swaps=0.1))
    rows, _ = flown(many, 2)
    errors = np.linalg.norm(
        rows[:, 0:3] - [circle(0.01 * (k + 1)).x.position for k in range(len(rows))], axis=1
    )
    assert errors.max() < 0.3


def test_a_barometer_holds_the_height_alone_and_its_wash_lowers_it():
    """Beside poses whose position drifts."""
    drifting = replace(VIO, camera=None, pose=replace(VIO.pose, drift=0.3, velocity_noise=None))
    errors = {}
    for name, heights in {
        "none": None,
        "true": BarometerConfig(rate=50, noise=0.1),
        "washed": BarometerConfig(rate=50, noise=0.1, wash=0.3),
        "far off": BarometerConfig(rate=50, noise=0.1, wash=3.0),
    }.items():
        rows, _ = flown(replace(drifting, barometer=heights), 4)
        true = [circle(0.01 * (k + 1)).x.position for k in range(len(rows))]
        errors[name] = rows[:, 0:3] - true
    drifted = errors["none"][:, 2]
    assert np.abs(drifted).max() > 2.0 * np.abs(errors["true"][:, 2]).max()
    np.testing.assert_allclose(errors["true"][:, :2], errors["none"][:, :2], atol=0.02)
    # The error of a wash that passes the innovation gate is taken for a drift of the poses.
    assert errors["washed"][-1, 2] == pytest.approx(-0.3, abs=0.1)
    np.testing.assert_allclose(errors["far off"], errors["none"], atol=1e-12)


@pytest.mark.slow
def test_gates_off_the_map_are_found():
    moves = ((0.12, -0.1), (-0.09, 0.14))
    true = tuple(
        replace(g, position=(g.position[0] + dx, g.position[1] + dy, g.position[2]))
        for g, (dx, dy) in zip(GATES, moves, strict=True)
    )
    known = replace(VIO, pose=replace(VIO.pose, drift=0.0))
    _, estimator = flown(known, 4, true_gates=true, displaced=0.15)
    np.testing.assert_allclose(estimator.state.gates[:, :2], moves, atol=0.03)
    _, fixed = flown(known, 4, true_gates=true)
    assert len(fixed.state.gates) == 0


def test_a_dead_sensor_leaves_a_finite_estimate():
    """Without poses the position runs away, as far as the covariance says, and never to nan."""
    dead = replace(VIO, camera=None, pose=replace(VIO.pose, dies_at=1.0))
    rows, estimator = flown(dead, 5)
    assert np.isfinite(rows).all()
    assert column(rows, "cov_xx")[-1] > 10 * column(rows, "cov_xx")[80]
    assert np.linalg.norm(np.array(estimator.at(4.0).position) - circle(4.0).x.position) < 5.0
    assert abs(np.degrees(between(estimator.at(4.0).attitude, circle(4.0).x.attitude))).max() < 5.0
