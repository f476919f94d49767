"""What a person chooses on the page, and the flights made of it: their numbers may change while
they fly."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from quadsim.spec.own_parts import plain

from controllers import presets
from controllers.plan import PlannerSnapshot, PlanStats
from controllers.presets import Planner, per_channel
from controllers.samplers import Colored
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.quadrotor import Control
from quadsim.race.events import Frame
from quadsim.race.flight import simulate
from quadsim.sensing import PERFECT
from quadsim.spec.build import build, navigation_of, planner_of
from quadsim.spec.settings import Setting, settings_of
from quadsim.spec.spec import Spec
from quadsim.spec.systems import SYSTEMS

if TYPE_CHECKING:
    from controllers.sampled_trajectories import SampledTrajectories
    from quadsim.sensing.measurements import Corners

PILOT = "pilot "  # before the name of a learned pilot, where a sampler may stand
RANGES = {  # of the numbers that may change in flight: name -> lowest, highest, step
    "sigma": (0.1, 4.0, 0.05),  # factor on the preset's standard deviations
    "gamma_rates": (0.0, 6.0, 0.05),  # color exponent of the body rates
    "gamma_thrust": (0.0, 6.0, 0.05),  # and of the thrust
    "temperature": (0.01, 10.0, 0.01),
    # effective sample size that the temperature is steered to; 0: it is fixed
    "target_ess": (0.0, 400.0, 5.0),
    "samples": (256, 8192, 256),
}


def numbers_of(planner: Mapping[str, Any], sigma: Sequence[float] = ()) -> dict[str, float]:
    """Those of RANGES in a planner as a run records it. sigma: the standard deviations that scale 1
    stands for."""
    mppi, sampling = planner["mppi"], planner.get("sampling")
    sampling = sampling if isinstance(sampling, dict) else {}
    own, gamma = sampling.get("sigma"), sampling.get("gamma") or (0.0,)
    return {
        "sigma": round(own[0] / sigma[0], 4) if own and sigma else 1.0,
        "gamma_rates": gamma[0],
        "gamma_thrust": gamma[-1],
        "temperature": mppi.get("temperature", 1.0),
        "target_ess": mppi.get("target_ess", mppi.get("ess")) or 0.0,  # older runs say "ess"
        "samples": mppi["samples"],
    }


def with_number(planner: Planner, preset: Planner, name: str, value: float) -> Planner:
    """The planner with this number of RANGES; gamma is of colored sampling alone and leaves others
    as they are."""
    sampling: Any = planner.sampling
    if name == "sigma":
        return replace(
            planner,
            sampling=replace(sampling, sigma=tuple(value * s for s in preset.sampling.sigma)),
        )  # pyright: ignore
    if name.startswith("gamma"):
        if not isinstance(sampling, Colored):
            return planner
        gamma = Control(*sampling.gamma)
        rates = value if name == "gamma_rates" else gamma.wx
        thrust = value if name == "gamma_thrust" else gamma.thrust
        return replace(planner, sampling=replace(sampling, gamma=per_channel(rates, thrust)))
    changed: dict[str, Any] = {name: value if name != "target_ess" or value >= 1 else None}
    mppi = replace(planner.mppi, **changed)
    target = min(mppi.target_ess, mppi.samples / 2) if mppi.target_ess else None
    return replace(planner, mppi=replace(mppi, target_ess=target))


@dataclass(frozen=True)
class Choices:
    course: str = "split_s_swift"
    vehicle: str = "swift"
    preset: str = "race"
    sampler: str = "colored"  # or PILOT with the name of a learned pilot
    sensing: str = PERFECT
    seed: int = 0
    laps: int = 0  # 0: the course's
    # of RANGES, where they are not the preset's
    numbers: Mapping[str, float] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)  # any others, as of quadsim.fly


def planner_choice(sampler: str) -> dict[str, str]:
    """The settings of quadsim.fly that a choice of sampler or learned pilot stands for."""
    pilot = {"pilot": sampler.removeprefix(PILOT)} if sampler.startswith(PILOT) else {}
    return {"sampler": "colored" if pilot else sampler} | pilot


class FlightFactory:
    def numbers(self, preset: str, sampler: str) -> dict[str, float]:
        """The preset's own of RANGES."""
        return numbers_of(plain(presets.preset(preset, planner_choice(sampler)["sampler"])))

    def settings(self, preset: str, vehicle: str, sampler: str) -> dict[str, Setting]:
        """Every other number of the planner and its model of the vehicle, by name; a pilot has
        none."""
        if sampler.startswith(PILOT):
            return {}
        entry = SYSTEMS["quadrotor"]
        model = entry.model_of(entry.load_vehicle(vehicle))
        found = settings_of(entry, presets.preset(preset, sampler), model)
        return {name: s for name, s in found.items() if s.group != "flight" and name not in RANGES}

    def flight(self, choices: Choices) -> Flight:
        """Raises ValueError with one line for choices that cannot be flown."""
        return Flight(choices)


class Flight:
    """One live flight, to be used by one thread."""

    def __init__(self, c: Choices):
        chosen = {name: getattr(c, name) for name in ("preset", "vehicle", "seed", "sensing")}
        settings = planner_choice(c.sampler) | chosen | dict(c.settings)
        spec = Spec.of(c.course, **settings, laps=c.laps or None)
        self._preset = spec.planner  # whose standard deviations the page's factor multiplies
        self._spec = spec
        for name, value in ({} if spec.pilot else c.numbers).items():
            self._spec = self._with(name, value)
        self.spec, self.course, self.period = self._spec.record(), spec.course, self._preset.mppi.dt
        self._plant, planner, referee = build(self._spec)
        self._mppi: Any = planner  # MPPI, whose module loads the compiler, or a learned pilot
        self.rest = self._mppi.rest
        # False: the first plan has to compile, some 20 s
        self.is_cached = spec.pilot or self._mppi.is_cached
        self._navigation = navigation_of(self._spec, self._plant, planner, referee)
        self.frames: Iterator[Frame] = simulate(
            self._plant,
            self,
            referee,
            self.period,
            snapshot=self._snapshot,
            navigation=self._navigation,
        )

    def control(self, estimate: Estimate) -> tuple[np.ndarray, PlanStats]:
        """Return the control of the planner that flies at present."""
        return self._mppi.control(estimate)

    @property
    def numbers(self) -> dict[str, float]:
        """Those of RANGES that it flies with."""
        return numbers_of(plain(self._spec.planner), self._preset.sampling.sigma)  # pyright: ignore

    def tune(self, name: str, value: float | None) -> list[dict]:
        """Use this number of RANGES from the next plan on, None: the preset's. Another planner
        takes over the plan.

        Returns what changed, [{name, from, to}]: nothing where its sampler has no such number, or a
        pilot flies.
        """
        if self._spec.pilot:
            return []
        old, before = self.numbers, self._spec.planner.mppi.temperature
        self._spec = self._with(
            name, numbers_of(plain(self._preset))[name] if value is None else value
        )
        changes = [
            {"name": k, "from": old[k], "to": v} for k, v in self.numbers.items() if v != old[k]
        ]
        if changes:
            self._replan(before)
        return changes

    def _with(self, name: str, value: float) -> Spec:
        return replace(
            self._spec, planner=with_number(self._spec.planner, self._preset, name, value)
        )

    def _replan(self, before: float) -> None:
        """By a new planner; before: the temperature that the spec said until now."""
        mppi = planner_of(self._spec, self._spec.streams.planner)
        mppi.continue_from(self._mppi)
        # then the one reached by steering to the target ESS stays
        if mppi.config.temperature == before:
            mppi.temperature = self._mppi.temperature
        self._mppi = mppi

    def sampled_trajectories(self) -> SampledTrajectories | None:
        # here: it loads the compiler
        from controllers.sampled_trajectories import sampled_trajectories

        return None if self._spec.pilot else sampled_trajectories(self._mppi)

    def corners(self) -> Corners | None:
        """Those of gates that were found in the last picture, where the vehicle has a gate
        camera."""
        return self._navigation.corners

    def close(self) -> None:
        self._plant.close()

    def _snapshot(self) -> PlannerSnapshot | None:
        from controllers.sampled_trajectories import take_snapshot

        return None if self._spec.pilot else take_snapshot(self._mppi)
