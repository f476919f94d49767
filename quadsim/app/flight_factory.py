"""Flights for the page: choices become a spec, the spec a flight whose numbers may change while it flies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from controllers.plan import PlannerSnapshot, PlanStats
from controllers.presets import Planner, per_channel
from controllers.sampled_trajectories import SampledTrajectories, sampled_trajectories, take_snapshot
from quadsim.app.flight_flags import FlightFlags
from quadsim.app.preset_file import load_planner
from quadsim.race.events import Frame
from quadsim.race.flight import fly
from quadsim.race.spec import Spec, build, controller_of, streams
from web.choices import Choices, Numbers


class FlightFactory:
    """See web.choices.FlightFactory."""

    def numbers(self, preset: str, sampler: str) -> Numbers:
        p = load_planner(preset, sampler)
        rates, thrust = p.sampling.gamma[0], p.sampling.gamma[3]
        return Numbers(1.0, rates, thrust, p.mppi.temperature, p.mppi.ess or 0.0, p.mppi.samples)

    def flight(self, choices: Choices) -> LiveFlight:
        base = load_planner(choices.preset, choices.sampler)
        planner = with_numbers(base, choices.numbers) if choices.numbers else base
        flags = FlightFlags(
            course=choices.course,
            sampler=choices.sampler,
            preset=choices.preset,
            vehicle=choices.vehicle,
            laps=choices.laps or None,
            seed=choices.seed,
            sampling=planner.sampling,
            mppi=planner.mppi,
            cost=planner.cost,
        )
        return LiveFlight(flags.spec(), base)


class LiveFlight:
    """One flight. With new numbers its planner is replaced by another that takes over the plan."""

    def __init__(self, spec: Spec, base: Planner):
        """base: the preset that the page's factors multiply."""
        self.course, self.period = spec.course, spec.planner.mppi.dt
        self._spec, self._base = spec, base
        self.spec = spec.record()
        self._plant, self._mppi, referee = build(spec)
        self.rest, self.is_cached = self._mppi.rest, self._mppi.is_cached
        self.frames: Iterator[Frame] = fly(self._plant, self, referee, self.period, picture=self._snapshot)

    def control(self, x: np.ndarray, target: int = 0, elapsed: int = 1) -> tuple[np.ndarray, PlanStats]:
        return self._mppi.control(x, target, elapsed)

    def tune(self, numbers: Numbers) -> None:
        before = self._spec.planner.mppi.temperature
        self._spec = replace(self._spec, planner=with_numbers(self._base, numbers))
        mppi = controller_of(self._spec, streams(self._spec.seed)[0])
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
    sigma, gamma = tuple(n.sigma * s for s in base.sampling.sigma), per_channel(n.gamma_rates, n.gamma_thrust)
    ess = min(n.ess, n.samples / 2) if n.ess >= 1 else None
    mppi = replace(base.mppi, temperature=n.temperature, ess=ess, samples=n.samples)
    return replace(base, sampling=replace(base.sampling, sigma=sigma, gamma=gamma), mppi=mppi)
