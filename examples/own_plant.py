"""Fly in a plant of your own: the quadrotor's equations, in a side wind unknown to the planner."""

from dataclasses import replace

import quadsim
from quadsim import Spec
from quadsim.config.build_plant import start_of
from quadsim.dynamics.quadrotor import quadrotor
from quadsim.physics.plant import PlantState

WIND = 1.5  # acceleration to the left [m/s^2]


class Windy:
    """A plant has four members: dt, state, step and close. It is made from the Spec of a flight."""

    def __init__(self, spec: Spec):
        self.dt = spec.plant_dt
        self.system = quadrotor(replace(spec.model, drag=0.3), self.dt)
        self.state = PlantState(0.0, start_of(spec), contacts=())

    def step(self, u: tuple[float, ...]) -> PlantState:
        """Advance the world by dt under the control u, and return its state."""
        x = self.system.next(self.state.x, u)
        blown = x._replace(vy=x.vy + WIND * self.dt)
        self.state = PlantState(self.state.t + self.dt, blown, contacts=())
        return self.state

    def close(self) -> None:
        """Nothing to free."""


run = quadsim.fly("figure8", plant=Windy, laps=1)
print(run.spec["own"]["plant"]["class"], run.outcome, run.laps)
