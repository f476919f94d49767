"""The firmware's own log: pilots' tools read it, and it shows what was flown."""

import numpy as np
import pytest

import quadsim
from quadsim.firmware.actuators import READY
from tests.small import SMALL

orangebox = pytest.importorskip("orangebox", reason="the extra betaflight is not installed")

FLIGHT = {**SMALL, "flight_controller": "betaflight", "plant": "rigid", "timeout": 1.0}
DT = 1e-3
AXES = (0, 1, 2)
COLUMNS = ("time", *(f"{name}[{axis}]" for name in ("gyroADC", "setpoint") for axis in AXES))


@pytest.fixture(scope="module")
def logged(built, tmp_path_factory):
    """Return a flight, and the columns of its log that this test reads, by name."""
    file = tmp_path_factory.mktemp("log") / "flight.bbl"
    run = quadsim.fly("split_s_swift", **FLIGHT, blackbox=file)
    log = orangebox.Parser.load(str(file))
    columns = {name: log.field_names.index(name) for name in COLUMNS}
    frames = [frame.data for frame in log.frames()]
    return run, {
        name: np.array([frame[column] for frame in frames], float)
        for name, column in columns.items()
    }


def at_control_steps(run, log, column, start):
    """Return a column of the log at the times of the telemetry, for a flight that starts then."""
    return np.interp(run.telemetry["t"] + start, 1e-6 * log["time"], log[column])


def test_gyro_and_setpoint_are_those_of_the_telemetry(logged):
    run, log = logged
    rates = np.rad2deg([run.telemetry[name] for name in ("wx", "wy", "wz")])

    # The log begins when the firmware is armed, some time before the flight.
    starts = 1e-6 * log["time"][0] + np.arange(0.0, READY, DT)

    def error(start):
        gyro = [at_control_steps(run, log, f"gyroADC[{axis}]", start) for axis in AXES]
        return np.std(gyro - rates)

    start = min(starts, key=error)
    assert error(start) < 0.05 * np.std(rates)
    # A flight that starts at another time is another one.
    assert error(start + 0.1) > 0.3 * np.std(rates)

    # So has each axis of its own; another one's is not near.
    for axis in AXES:
        gyro = at_control_steps(run, log, f"gyroADC[{axis}]", start)
        errors = [np.std(gyro - rate) for rate in rates]
        assert np.argmin(errors) == axis
        # The log has whole degrees per second.
        assert errors[axis] < 0.1 * np.std(rates[axis]) + 12**-0.5

    # The setpoint reaches each command at the end of its control period.
    for axis, name in enumerate(("wx_cmd", "wy_cmd", "wz_cmd")):
        asked = np.rad2deg(run.telemetry[name])
        setpoint = at_control_steps(run, log, f"setpoint[{axis}]", start + 0.009)
        assert np.std(setpoint - asked) < 0.15 * np.std(asked)


def test_a_flight_is_the_same_with_and_without_its_log(logged):
    run, _ = logged
    assert quadsim.fly("split_s_swift", **FLIGHT).digest() == run.digest()
