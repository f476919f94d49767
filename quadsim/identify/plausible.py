"""Whether logs are those of a flight, and whether what fits them is a vehicle that can fly."""

from __future__ import annotations

from quadsim.dynamics.quadrotor import thrust_min
from quadsim.files.values import SettingError
from quadsim.identify.geometry import Geometry
from quadsim.identify.search import Solution
from quadsim.vehicle import GRAVITY, Vehicle

# Share of the changes of a signal that the commands explain in a flight
LEAST_ANSWER = 0.2
# Thrust-to-weight ratio of vehicles that fly and that exist
LEAST_THRUST = 1.1
LARGEST_THRUST = 25.0
# Inertia over mass and arm, as a share of the arm: about .5 for most quadrotors
LEAST_INERTIA = 0.03
LARGEST_INERTIA = 2.5
WANTED = "expected logs of a quadrotor that can fly"
UNITS = "correct the units, signs and order of the columns"


def expect_answers(solution: Solution) -> None:
    """Raise SettingError if nothing that was measured answers the commands.

    A vehicle that stands on the ground, hangs, or is carried has a log like that.
    """
    shares = solution.explained
    if not shares:
        return
    # Forces and velocities sideways follow from the attitude, too.
    answers = [shares[kind] for kind in ("force_z", "velocity_z") if kind in shares]
    if answers and max(answers) < LEAST_ANSWER:
        share = 100.0 * max(*answers, 0.0)
        wanted = "expected a free flight in which the thrust follows the commands"
        got = f"got commands that explain {share:.0f} % of its changes"
        advice = "leave out logs on the ground, fly steps of the throttle, or correct the units"
        raise SettingError("logs", f"{wanted}, {got}: {advice}")


def expect_inertia(solution: Solution, geometry: Geometry) -> None:
    """Raise SettingError if the inertia is far from that of a body with these arms."""
    arms = {"inertia_x": geometry.arm_y, "inertia_y": geometry.arm_x}
    for name, arm in arms.items():
        share = getattr(solution.numbers, name) / arm
        if name in solution.searched and not LEAST_INERTIA <= share <= LARGEST_INERTIA:
            wanted = "expected the inertia of a quadrotor"
            axis = name[-1]
            got = f"got {share:.3g} times mass and arm squared about {axis}"
            raise SettingError("logs", f"{wanted}, {got}: correct unit or scale of the gyro")


def expect_plausible(vehicle: Vehicle) -> None:
    """Raise SettingError if a fitted vehicle cannot fly."""
    ratio = vehicle.thrust_max / GRAVITY
    if not LEAST_THRUST <= ratio <= LARGEST_THRUST:
        got = f"got a thrust-to-weight ratio of {ratio:.3g}"
        raise SettingError("logs", f"{WANTED}, {got}: {UNITS} of the motors and accelerometer")
    least = thrust_min(vehicle)
    if least >= GRAVITY:
        got = f"got one that climbs at its least command, with {least:.3g} m/s^2"
        raise SettingError("logs", f"{WANTED}, {got}: {UNITS} of the motors")
