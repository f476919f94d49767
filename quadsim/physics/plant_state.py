"""The state after a physics step, and the state in which a flight starts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

from quadsim.course import Start
from quadsim.dynamics.quadrotor import State
from quadsim.rotation import Vec3, from_yaw
from quadsim.vehicle import GRAVITY

# [m] between the ground and a vehicle that starts on it
CLEARANCE = 1e-3

X = TypeVar("X", bound=tuple[float, ...])


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
