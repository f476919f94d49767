"""Faults of sensors: what is frozen repeats, what is lost is missing, and nothing else changes."""

from dataclasses import replace

import numpy as np
import pytest

from quadsim.physics.faults import parse_fault
from quadsim.physics.plant_state import PlantState
from quadsim.sensing import load_sensing
from quadsim.sensing.measurements import Corners, Inertial, Photo, Pose, RotorThrust
from quadsim.sensing.sensors import Sensors
from quadsim.vehicle import load_vehicle
from tests.sensing.truth_cases import GATES, states

SWIFT = load_vehicle("swift")
PIXELS = load_sensing("pixels").pixels
SENSING = replace(load_sensing("lab"), name="test", pixels=PIXELS)
KINDS = {"imu": Inertial, "rotors": RotorThrust, "pose": Pose, "camera": Corners, "pixels": Photo}
FLIGHT = states(3.0)


def eye(eyes, axes):
    """Return where the camera was, in place of a picture."""
    return eyes


def measured(*faults):
    """Return the measurements of a flight of 3 s by kind, after the warm-up at rest."""
    given = [parse_fault(text) for text in faults]
    seeds = np.random.SeedSequence(5)
    sensors = Sensors(SENSING, seeds, SWIFT, GATES, faults=given, eye=eye)
    sensors.warm_up(FLIGHT[0], 1 / 400)
    for state in FLIGHT:
        sensors.observe(state)
    found = sensors.arrived(99.0)
    return {key: [m for m in found if isinstance(m, kind)] for key, kind in KINDS.items()}


SOUND = measured()


def numbers(measurement):
    """Return all numbers of a measurement but its instant, as bytes that can be compared."""
    match measurement:
        case Inertial():
            values = (*measurement.gyro, *measurement.specific_force)
        case RotorThrust():
            values = (measurement.thrust,)
        case Pose():
            values = (*measurement.position, *measurement.attitude, *(measurement.velocity or ()))
        case Corners():
            values = (*measurement.gates, *measurement.corners, *measurement.pixels.ravel())
        case Photo():
            values = measurement.rgb.ravel()
    return np.array(values, float).tobytes()


def assert_same(these, those):
    """Claim that measurements are the same to the last bit."""
    assert [m.t for m in these] == [m.t for m in those]
    assert list(map(numbers, these)) == list(map(numbers, those))


def split(measurements):
    """Return the measurements before 1 s, from 1 to 2 s, and from 2 s on."""
    early = [m for m in measurements if m.t < 1.0 - 1e-9]
    late = [m for m in measurements if m.t >= 2.0 - 1e-9]
    between = [m for m in measurements if 1.0 - 1e-9 <= m.t < 2.0 - 1e-9]
    return early, between, late


@pytest.mark.slow
@pytest.mark.parametrize("sensor", KINDS)
def test_a_lost_sensor_is_silent_for_as_long_as_it_is_lost_and_all_else_stays(sensor):
    found = measured(f"{sensor}=lost@1-2")
    early, between, late = split(SOUND[sensor])
    assert between, "the sensor measures there without the fault"
    assert_same(found[sensor], early + late)
    for other in KINDS.keys() - {sensor}:
        assert_same(found[other], SOUND[other])


@pytest.mark.parametrize("sensor", KINDS)
def test_a_frozen_sensor_repeats_its_last_values_at_its_own_instants(sensor):
    found = measured(f"{sensor}=frozen@1-2")
    early, between, late = split(SOUND[sensor])
    found_early, found_between, found_late = split(found[sensor])
    assert_same(found_early, early)
    assert_same(found_late, late)
    assert [m.t for m in found_between] == [m.t for m in between]
    assert {numbers(m) for m in found_between} == {numbers(early[-1])}
    assert {numbers(m) for m in between} != {numbers(early[-1])}


def test_a_part_of_a_unit_freezes_alone():
    for part, other in (("gyro", "specific_force"), ("specific_force", "gyro")):
        name = "accelerometer" if part == "specific_force" else part
        _, found, _ = split(measured(f"{name}=frozen@1-2")["imu"])
        early, sound, _ = split(SOUND["imu"])
        assert {getattr(m, part) for m in found} == {getattr(early[-1], part)}
        assert [getattr(m, other) for m in found] == [getattr(m, other) for m in sound]


@pytest.mark.parametrize(("name", "part"), [("gyro", "gyro"), ("accelerometer", "specific_force")])
def test_a_bias_is_added_along_its_axes_while_the_fault_lasts(name, part):
    found = measured(f"{name}=.1:0:-.2@1-2")["imu"]
    off = np.array([getattr(m, part) for m in found])
    off -= [getattr(m, part) for m in SOUND["imu"]]
    t = np.array([m.t for m in found])
    during = (t > 1.0 - 1e-9) & (t < 2.0 - 1e-9)
    np.testing.assert_allclose(off[during], [[0.1, 0.0, -0.2]] * sum(during), atol=1e-12)
    np.testing.assert_allclose(off[~during], 0.0, atol=1e-12)
    assert (off[t < 1.0 - 1e-9] == 0.0).all()


def test_two_jumps_add_up_and_a_jump_saturates_with_the_unit():
    twice = measured("gyro=.1:0:0@1", "gyro=.2:0:0@1")["imu"][-1].gyro
    once = measured("gyro=.3:0:0@1")["imu"][-1].gyro
    assert twice == pytest.approx(once, abs=1e-12)
    assert SENSING.imu is not None
    assert measured("gyro=100:0:0@1")["imu"][-1].gyro[0] == SENSING.imu.gyro_max


def test_nothing_fails_before_the_flight():
    """Sensors run for half a second at rest, and a fault from the start on begins after that."""
    found = measured("imu=lost@0", "pose=frozen@0")
    assert max(m.t for m in found["imu"]) < 0.0
    before = [m for m in SOUND["pose"] if m.t < 0.0]
    assert len(before) > 10
    assert_same(found["pose"][: len(before)], before)
    assert {numbers(m) for m in found["pose"][len(before) :]} == {numbers(before[-1])}


def test_a_sensor_that_has_measured_nothing_yet_has_nothing_to_repeat():
    given = [parse_fault("pose=frozen@0")]
    sensors = Sensors(SENSING, np.random.SeedSequence(5), SWIFT, GATES, faults=given, eye=eye)
    sensors.observe(PlantState(0.0, FLIGHT[0].x, ()))
    assert not any(isinstance(m, Pose) for m in sensors.arrived(9.0))
