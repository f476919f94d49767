"""Prior: the numbers before a log is read, from a similar vehicle."""

from __future__ import annotations

from quadsim.dynamics.quadrotor import ModelParams
from quadsim.identify.numbers import FitNumbers, Prior
from quadsim.vehicle import Vehicle

LARGEST_DELAY = 0.3  # [s]
LONGEST_LAG = 0.5  # [s]
SHORTEST_LAG = 1e-3
# Standard deviations, the relative ones of the prior vehicle's number
DELAY = 0.05  # [s]
LAG = 0.05  # [s]
SHARE = 1.0  # of thrust and inertia
FACTOR = 100.0  # the search ends at this many times the prior's thrust and inertia
DRAG = 0.5  # [1/s]
VOLTAGE = 0.5
OFFSET = 0.2
FLATNESS = 0.2  # a flat body has 2, a ball 1
BIAS = 1.0  # [m/s^2]
TILT = 0.1  # [rad]
SENSOR_LAG = 0.01  # [s]
FORCE_LAG = 0.02
YAW_LEAD = 0.3


def prior_of(vehicle: Vehicle) -> dict[str, Prior]:
    """Return the prior of each number, from a similar vehicle with rotors."""
    rotors = vehicle.rotors
    assert rotors
    model = ModelParams.of(vehicle)
    square, linear, constant = rotors.thrust_map
    full = rotors.motor_omega_max
    size = rotors.thrust(full) / vehicle.mass
    inertia_x, inertia_y = model.tilt_cost
    jx, jy, jz = vehicle.inertia
    prior = {
        "delay": Prior(0.0, DELAY, 0.0, LARGEST_DELAY),
        "tau": Prior(rotors.motor_tau, LAG, SHORTEST_LAG, LONGEST_LAG),
        "c2": Prior(square * full**2 / vehicle.mass, SHARE * size, 1e-3 * size, FACTOR * size),
        "c1": _about(linear * full / vehicle.mass, SHARE * size),
        "c0": _about(constant / vehicle.mass, SHARE * size),
        "voltage_power": Prior(1.0, VOLTAGE, -1.0, 4.0),
        "inertia_x": _positive(inertia_x),
        "inertia_y": _positive(inertia_y),
        "inertia_z": _positive(model.yaw_cost),
        "flatness": Prior(2.0 * jz / (jx + jy), FLATNESS, 0.5, 2.0),
        "yaw_lead": Prior(0.0, YAW_LEAD, -0.5, 2.0),
        "flapping": _about(0.0, SENSOR_LAG),
        "force_lag": Prior(0.0, FORCE_LAG, -0.05, 0.1),
        "velocity_lag": _about(0.0, SENSOR_LAG),
    }
    for axis, drag in zip("xyz", vehicle.drag, strict=True):
        prior[f"drag_{axis}"] = Prior(drag, DRAG, -5.0, 20.0)
        prior[f"offset_{axis}"] = _about(0.0, OFFSET)
        prior[f"bias_{axis}"] = _about(0.0, BIAS)
    for axis in "xy":
        prior[f"tilt_{axis}"] = _about(0.0, TILT)
        prior[f"pose_tilt_{axis}"] = _about(0.0, TILT)
    return {name: prior[name] for name in FitNumbers._fields}


def _about(mean: float, std: float) -> Prior:
    """Return the prior of a number of either sign."""
    return Prior(mean, std, mean - 10.0 * std, mean + 10.0 * std)


def _positive(mean: float) -> Prior:
    """Return the prior of a number above 0."""
    return Prior(mean, SHARE * mean, mean / FACTOR, mean * FACTOR)
