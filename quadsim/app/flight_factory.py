"""Flights for the page: choices become a spec, the spec a flight whose numbers may change while it flies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, replace

import numpy as np

from controllers.plan import PlannerSnapshot, PlanStats
from controllers.presets import Planner
from controllers.sampled_trajectories import SampledTrajectories, sampled_trajectories, take_snapshot
from controllers.samplers import Colored
from quadsim.app.flight_flags import FlightFlags
from quadsim.app.preset_file import SamplingNumbers, load_planner
from quadsim.race.events import Frame
from quadsim.race.flight import fly
from quadsim.race.spec import Spec, build, controller_of, streams
from web.choices import RANGES, Choices, Numbers


class FlightFactory:
    """Builds what the page asks for. See web.choices.FlightFactory."""

    def numbers(self, preset: str, sampler: str) -> Numbers:
        p = load_planner(preset, sampler)
        gamma = p.sampling.gamma if isinstance(p.sampling, Colored) else (0.0, 0.0, 0.0, 0.0)
        return Numbers(1.0, gamma[0], gamma[3], p.mppi.temperature, p.mppi.target_ess or 0.0, p.mppi.samples)

    def flight(self, choices: Choices) -> LiveFlight:
        base = load_planner(choices.preset, choices.sampler)
        p = planner(base, choices.numbers) if choices.numbers else base
        flags = FlightFlags(
            course=choices.course,
            sampler=choices.sampler,
            preset=choices.preset,
            vehicle=choices.vehicle,
            laps=choices.laps or None,
            seed=choices.seed,
            sampling=SamplingNumbers.of(p.sampling),
            mppi=p.mppi,
            cost=p.cost,
        )
        return LiveFlight(flags.spec(), base)


class LiveFlight:
    """One flight and its planner, which is replaced by one with other numbers that goes on with its plan."""

    def __init__(self, spec: Spec, base: Planner):
        """base: the preset that factors refer to."""
        self.course, self.period = spec.course, spec.planner.mppi.dt
        self._spec, self._base = spec, base
        self.spec = spec.record()
        self._plant, self._mppi, referee = build(spec)
        self.rest, self.is_cached = self._mppi.rest, self._mppi.is_cached
        self.frames: Iterator[Frame] = fly(self._plant, self, referee, self.period, snapshot=self._snapshot)

    def control(self, x: np.ndarray, target: int = 0, elapsed: int = 1) -> tuple[np.ndarray, PlanStats]:
        return self._mppi.control(x, target, elapsed)

    def tune(self, numbers: Numbers) -> None:
        before = self._spec.planner.mppi.temperature
        self._spec = replace(self._spec, planner=planner(self._base, numbers))
        mppi = controller_of(self._spec, streams(self._spec.seed)[0])
        mppi.take_over(self._mppi)
        if mppi.config.temperature == before:  # where it has been steered to
            mppi.temperature = self._mppi.temperature
        self._mppi = mppi

    def sampled_trajectories(self) -> SampledTrajectories | None:
        return sampled_trajectories(self._mppi)

    def close(self) -> None:
        self._plant.close()

    def _snapshot(self) -> PlannerSnapshot | None:
        return take_snapshot(self._mppi)


def planner(base: Planner, numbers: Numbers) -> Planner:
    """The preset with the page's numbers."""
    n = clamped(numbers)
    sampling = replace(base.sampling, sigma=tuple(n.sigma * s for s in base.sampling.sigma))
    if isinstance(sampling, Colored):
        sampling = replace(sampling, gamma=(n.gamma_rates, n.gamma_rates, n.gamma_rates, n.gamma_thrust))
    target_ess = min(n.target_ess, n.samples / 2) if n.target_ess >= 1 else None
    mppi = replace(base.mppi, temperature=n.temperature, target_ess=target_ess, samples=n.samples)
    return replace(base, sampling=sampling, mppi=mppi)


def clamped(numbers: Numbers) -> Numbers:
    """Whatever came from outside, inside the ranges."""
    kept = {k: type(v)(min(max(v, RANGES[k][0]), RANGES[k][1])) for k, v in asdict(numbers).items()}
    return Numbers(**kept)
