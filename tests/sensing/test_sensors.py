"""Every sensor's law: what it says of a known flight, how far off, how often and when."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from quadsim.course import Gate
from quadsim.course.obstacles import Cylinder
from quadsim.dynamics.quadrotor import State
from quadsim.physics.plant_state import PlantState
from quadsim.rotation import between, matrix, turned
from quadsim.sensing.barometer import Barometer
from quadsim.sensing.config import (
    BarometerConfig,
    GateCameraConfig,
    ImuConfig,
    PixelCameraConfig,
    PoseConfig,
    RotorConfig,
)
from quadsim.sensing.gate_camera import GateCamera
from quadsim.sensing.imu import Imu
from quadsim.sensing.pixel_camera import PixelCamera
from quadsim.sensing.pose import PoseSensor
from quadsim.sensing.rotor_speeds import RotorSpeeds
from quadsim.sensing.timing import Ticks
from quadsim.vehicle import GRAVITY, load_vehicle
from tests.sensing.truth_cases import GATES, circle, states

SEED = np.random.SeedSequence(7)
LONG = states(8.0)


def at_rest(position):
    """Return the state of a level vehicle that stands still, its rotors too."""
    return State(*position, *(0.0,) * 3, *(1.0, 0.0, 0.0, 0.0), *(0.0,) * 7)


def measured(sensor, flight=LONG):
    return [m for m in map(sensor.sample, flight) if m is not None]


def test_an_instant_is_sampled_once_at_the_step_at_or_after_it():
    ticks = Ticks(250.0)
    assert [k * 0.0025 for k in range(9) if ticks.due(k * 0.0025)] == pytest.approx(
        [0.0, 0.005, 0.01, 0.0125, 0.0175, 0.02]
    )


def test_a_unit_without_noise_gives_back_the_flight():
    """Its samples, integrated, lead from the first state to the last: by the estimator's own
    nominal state."""
    from quadsim.sensing.nominal import Nominal

    first, last = LONG[0], LONG[-1]
    nominal = Nominal(first.t, first.x.position, first.x.velocity, first.x.attitude)
    for sample in measured(Imu(ImuConfig(rate=250), SEED)):
        nominal = nominal.moved(sample, sample.t)
    np.testing.assert_allclose(nominal.position, last.x.position, atol=2e-3)
    np.testing.assert_allclose(nominal.velocity, last.x.velocity, atol=1e-3)
    np.testing.assert_allclose(between(nominal.attitude, last.x.attitude), 0.0, atol=1e-6)


def test_a_units_noise_bias_and_saturation():
    config = ImuConfig(
        rate=400, gyro_noise=0.02, accelerometer_noise=0.3, gyro_bias=0.1, accelerometer_bias=0.5
    )
    level = at_rest(circle(0.0).x.position)
    rest = [PlantState(k / 400, level, ()) for k in range(4001)]
    unit = Imu(config, SEED)
    samples = np.array([(*m.gyro, *m.specific_force) for m in measured(unit, rest)])
    assert len(samples) == 4000
    np.testing.assert_allclose(samples.std(axis=0), [0.02] * 3 + [0.3] * 3, rtol=0.06)
    np.testing.assert_allclose(
        samples.mean(axis=0), unit.bias + np.array([0, 0, 0, 0, 0, GRAVITY]), atol=0.02
    )
    assert abs(unit.bias).max() > 0.05  # the bias is there
    most = measured(Imu(replace(config, accelerometer_max=5.0), SEED), rest)
    assert max(m.specific_force[2] for m in most) == 5.0


def tumbling(steps):
    """Return the states of a vehicle that turns and accelerates in all directions."""
    rng = np.random.default_rng(1)
    q, found = (1.0, 0.0, 0.0, 0.0), []
    for k in range(steps):
        q = turned(q, 0.02 * rng.standard_normal(3))
        v = 0.05 * rng.standard_normal(3)
        found.append(PlantState(k / 400, State(0.0, 0.0, 0.0, *v, *q, *(0.0,) * 7), ()))
    return found


def rows(config, seed=SEED, steps=12):
    """Return the samples of a unit in a tumble: three rates, then three forces, in each row."""
    unit = Imu(config, seed)
    return np.array([(*m.gyro, *m.specific_force) for m in measured(unit, tumbling(steps))])


SKEWED = ImuConfig(
    rate=400,
    gyro_scale=0.02,
    gyro_misalignment_deg=1.0,
    accelerometer_scale=0.05,
    accelerometer_misalignment_deg=3.0,
    gyro_max=1000.0,
    accelerometer_max=1e4,
)


def test_a_units_scale_factors_and_misalignment():
    """Each unit multiplies rates and forces by a matrix of its own, of these spreads."""
    exact = rows(ImuConfig(rate=400, gyro_max=1000.0, accelerometer_max=1e4))
    found = []
    for seed in range(200):
        skewed = rows(SKEWED, np.random.SeedSequence(seed))
        matrix, residuals, _, _ = np.linalg.lstsq(exact, skewed, rcond=None)
        assert residuals.max() < 1e-12
        found.append(matrix.T - np.eye(6))
    found = np.array(found)
    np.testing.assert_allclose(found[:, :3, 3:], 0.0, atol=1e-9)
    np.testing.assert_allclose(found[:, 3:, :3], 0.0, atol=1e-9)
    diagonal, beside = np.eye(3, dtype=bool), ~np.eye(3, dtype=bool)
    for part, scale, angle in ((slice(0, 3), 0.02, 1.0), (slice(3, 6), 0.05, 3.0)):
        block = found[:, part, part]
        assert block[:, diagonal].std() == pytest.approx(scale, rel=0.1)
        assert np.degrees(block[:, beside].std()) == pytest.approx(angle, rel=0.1)
        assert abs(block.mean()) < 0.2 * scale


def test_scale_and_misalignment_change_no_noise():
    """Without them a unit measures what it always has."""
    noise = {"gyro_noise": 0.02, "gyro_bias": 0.1, "accelerometer_noise": 0.3}
    plain = ImuConfig(rate=400, gyro_max=1000.0, accelerometer_max=1e4)
    differences = [rows(replace(one, **noise)) - rows(one) for one in (plain, SKEWED)]
    np.testing.assert_allclose(*differences, atol=1e-9)
    assert abs(differences[0]).min() > 0.0


@pytest.mark.slow
def test_a_biased_unit_walks():
    ends = []
    for seed in range(40):
        unit = Imu(ImuConfig(rate=50, gyro_walk=0.1), np.random.SeedSequence(seed))
        measured(unit, LONG[::8])
        ends.append(unit.bias[:3])
    assert np.std(ends) == pytest.approx(0.1 * np.sqrt(8.0), rel=0.2)


@pytest.mark.slow
def test_a_poses_noise_drift_spikes_and_dropouts():
    noisy = measured(
        PoseSensor(
            PoseConfig(rate=400, position_noise=0.02, attitude_noise_deg=1.0, velocity_noise=0.1),
            SEED,
        )
    )
    truth = {s.t: s.x for s in LONG}
    off = np.array([np.subtract((*m.position, *m.velocity), truth[m.t][:6]) for m in noisy])
    turns = np.array([between(truth[m.t][6:10], m.attitude) for m in noisy])
    np.testing.assert_allclose(off.std(axis=0), [0.02] * 3 + [0.1] * 3, rtol=0.06)
    np.testing.assert_allclose(np.degrees(turns.std(axis=0)), 1.0, rtol=0.06)
    ends = []
    for seed in range(60):
        sensor = PoseSensor(PoseConfig(rate=20, drift=0.1), np.random.SeedSequence(seed))
        measured(sensor, LONG[::20])
        ends.append(sensor.drift)
    assert np.std(ends) == pytest.approx(0.1 * np.sqrt(8.0), rel=0.2)
    spikes = measured(PoseSensor(PoseConfig(rate=400, spikes=0.05, spike=3.0), SEED))
    far = [np.linalg.norm(np.subtract(m.position, truth[m.t][:3])) > 1.0 for m in spikes]
    assert np.mean(far) == pytest.approx(0.05, abs=0.012)
    times = [
        m.t for m in measured(PoseSensor(PoseConfig(rate=400, dropouts=0.002, dropout=0.2), SEED))
    ]
    assert 0.2 <= np.diff(times).max() < 0.8
    dead = measured(PoseSensor(PoseConfig(rate=400, dies_at=3.0), SEED))
    assert max(m.t for m in dead) < 3.0


def test_a_dropout_changes_no_later_noise():
    """The stream of a sensor gives every sample the same numbers, whether it is silent or not."""
    noisy = PoseConfig(rate=100, position_noise=0.02)
    whole = {m.t: m for m in measured(PoseSensor(noisy, SEED))}
    gaps = measured(PoseSensor(replace(noisy, dropouts=0.01, dropout=0.1), SEED))
    assert 0 < len(gaps) < len(whole)
    assert all(m == whole[m.t] for m in gaps)


def test_rotor_speeds_say_the_thrust():
    swift, true = load_vehicle("swift"), LONG[0].x.thrust
    exact = measured(RotorSpeeds(RotorConfig(rate=100), SEED, swift))
    assert [m.thrust for m in exact] == pytest.approx([true] * len(exact))
    off = [
        m.thrust - true
        for m in measured(RotorSpeeds(RotorConfig(rate=400, noise=10.0), SEED, swift))
    ]
    speed = swift.rotors.speed(0.25 * swift.mass * true)
    assert np.std(off) == pytest.approx(
        2 * 10.0 * 2 * swift.rotors.thrust_map[0] * speed / swift.mass, rel=0.06
    )


def test_a_barometer_reads_low_by_its_wash_in_proportion_to_the_thrust():
    true = LONG[0].x
    exact = measured(Barometer(BarometerConfig(rate=50), SEED))
    assert len(exact) == 401
    assert [m.height for m in exact] == pytest.approx([true.pz] * 401)
    washed = measured(Barometer(BarometerConfig(rate=400, noise=0.1, wash=2.0), SEED))
    low = [true.pz - m.height for m in washed]
    # The circle takes more thrust than a hover.
    assert true.thrust > 1.02 * GRAVITY
    expected = 2.0 * true.thrust / GRAVITY
    assert np.mean(low) == pytest.approx(expected, abs=4 * 0.1 / np.sqrt(len(low)))
    assert np.std(low) == pytest.approx(0.1, rel=0.06)


CAMERA = GateCameraConfig(640, 360, 320.0, 320.0, 20.0, noise=0.0)
AXIS = CAMERA.axes[:, 2]


def test_a_point_on_the_optical_axis_is_in_the_middle():
    far = 3.0 * np.array([AXIS, np.add(AXIS, (0.0, 0.2, 0.0))])
    pixels, seen = CAMERA.in_view(far)
    # what is to the left is left
    np.testing.assert_allclose(pixels, [(320, 180), (320 - 320 * 0.2, 180)])
    assert seen.all()
    assert not CAMERA.in_view(-far)[1].any()


def test_a_camera_without_noise_finds_every_corner_where_it_is():
    camera = GateCamera(CAMERA, SEED, GATES)
    for picture in measured(camera, LONG[:400]):
        x = circle(picture.t).x
        assert len(picture.pixels) == picture.in_view > 0
        for gate, corner, pixel in zip(picture.gates, picture.corners, picture.pixels, strict=True):
            body = (GATES[gate].corners()[corner] - x.position) @ matrix(x.attitude)
            np.testing.assert_allclose(pixel, CAMERA.in_view(body[None])[0][0], atol=1e-9)


def test_a_frame_hides_the_corners_behind_it():
    here = PlantState(0.0, at_rest((0.0, 0.0, 2.0)), ())
    behind = Gate((6.0, 0.0, 2.0), 0.0, 0.0, 0.0, (1.5, 1.5), 0.275)
    wall = Gate((3.0, 0.0, 2.0), 0.0, 0.0, 0.0, (0.2, 0.2), 0.5)  # its bars fill what lies between
    alone = GateCamera(replace(CAMERA, tilt_deg=0.0), SEED, [behind]).sample(here)
    hidden = GateCamera(replace(CAMERA, tilt_deg=0.0), SEED, [behind, wall]).sample(here)
    assert alone.in_view == 4
    assert sorted(hidden.gates) == [1, 1, 1, 1]
    post = Cylinder((3.0, 0.6, 0.0), 0.3, 4.0)  # before the left half of the opening
    left = GateCamera(replace(CAMERA, tilt_deg=0.0), SEED, [behind], [post]).sample(here)
    assert left.in_view == 2


@pytest.mark.slow
def test_misses_outliers_and_false_associations_come_as_often_as_configured():
    config = replace(CAMERA, rate=400.0, misses=0.1, outliers=0.05, swaps=0.03)
    pictures = measured(GateCamera(config, SEED, GATES))
    seen, found = sum(p.in_view for p in pictures), sum(len(p.pixels) for p in pictures)
    wrong = 0
    for picture in pictures:
        x = circle(picture.t).x
        corners = np.array(
            [GATES[g].corners()[c] for g, c in zip(picture.gates, picture.corners, strict=True)]
        )
        pixels, _ = config.in_view((corners - x[0:3]) @ matrix(x[6:10]))
        wrong += int((abs(pixels - picture.pixels).max(axis=1) > 1e-6).sum())
    assert found / seen == pytest.approx(0.9, abs=0.01)
    # one swap in eight is with itself
    assert wrong / found == pytest.approx(0.05 + 0.03 * 7 / 8, abs=0.01)


def test_a_cameras_dropouts_lose_pictures_in_bursts_and_change_no_later_corner():
    whole = GateCameraConfig(width=640, height=360, fx=320, fy=320, rate=50, noise=2.0, misses=0.1)
    kept = {m.t: m for m in measured(GateCamera(whole, SEED, GATES))}
    bursts = replace(whole, dropouts=0.03, dropout=0.3)
    found = {m.t: m for m in measured(GateCamera(bursts, SEED, GATES))}
    gaps = np.diff([t for t in found if t > 0.0])
    assert gaps.max() >= 0.3
    assert 0.2 < 1.0 - len(found) / len(kept) < 0.8
    for t, corners in found.items():
        assert np.array_equal(corners.pixels, kept[t].pixels)


def test_a_pixel_cameras_dropouts_lose_pictures_in_bursts_and_change_no_other():
    whole = PixelCameraConfig(8, 8, 8.0, 8.0, rate=50.0)
    bursts = replace(whole, dropouts=0.03, dropout=0.3)
    kept, found = (
        {m.t: m.rgb for m in measured(PixelCamera(config, lambda eyes, axes: eyes, SEED))}
        for config in (whole, bursts)
    )
    assert np.diff([t for t in found if t > 0.0]).max() >= 0.3
    assert 0.2 < 1.0 - len(found) / len(kept) < 0.8
    assert all(np.array_equal(rgb, kept[t]) for t, rgb in found.items())


@pytest.mark.slow
def test_corners_are_missed_in_bursts_as_long_and_as_often_as_configured():
    config = replace(CAMERA, rate=400.0, misses=0.13, miss_burst=5.26)
    pictures = measured(GateCamera(config, SEED, GATES))
    seen, found = sum(p.in_view for p in pictures), sum(len(p.pixels) for p in pictures)
    assert found / seen == pytest.approx(0.87, abs=0.02)
    # Of the corners found in one picture, a share is missed in the next: 1 / 5.26 of 0.13 / 0.87.
    kept = 0
    lost = 0
    for before, after in pairwise(pictures):
        if before.in_view != after.in_view:
            continue
        first, second = (
            set(zip(p.gates.tolist(), p.corners.tolist(), strict=True)) for p in (before, after)
        )
        lost += len(first - second)
        kept += len(first & second)
    assert lost / (lost + kept) == pytest.approx(0.13 / 0.87 / 5.26, rel=0.15)


def test_bursts_of_misses_change_no_corner_that_is_found():
    plain = measured(GateCamera(replace(CAMERA, noise=2.0), SEED, GATES))
    bursts = measured(GateCamera(replace(CAMERA, noise=2.0, misses=0.3, miss_burst=3), SEED, GATES))
    assert sum(len(p.pixels) for p in bursts) < sum(len(p.pixels) for p in plain)
    for one, other in zip(plain, bursts, strict=True):
        assert {tuple(row) for row in other.pixels} <= {tuple(row) for row in one.pixels}


def test_a_blind_camera_finds_no_corner_nearer_than_it_sees():
    nearest = min(
        np.linalg.norm(GATES[g].corners()[c] - circle(p.t).x[0:3])
        for p in measured(GateCamera(replace(CAMERA, blind_within=5.0), SEED, GATES))
        for g, c in zip(p.gates, p.corners, strict=True)
    )
    assert 5.0 <= nearest < 6.0


def test_a_vibration_is_seen_as_a_slow_force_at_a_low_rate():
    """130 Hz, sampled 32 times a second, are 2 Hz; sampled 400 times, they are themselves."""
    rest = [PlantState(k / 400, at_rest((0.0, 0.0, 1.0)), ()) for k in range(1601)]
    for rate, seen in ((32.0, 2.0), (400.0, 130.0)):
        config = ImuConfig(rate=rate, vibration=3.0, vibration_hz=130.0)
        samples = measured(Imu(config, SEED), rest)
        force = np.array([sample.specific_force[0] for sample in samples])
        assert abs(force).max() == pytest.approx(3.0, rel=0.05)
        spectrum = abs(np.fft.rfft(force))
        frequency = np.fft.rfftfreq(len(force), 1.0 / rate)
        assert frequency[spectrum.argmax()] == pytest.approx(seen, abs=0.5)
