"""Raw measurements and the estimate beside the pose, which a flight keeps on request."""

import numpy as np
import pytest

import quadsim
from quadsim.config.spec import Spec
from quadsim.record.run import RunError
from quadsim.record.run_format import read_npz, write_npz
from quadsim.sensing.sensors import WARM_UP

FLIGHT = {"laps": 1, "timeout": 0.5, "displace_gates": 0.2}


class Climb:
    def control(self, x):
        return 0.2, 0.0, 0.0, 9.81 + 4.0 * (2.5 - x[2]) - 3.0 * x[5]


def flown(**settings):
    return quadsim.fly("figure8", controller=Climb(), **FLIGHT | settings)


@pytest.fixture(scope="module")
def lab():
    """A flight with every kind of sensor, whose sensing is kept."""
    return flown(sensing="lab", record_sensing=True)


def test_what_is_kept_changes_no_flight(lab):
    plain = flown(sensing="lab")
    assert plain.measurements is None
    assert plain.digest() == lab.digest()


def test_every_measurement_is_kept_with_its_instant_and_its_arrival(lab):
    kept = lab.measurements
    sensing = Spec.of_record(lab.spec, controller=Climb()).sensing
    for name in ("imu", "pose", "rotors"):
        sensor = getattr(sensing, name)
        expected = (WARM_UP + lab.duration - sensor.latency) * sensor.rate
        assert len(kept[f"{name}.t"]) == pytest.approx(expected, abs=2), name
        period = 1.0 / 100.0 + 1.0 / 400.0
        late = kept[f"{name}.taken"] - kept[f"{name}.t"]
        in_flight = kept[f"{name}.t"] > 0.0
        assert late[in_flight].min() >= sensor.latency - 1e-9
        assert late[in_flight].max() <= sensor.latency + period
    assert kept["corners.pixels"].shape == (len(kept["corners.t"]), 2)
    assert set(kept["corners.corner"]) <= {0, 1, 2, 3}


def test_measurements_are_the_truth_and_noise(lab):
    kept, x = lab.measurements, lab.telemetry
    noise = Spec.of_record(lab.spec, controller=Climb()).sensing
    roll = np.interp(kept["imu.t"], x["t"], x["wx"])
    flying = kept["imu.t"] > 0.0
    off = (kept["imu.gyro"][:, 0] - roll)[flying]
    assert 0.5 * noise.imu.gyro_noise < off.std() < 2.0 * noise.imu.gyro_noise
    height = np.interp(kept["pose.t"], x["t"], x["pz"])
    off = (kept["pose.position"][:, 2] - height)[kept["pose.t"] > 0.0]
    assert off.std() == pytest.approx(noise.pose.position_noise, rel=0.5)


def test_the_estimated_gates_stand_beside_the_true_ones(lab):
    spec = Spec.of_record(lab.spec, controller=Climb())
    mapped, true = (
        np.array([gate.position for gate in course.gates])
        for course in (spec.course, spec.flown_course)
    )
    estimated = lab.measurements["estimate.gates"]
    assert estimated.shape == (len(lab.telemetry["t"]), *mapped.shape)
    # Gates that the camera has seen are better known than the map has them.
    seen = sorted(set(lab.measurements["corners.gate"]))
    moved = np.linalg.norm(estimated[-1] - mapped, axis=1)
    assert (moved > 0.01).any()
    first = np.linalg.norm((estimated[-1] - true)[seen[0]])
    assert first < np.linalg.norm((mapped - true)[seen[0]])


def test_what_is_kept_is_stored_and_read(lab, tmp_path):
    again = quadsim.load_run(lab.save(tmp_path))
    assert again.measurements.keys() == lab.measurements.keys()
    for name, array in lab.measurements.items():
        np.testing.assert_array_equal(again.measurements[name], array)
    assert again.digest() == lab.digest()


def test_arrays_that_do_not_fit_are_refused(lab):
    for name, array in (
        ("imu.gyro", np.zeros((3, 2))),
        ("imu.t", np.zeros(3)),
        ("estimate.gyro_bias", np.zeros((1, 3))),
        ("corners.gate", np.zeros(2)),
    ):
        damaged = quadsim.Run.of(lab)
        object.__setattr__(damaged, "measurements", lab.measurements | {name: array})
        with pytest.raises(RunError, match=name.partition(".")[0]):
            read_npz(write_npz(damaged), lab.spec, "run")


def test_in_a_race_each_run_keeps_its_own():
    line_up = {
        name: {"controller": Climb(), "sensing": sensing, "record_sensing": sensing == "mocap"}
        for name, sensing in (("a", "mocap"), ("b", "vio"))
    }
    heat = quadsim.race(line_up, "figure8", laps=1, timeout=0.1)
    assert heat["a"].measurements["pose.t"].size
    assert heat["b"].measurements is None


def test_without_sensors_nothing_can_be_kept():
    with pytest.raises(
        quadsim.SettingError, match="record_sensing: expected a sensing with sensors"
    ):
        quadsim.Spec.of("figure8", record_sensing=True)
