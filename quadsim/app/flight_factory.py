"""Flights for the page: choices become a spec, the spec a flight whose numbers may change while it flies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from controllers import presets
from controllers.plan import PlannerSnapshot, PlanStats
from controllers.presets import Planner, per_channel
from controllers.sampled_trajectories import SampledTrajectories, sampled_trajectories, take_snapshot
from controllers.samplers import Colored
from quadsim.race.build import build, planner_of
from quadsim.race.events import Frame
from quadsim.race.flight import fly
from quadsim.race.spec import Spec
from web.choices import Choices, Numbers


class FlightFactory:
    """See web.choices.FlightFactory."""

    def numbers(self, preset: str, sampler: str) -> Numbers:
        p = presets.preset(preset, sampler)
        gamma = p.sampling.gamma if isinstance(p.sampling, Colored) else (0.0,) * 4
        return Numbers(1.0, gamma[0], gamma[3], p.mppi.temperature, p.mppi.target_ess or 0.0, p.mppi.samples)

    def flight(self, choices: Choices) -> LiveFlight:
        c = choices
        settings = {"sampler": c.sampler, "preset": c.preset, "vehicle": c.vehicle, "seed": c.seed}
        spec = Spec.of(c.course, **settings, laps=c.laps or None)
        base = spec.planner
        return LiveFlight(replace(spec, planner=with_numbers(base, c.numbers)) if c.numbers else spec, base)


class LiveFlight:
    """One flight. With new numbers its planner is replaced by another that takes over the plan."""

    def __init__(self, spec: Spec, base: Planner):
        """base: the preset that the page's factors multiply."""
        self.course, self.period = spec.course, spec.planner.mppi.dt
        self._spec, self._base = spec, base
        self.spec = spec.record()
        self._mppi = planner_of(spec, spec.streams[0])
        self._plant, _, referee = build(spec)
        self.rest, self.is_cached = self._mppi.rest, self._mppi.is_cached
        self.frames: Iterator[Frame] = fly(self._plant, self, referee, self.period, snapshot=self._snapshot)

    def control(self, x: np.ndarray, target: int = 0, elapsed: int = 1) -> tuple[np.ndarray, PlanStats]:
        return self._mppi.control(x, target, elapsed)

    def tune(self, numbers: Numbers) -> None:
        before = self._spec.planner.mppi.temperature
        self._spec = replace(self._spec, planner=with_numbers(self._base, numbers))
        mppi = planner_of(self._spec, self._spec.streams[0])
        mppi.take_over(self._mppi)
        if mppi.config.temperature == before:  # then the one reached by steering to the target ESS stays
            mppi.temperature = self._mppi.temperature
        self._mppi = mppi

    def sampled_trajectories(self) -> SampledTrajectories | None:
        return sampled_trajectories(self._mppi)

    def close(self) -> None:
        self._plant.close()

    def _snapshot(self) -> PlannerSnapshot | None:
        return take_snapshot(self._mppi)


def with_numbers(base: Planner, numbers: Numbers) -> Planner:
    """The preset with the page's numbers, moved into their ranges."""
    n = numbers.clamped()
    sampling = replace(base.sampling, sigma=tuple(n.sigma * s for s in base.sampling.sigma))  # pyright: ignore
    if isinstance(sampling, Colored):
        sampling = replace(sampling, gamma=per_channel(n.gamma_rates, n.gamma_thrust))
    target_ess = min(n.target_ess, n.samples / 2) if n.target_ess >= 1 else None
    mppi = replace(base.mppi, temperature=n.temperature, target_ess=target_ess, samples=n.samples)
    return replace(base, sampling=sampling, mppi=mppi)
