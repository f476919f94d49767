"""Sensings changed in Python and written as YAML: checked as files are, and read back equal."""

from dataclasses import fields

import pytest

from quadsim.files.values import SettingError
from quadsim.sensing import load_sensing, parse_sensing, sensing_names
from quadsim.sensing.config import ImuConfig, PoseConfig
from quadsim.sensing.sensing_file import SENSORS, SensingChanges, SensingFile

MOCAP = load_sensing("mocap")


@pytest.mark.parametrize("name", sensing_names())
def test_a_sensing_written_as_yaml_reads_back_equal(name, tmp_path):
    sensing = load_sensing(name)
    file = tmp_path / f"{name}.yaml"
    assert parse_sensing(sensing.to_yaml(file), f"{name}.yaml") == sensing
    assert load_sensing(file) == sensing
    assert sensing.but() == sensing


EYE = {"width": 640, "height": 360, "fx": 320, "fy": 320}


def test_a_sensor_is_changed_replaced_added_or_taken_away():
    slow = MOCAP.but(name="slow", pose={"rate": 25, "dies_at": 3}, rotors=None)
    assert (slow.name, slow.rotors, slow.imu) == ("slow", None, MOCAP.imu)
    assert (slow.pose.rate, slow.pose.dies_at) == (25.0, 3.0)
    assert slow.pose.position_noise == MOCAP.pose.position_noise
    assert slow.but(pose={"dies_at": None}).pose.dies_at is None
    assert MOCAP.but(imu=ImuConfig(rate=500)).imu == ImuConfig(rate=500.0)
    seen = load_sensing("perfect").but(imu={"rate": 250}, pose=PoseConfig(rate=50))
    assert [key for key in SENSORS if getattr(seen, key)] == ["imu", "pose"]
    assert parse_sensing(seen.to_yaml(), "perfect.yaml") == seen


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"pose": {"dropout": 0.1}}, r"pose\.dropout: expected dropouts beside it"),
        ({"pose": {"dropouts": 0.1}}, r"pose\.dropout: expected how long"),
        ({"pose": {"spike": 0.1}}, r"pose\.spike: expected spikes beside it"),
        ({"pose": {"attitude_noise": 1}}, r".* did you mean 'attitude_noise_deg' \(in degrees\)\?"),
        ({"pose": {"rate": 0}}, r"pose\.rate: expected a number \[Hz\] >= 1"),
        ({"pose": None}, "imu: expected a pose or a camera"),
        ({"imu": None}, "imu: missing"),
        ({"imu": 3}, "imu: expected a mapping"),
        ({"camera": {"width": 640}}, r"camera\.height: missing"),
        ({"camera": EYE | {"blind_within": 20}}, r"camera\.blind_within: expected less than"),
        ({"camera": EYE | {"miss_burst": 3}}, r"camera\.miss_burst: expected misses beside it"),
        ({"camera": EYE | {"miss_burst": 3, "misses": 0.9}}, r"camera\.miss_burst: expected at"),
        ({"exact": True}, "imu: expected no sensor beside exact"),
        ({"poses": {}}, "poses: unknown key, did you mean 'pose'"),
    ],
)
def test_a_change_that_cannot_be_used_is_one_line_with_its_key(changes, problem):
    with pytest.raises(SettingError, match=f"^{problem}") as caught:
        MOCAP.but(**changes)
    assert "\n" not in str(caught.value)


def test_the_keywords_of_a_change_are_the_keys_of_a_file():
    assert SensingChanges.__optional_keys__ == {"name", *(f.name for f in fields(SensingFile))}
