"""The limits that a configuration of the firmware sets to the planner's model.

The measured curves of sticks and throttle end at the body rates of the configuration, and at the
motor commands that its throttle limit, output limit and idle leave.
"""

from __future__ import annotations

from dataclasses import replace

from quadsim.dynamics.quadrotor import ModelParams
from quadsim.firmware.configuration import Configuration
from quadsim.firmware.gains import AXIS_NAMES
from quadsim.firmware.translation import ConfigurationError
from quadsim.vehicle import GRAVITY, Vehicle

# A limit counts if it takes more than this share of what the vehicle has: the curves are measured
# in steps, and the firmware's own idle of 5.5 % of the speed gives next to no thrust.
SMALL = 0.01
# Share of a body rate at the end of a stick that the planner uses: a command at the very end leaves
# the firmware nothing to correct with.
USED = 0.98
# Share of their thrust that the motors need beside a limited throttle for a turn to cost no thrust
FREE = 0.5


def nominal_behind(vehicle: Vehicle, configuration: Configuration, name: str) -> ModelParams:
    """Return the nominal model of a vehicle, with no more than its configuration gives.

    Args:
        vehicle: vehicle with rotors.
        configuration: configuration with its measured curves.
        name: name of the configuration, for errors.

    Raises:
        ConfigurationError: the vehicle cannot fly with these limits.
    """
    nominal = ModelParams.of(vehicle)
    rates = []
    for axis, (most, curve) in enumerate(zip(vehicle.omega_max, configuration.rates, strict=True)):
        reached = float(min(abs(curve[0]), abs(curve[-1])))
        if reached <= 0.0:
            wanted = f"expected a stick of {AXIS_NAMES[axis]} that commands body rates"
            raise ConfigurationError(f"{name}: {wanted}, got none at its ends: correct the rates")
        rates.append(USED * reached if reached < (1.0 - SMALL) * most else most)
    roll, pitch, yaw = rates

    highest = thrust_of(vehicle, float(configuration.motors[-1]))
    lowest = thrust_of(vehicle, float(configuration.motors[0]))
    wanted = f"expected thrusts from below to above gravity ({GRAVITY:g} m/s^2)"
    if not lowest < GRAVITY < highest:
        got = f"got {lowest:.3g} to {highest:.3g} m/s^2 from {vehicle.name}"
        advice = "correct its throttle limit, motor output limit or idle"
        raise ConfigurationError(f"{name}: {wanted}, {got}: {advice}")
    thrust_max = highest if highest < (1.0 - SMALL) * nominal.thrust_max else nominal.thrust_max
    used = _share_given_up(vehicle, configuration, thrust_max)
    tilt_x, tilt_y = nominal.tilt_cost
    return replace(
        nominal,
        tilt_cost=(used * tilt_x, used * tilt_y),
        yaw_cost=used * nominal.yaw_cost,
        rate_max=(roll, pitch, yaw),
        thrust_max=thrust_max,
        thrust_min=lowest if lowest > SMALL * nominal.thrust_max else nominal.thrust_min,
    )


def _share_given_up(vehicle: Vehicle, configuration: Configuration, thrust_max: float) -> float:
    """Return the share of the thrust of a turn that is lost at full throttle, 0 to 1.

    Motors that are saturated lose thrust in a turn. A limited throttle leaves them room: nothing is
    lost if the room is FREE of their thrust, and all of it if there is none.
    """
    idle = float(configuration.motors[0])
    most = thrust_of(vehicle, idle + (1.0 - idle) * configuration.output_limit)
    room = (most - thrust_max) / most
    return min(max(1.0 - room / FREE, 0.0), 1.0) if room > SMALL else 1.0


def thrust_of(vehicle: Vehicle, motor: float) -> float:
    """Return the mass-normalised thrust [m/s^2] of a command of all motors, 0..1."""
    assert vehicle.rotors
    return (
        max(4.0 * vehicle.rotors.thrust(motor * vehicle.rotors.motor_omega_max), 0.0) / vehicle.mass
    )
