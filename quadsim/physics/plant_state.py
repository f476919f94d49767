"""The state after a physics step, and the initial state of a flight."""

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
    """The accumulated use of the motors since the start of a flight.

    The columns of a run have the same names: see MOTOR_UNITS.
    """

    # total variation of a motor's command, which is 1 at full speed; mean of the motors
    motor_variation: float = 0.0
    # integral of the commanded thrust that was not delivered because a motor was saturated,
    # mass-normalised [m/s]
    thrust_lost: float = 0.0


MOTOR_UNITS = {"motor_variation": "1", "thrust_lost": "m/s"}


@dataclass(frozen=True, slots=True)
class PlantState(Generic[X]):
    """The state after a physics step.

    The plants of quadsim return a `State`. A user's own plant may return a tuple in the same order,
    see `quadsim.config.own.OwnPlant`.

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
    # use of the motors, if a firmware commands them
    motors: MotorUse | None = None

    @property
    def position(self) -> Vec3:
        """The position, the first three numbers of the state [m].

        If the state has fewer than three numbers, zeros are appended.
        """
        x, y, z = (*self.x[:3], 0.0, 0.0)[:3]
        return x, y, z


def start_state(start: Start, radius: float) -> State:
    """Return the state of a level vehicle at rest, with the thrust of hovering.

    Args:
        start: pose of the vehicle, which is lifted if it would touch the ground.
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
