"""Plan with a sampler of your own: piecewise constant noise, in plain NumPy."""

from dataclasses import dataclass

import numpy as np

import quadsim


@dataclass(frozen=True)
class PiecewiseConstant:
    """Each control keeps one random value for `hold` steps."""

    sigma: tuple[float, ...] = (0.8, 0.8, 0.5, 4.0)  # [rad/s, rad/s, rad/s, m/s^2]
    hold: int = 10

    def sample(
        self, rng: np.random.Generator, samples: int, horizon: int, controls: int
    ) -> np.ndarray:
        """Return the perturbations  (samples, horizon, controls)."""
        pieces = rng.standard_normal((samples, -(-horizon // self.hold), controls))
        return np.array(self.sigma) * pieces.repeat(self.hold, axis=1)[:, :horizon]


if __name__ == "__main__":
    run = quadsim.fly("figure8", sampler=PiecewiseConstant(), laps=1, samples=512)
    print(run.spec["sampler"], run.outcome, run.laps)
    variants = {"gaussian": {"sampler": "gaussian"}, "mine": {"sampler": PiecewiseConstant()}}
    print(quadsim.compare("figure8", variants, attempts=2, laps=1, samples=512))
