"""What a person chooses on the page, and the flights made of it: their numbers may change while they fly."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from controllers import presets
from controllers.plan import PlannerSnapshot, PlanStats
from controllers.presets import Planner, per_channel
from controllers.samplers import Colored
from quadsim.race.build import build, planner_of
from quadsim.race.events import Frame
from quadsim.race.flight import fly
from quadsim.race.spec import Spec

if TYPE_CHECKING:
    from controllers.sampled_trajectories import SampledTrajectories

RANGES = {  # of Numbers: name -> lowest, highest, step
    "sigma": (0.1, 4.0, 0.05),
    "gamma_rates": (0.0, 6.0, 0.05),
    "gamma_thrust": (0.0, 6.0, 0.05),
    "temperature": (0.01, 10.0, 0.01),
    "target_ess": (0.0, 400.0, 5.0),
    "samples": (256, 8192, 256),
}


@dataclass(frozen=True)
class Numbers:
    """The planner's numbers that can be changed in flight."""

    sigma: float = 1.0  # factor on the preset's standard deviations
    gamma_rates: float = 2.0  # color exponent of the body rates
    gamma_thrust: float = 2.0  # and of the thrust
    temperature: float = 1.0
    target_ess: float = 50.0  # effective sample size that the temperature is steered to; 0: the temperature is fixed
    samples: int = 4096

    def clamped(self) -> Numbers:
        """Each number moved into its range."""
        return Numbers(**{k: type(v)(min(max(v, RANGES[k][0]), RANGES[k][1])) for k, v in asdict(self).items()})

    def of(self, base: Planner) -> Planner:
        """The preset with these numbers, moved into their ranges."""
        n = self.clamped()
        sampling = replace(base.sampling, sigma=tuple(n.sigma * s for s in base.sampling.sigma))  # pyright: ignore
        if isinstance(sampling, Colored):
            sampling = replace(sampling, gamma=per_channel(n.gamma_rates, n.gamma_thrust))
        target_ess = min(n.target_ess, n.samples / 2) if n.target_ess >= 1 else None
        mppi = replace(base.mppi, temperature=n.temperature, target_ess=target_ess, samples=n.samples)
        return replace(base, sampling=sampling, mppi=mppi)


@dataclass(frozen=True)
class Choices:
    course: str = "split_s_swift"
    vehicle: str = "swift"
    preset: str = "race"
    sampler: str = "colored"
    seed: int = 0
    laps: int = 0  # 0: the course's
    numbers: Numbers | None = None  # None: the preset's


class FlightFactory:
    def numbers(self, preset: str, sampler: str) -> Numbers:
        """The preset's own."""
        p = presets.preset(preset, sampler)
        gamma = p.sampling.gamma if isinstance(p.sampling, Colored) else (0.0,) * 4
        return Numbers(1.0, gamma[0], gamma[3], p.mppi.temperature, p.mppi.target_ess or 0.0, p.mppi.samples)

    def flight(self, choices: Choices) -> Flight:
        """Raises ValueError with one line for choices that cannot be flown."""
        return Flight(choices)


class Flight:
    """One live flight, to be used by one thread."""

    def __init__(self, c: Choices):
        settings = {"sampler": c.sampler, "preset": c.preset, "vehicle": c.vehicle, "seed": c.seed}
        spec = Spec.of(c.course, **settings, laps=c.laps or None)
        self._base = spec.planner  # the preset that the page's factors multiply
        self._spec = replace(spec, planner=c.numbers.of(self._base)) if c.numbers else spec
        self.spec, self.course, self.period = self._spec.record(), spec.course, self._base.mppi.dt
        self._plant, planner, referee = build(self._spec)
        self._mppi: Any = planner  # MPPI, whose module loads the compiler
        self.rest = self._mppi.rest
        self.is_cached = self._mppi.is_cached  # False: the first plan has to compile, which takes some 20 s
        self.frames: Iterator[Frame] = fly(self._plant, self, referee, self.period, snapshot=self._snapshot)

    def control(self, x: np.ndarray, target: int = 0, elapsed: int = 1) -> tuple[np.ndarray, PlanStats]:
        return self._mppi.control(x, target, elapsed)

    def tune(self, numbers: Numbers) -> None:
        """Use these numbers from the next plan on: another planner takes over the plan."""
        before = self._spec.planner.mppi.temperature
        self._spec = replace(self._spec, planner=numbers.of(self._base))
        mppi = planner_of(self._spec, self._spec.streams[0])
        mppi.continue_from(self._mppi)
        if mppi.config.temperature == before:  # then the one reached by steering to the target ESS stays
            mppi.temperature = self._mppi.temperature
        self._mppi = mppi

    def sampled_trajectories(self) -> SampledTrajectories | None:
        from controllers.sampled_trajectories import sampled_trajectories  # here: it loads the compiler

        return sampled_trajectories(self._mppi)

    def close(self) -> None:
        self._plant.close()

    def _snapshot(self) -> PlannerSnapshot | None:
        from controllers.sampled_trajectories import take_snapshot

        return take_snapshot(self._mppi)
