"""The state after a physics step, and the state in which a flight starts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

from quadsim.course import Start
from quadsim.dynamics.quadrotor import State
from quadsim.rotation import Vec3, from_yaw
from quadsim.vehicle import GRAVITY

# [m] between the ground and a vehicle that starts on it
CLEARANCE = 1e-3

X = TypeVar("X", bound=tuple[float, ...])


class MotorUse(NamedTuple):
    """What a flight has asked of its motors since the start. Both numbers only grow.

    The columns of a run have the same names: see MOTOR_UNITS.
    """

    # sum of the changes of a motor's command, which is 1 at the greatest speed; mean of the motors
    motor_variation: float = 0.0
    # integral of the thrust that was commanded and not given because a motor was at its greatest
    # command, mass-normalised [m/s]
    thrust_lost: float = 0.0


MOTOR_UNITS = {"motor_variation": "1", "thrust_lost": "m/s"}


@dataclass(frozen=True, slots=True)
class PlantState(Generic[X]):
    """The state after a physics step.

    The plants of quadsim give a `State`. A plant of a user's own may give a tuple in the order of
    its numbers: see `quadsim.physics.plant.NamedPlant`.

    Examples:
        >>> from quadsim.physics.plant_state import PlantState
        >>> state = PlantState(t=0.0025, x=(1.0, 2.0, 3.0), contacts=())
        >>> state.position
        (1.0, 2.0, 3.0)
    """

    # [s]
    t: float
    # the system's state  (n_x,)
    x: X
    # objects that the vehicle touches: "ground", "gate 3", "obstacle 2"
    contacts: tuple[str, ...]
    # where a firmware commands the motors
    motors: MotorUse | None = None

    @property
    def position(self) -> Vec3:
        """The position with which the state begins [m].

        A state of fewer than three numbers is filled up with zeros.
        """
        x, y, z = (*self.x[:3], 0.0, 0.0)[:3]
        return x, y, z


def start_state(start: Start, radius: float) -> State:
    """Return the state at rest, level, with hover thrust.

    Args:
        start: pose of the vehicle; if it touches the ground it is lifted clear of it.
        radius: radius of the vehicle [m].
    """
    x, y, z = start.position
    return State.of(
        position=(x, y, max(z, radius + CLEARANCE)),
        velocity=(0.0, 0.0, 0.0),
        attitude=from_yaw(start.yaw),
        body_rates=(0.0, 0.0, 0.0),
        thrust=GRAVITY,
        angular_acceleration=(0.0, 0.0, 0.0),
    )
