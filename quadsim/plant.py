"""Plant: the world that is flown. The controller only believes; the plant is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

Vec3 = tuple[float, float, float]

# The quadrotor's state everywhere: p [m], v [m/s] (world), q wxyz (world from body), body rates [rad/s],
# and the mass-normalised thrust the rotors deliver now [m/s^2].
STATE = ("px", "py", "pz", "vx", "vy", "vz", "qw", "qx", "qy", "qz", "wx", "wy", "wz", "a")
CONTROL = ("wx_cmd", "wy_cmd", "wz_cmd", "a_cmd")


@dataclass(frozen=True, slots=True)
class PlantState:
    """What one physics step left behind."""

    t: float  # [s]
    x: tuple[float, ...]  # STATE
    contacts: tuple[str, ...]  # what the vehicle touches: "ground", "gate 3"

class Plant(Protocol):
    """A world with its own clock of fixed physics steps. One per flight; close() frees it."""

    dt: float  # physics step [s]

    @property
    def state(self) -> PlantState: ...

    def step(self, u: tuple[float, ...]) -> PlantState:
        """Advance one physics step under the command u = (body rates [rad/s], thrust [m/s^2])."""
        ...

    def close(self) -> None: ...
