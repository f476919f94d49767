"""A plant of one's own: PyBullet's quadrotor in a steady side wind that the planner does not know."""

import quadsim
from quadsim import Spec
from quadsim.physics.plant import Plant, PlantState
from quadsim.race.spec import build

WIND = (0.0, 1.0, 0.0)  # acceleration in the world [m/s^2]


class Windy:
    """Wraps the plant that the spec asks for. Called once for each flight, with its Spec."""

    def __init__(self, spec: Spec):
        from dataclasses import replace

        from quadsim.race.spec import OwnParts

        self.inner: Plant = build(replace(spec, own=OwnParts()))[0]
        self.dt = self.inner.dt
        self.inner.gusts = iter(lambda: WIND, None)  # type: ignore[attr-defined]

    @property
    def state(self) -> PlantState:
        return self.inner.state

    def step(self, u: tuple[float, ...]) -> PlantState:
        return self.inner.step(u)

    def close(self) -> None:
        self.inner.close()


for plant in (None, Windy):
    run = quadsim.fly("figure8", laps=1, **({"plant": plant} if plant else {}))
    print(plant.__name__ if plant else "calm", run.outcome, run.laps)
