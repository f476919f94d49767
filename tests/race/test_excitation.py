"""A flight of manoeuvres: it stays in its box, and shows every number of a vehicle."""

import numpy as np
import pytest

import quadsim
from quadsim.controllers.excitation import ENDS, MANOEUVRES
from quadsim.logs.read import read_logs
from quadsim.vehicle import GRAVITY

FLIGHT = {"excite": True, "plant": "rigid"}
AXES = "xyz"


@pytest.fixture(scope="module")
def run():
    """Return a flight of manoeuvres on the true state, which takes a fifth of the time."""
    return quadsim.fly(**FLIGHT, vehicle="flightmare", sensing="perfect")


def during(run, name, axis):
    """Return which frames of a flight belong to a manoeuvre."""
    k = next(k for k, m in enumerate(MANOEUVRES) if (m.name, m.axis) == (name, axis))
    t = run.telemetry["t"]
    return (t >= ENDS[k] - MANOEUVRES[k].duration) & (t < ENDS[k])


def power_at(signal, frequency, dt):
    """Return the mean square of a signal within a fifth of a frequency [Hz]."""
    spectrum = np.fft.rfft(signal - np.mean(signal)) / len(signal)
    frequencies = np.fft.rfftfreq(len(signal), dt)
    return 2.0 * np.sum(np.abs(spectrum[np.abs(frequencies - frequency) < 0.2 * frequency]) ** 2)


@pytest.mark.regression
def test_the_flight_finishes_within_its_box_and_about_a_minute(run):
    assert run.outcome == "finished"
    assert 60.0 < run.duration < 70.0
    assert not [event for event in run.events if event.kind != "pass"]


@pytest.mark.regression
def test_each_chirp_turns_the_vehicle_about_its_axis_over_the_whole_band(run):
    dt = run.telemetry["t"][1]
    for axis in range(3):
        rows = during(run, "chirp", axis)
        rates = [run.telemetry[f"w{name}"][rows] for name in AXES]
        assert np.argmax(np.std(rates, axis=1)) == axis
        command = run.telemetry[f"w{AXES[axis]}_cmd"]
        for frequency in (0.6, 2.0, 5.0):
            asked = power_at(command[rows], frequency, dt)
            assert asked > 0.02
            # A dash along z has nothing of the kind.
            assert power_at(command[during(run, "dash", 2)], frequency, dt) < 0.2 * asked


@pytest.mark.regression
def test_dashes_are_fast_and_steps_span_the_thrust(run):
    for axis in range(3):
        speed = run.telemetry[f"v{AXES[axis]}"][during(run, "dash", axis)]
        assert np.ptp(speed) > 5.0
    thrust = run.telemetry["a"][during(run, "steps", 2)]
    assert np.percentile(thrust, 90) > 1.5 * GRAVITY
    assert np.percentile(thrust, 10) < 0.6 * GRAVITY


@pytest.mark.slow
def test_its_log_has_the_measurements_of_its_sensors(tmp_path):
    # The chirp about x has begun.
    run = quadsim.fly(**FLIGHT, timeout=4.0)
    (log,) = read_logs(run.save(tmp_path))
    measured = {"position", "velocity", "quaternion", "body_rates", "specific_force"}
    assert set(log.signals) == measured | {"rate_setpoints", "thrust_setpoint"}
    assert log.rate == pytest.approx(250.0, rel=1e-3)
    (piece,) = log.pieces
    assert log.t[piece][-1] > 3.9

    # A chirp turns the vehicle about its axis alone.
    spread = np.std([run.telemetry[f"w{name}"][during(run, "chirp", 0)] for name in AXES], axis=1)
    assert spread[0] > 2.0 * spread[1:].max()

    # The gyro has its noise; the commands are those of the telemetry.
    t = run.telemetry["t"]
    assert log.start >= 0.0
    rates = np.stack([np.interp(log.t + log.start, t, run.telemetry[f"w{k}"]) for k in AXES], 1)
    assert 0.02 < np.std(log.body_rates - rates) < 0.1
    asked = np.stack([run.telemetry[f"w{k}_cmd"] for k in AXES], 1)
    held = asked[np.searchsorted(t, log.t + log.start, side="right") - 1]
    np.testing.assert_array_equal(log.rate_setpoints, held)


def test_it_is_flown_again_from_its_record():
    brief = quadsim.fly(**FLIGHT, timeout=0.3)
    assert brief.spec["sampler"] == "excite"
    assert quadsim.fly(brief.spec).digest() == brief.digest()


@pytest.mark.slow
def test_slow_vehicles_are_flown_by_a_slower_loop():
    """A loop over position as fast as swift's is unstable with `paper`, which turns slowly."""
    run = quadsim.fly(**FLIGHT, vehicle="paper", sensing="perfect", timeout=14.0)
    assert run.outcome == "timeout"
    assert max(np.abs(run.telemetry[f"p{k}"]).max() for k in "xy") < 4.0


@pytest.mark.parametrize("name", ["pilot", "controller"])
def test_nothing_else_flies_beside_it(name):
    with pytest.raises(quadsim.SettingError, match=f"{name}: expected none beside excite"):
        quadsim.Spec.of(excite=True, **{name: "split_s_swift"})
