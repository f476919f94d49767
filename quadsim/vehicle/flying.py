"""Flight properties that follow from a vehicle's numbers: hover, top speed, response times."""

from __future__ import annotations

from math import cos, inf, pi, sin
from typing import NamedTuple

from quadsim.vehicle.vehicle import GRAVITY, Vehicle

# Half an interval of 90 degrees is less than 1e-12 rad after so many bisections.
BISECTIONS = 40


class FlyingNumbers(NamedTuple):
    """The flight properties of a vehicle."""

    thrust_to_weight: float
    # rotor speed at hover as a share of full speed; without rotors: thrust as a share of the full
    hover: float
    # of level flight at full thrust, inf without drag [m/s]
    top_speed: float
    # lags of the body rates about x, y, z [s]
    rate_tau: tuple[float, float, float]
    # lag of the rotors, 0 without rotors [s]
    motor_tau: float

    def text(self) -> str:
        """Return the flight properties as one line of text."""
        of = "full rotor speed" if self.motor_tau else "full thrust"
        speed = "no top speed, as it has no drag"
        if self.top_speed < inf:
            speed = f"top speed {self.top_speed:.0f} m/s by its linear drag"
        lags = " ".join(f"{1e3 * tau:.0f}" for tau in self.rate_tau)
        rotors = f", rotors {1e3 * self.motor_tau:.0f} ms" if self.motor_tau else ""
        return (
            f"thrust-to-weight {self.thrust_to_weight:.2f}, hovers at {100 * self.hover:.0f} % of"
            f" {of}, {speed}, body rates lag {lags} ms{rotors}"
        )


def flying_numbers(vehicle: Vehicle) -> FlyingNumbers:
    """Return the flight properties that follow from a vehicle's numbers.

    Examples:
        >>> import quadsim
        >>> from quadsim.vehicle.flying import flying_numbers
        >>> round(flying_numbers(quadsim.load_vehicle("swift")).hover, 3)
        0.494
    """
    rotors = vehicle.rotors
    hover = GRAVITY / vehicle.thrust_max
    if rotors:
        hover = rotors.speed(0.25 * vehicle.mass * GRAVITY) / rotors.motor_omega_max
    return FlyingNumbers(
        thrust_to_weight=vehicle.thrust_to_weight,
        hover=hover,
        top_speed=top_speed(vehicle),
        rate_tau=vehicle.rate_tau,
        motor_tau=rotors.motor_tau if rotors else 0.0,
    )


def top_speed(vehicle: Vehicle) -> float:
    """Return the speed of level flight along x at full thrust [m/s]; inf without drag.

    With the tilt theta, thrust a and drag d_x, d_z along the body's axes the forces balance:

        a sin(theta) = v (d_x cos(theta)^2 + d_z sin(theta)^2)
        a cos(theta) + v (d_x - d_z) sin(theta) cos(theta) = g
    """
    drag_x, _, drag_z = vehicle.drag
    a = vehicle.thrust_max
    # Without drag along one of the axes there is a tilt for any speed.
    if drag_x == 0.0 or drag_z == 0.0:
        return inf

    def speed(theta: float) -> float:
        return a * sin(theta) / (drag_x * cos(theta) ** 2 + drag_z * sin(theta) ** 2)

    low = 0.0
    high = 0.5 * pi
    for _ in range(BISECTIONS):
        theta = 0.5 * (low + high)
        lift = a * cos(theta) + speed(theta) * (drag_x - drag_z) * sin(theta) * cos(theta)
        # More tilt, less lift
        if lift > GRAVITY:
            low = theta
        else:
            high = theta
    return speed(low)
