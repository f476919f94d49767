"""The flags of a flight, shared by every command that flies: what to fly, and every number of the planner."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Annotated

from msgspec import Meta
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, Positional, arg

from controllers.costs.race import RaceWeights
from controllers.mppi import MPPIConfig
from controllers.presets import Planner, faults
from controllers.samplers import SAMPLERS, SamplerConfig
from quadsim.app.flags import UsageError, check, flag
from quadsim.app.preset_file import load_planner
from quadsim.app.spec import Spec
from quadsim.course import Course, load_course
from quadsim.flight import whole_multiple
from quadsim.strict_yaml import unit
from quadsim.systems.quadrotor import Belief, Lag, Rate
from quadsim.vehicle import Vehicle, load_vehicle
from quadsim.yaml_words import did_you_mean

Axes = Annotated[tuple[Lag, Lag, Lag] | None, arg(metavar="X Y Z")]


@dataclass(frozen=True)
class ModelFlags:
    """What the planner believes of the vehicle. Left out: what the vehicle is."""

    rate_tau: tuple[Lag, Lag, Lag] | None = None  # lag of the body rates about x, y, z [s]
    thrust_tau: Lag | None = None  # lag of the thrust [s]
    drag: Annotated[float, unit("1/s", ge=0, le=20)] | None = None  # linear, isotropic [1/s]
    rate_max: tuple[Rate, Rate, Rate] | None = None  # limit of the body-rate commands [rad/s]
    thrust_max: Annotated[float, unit("m/s^2", ge=0, le=1000)] | None = None  # mass-normalised limit [m/s^2]


@dataclass(frozen=True)
class FlightFlags:
    """One flight, as the command line says it."""

    course: Positional[str] = "split_s_swift"  # a name of `race courses`, or a FILE.yaml
    sampler: Annotated[str, arg(metavar="{colored,gaussian}")] = "colored"  # what the perturbations are
    preset: Annotated[str, arg(metavar="{paper,race,FILE.yaml}")] = "race"  # every planner number not given here
    vehicle: str | None = None  # a name of `race vehicles`, or a FILE.yaml; else the preset's
    laps: Annotated[int, Meta(ge=1, le=1000)] | None = None  # else the course's
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] = 0  # of everything random
    timeout: Annotated[float, unit("s", gt=0, le=1e5)] | None = None  # else 10 s and .5 s a metre of the laps [s]
    penalties: FlagCreatePairsOff[bool] = False  # a hit costs 3 s instead of ending the flight
    plant_dt: Annotated[float, unit("s", gt=0, le=0.02)] = 0.0025  # the world's step [s]
    sampling: OmitArgPrefixes[SamplerConfig] = field(default_factory=SamplerConfig)
    mppi: OmitArgPrefixes[MPPIConfig] = field(default_factory=MPPIConfig)
    cost: OmitArgPrefixes[RaceWeights] = field(default_factory=RaceWeights)
    model: ModelFlags = field(default_factory=ModelFlags)

    @classmethod
    def defaults(cls, argv: Sequence[str]) -> FlightFlags:
        """The numbers of the preset and sampler that argv asks for. Raises UsageError, FileError."""
        sampler, preset = _last(argv, "--sampler", cls.sampler), _last(argv, "--preset", cls.preset)
        if sampler not in SAMPLERS:
            raise UsageError(f"--sampler: no sampler {sampler!r}: {did_you_mean(sampler, SAMPLERS)}")
        p = load_planner(preset, sampler)
        return cls(sampler=sampler, preset=preset, vehicle=p.vehicle, sampling=p.sampling, mppi=p.mppi, cost=p.cost)

    def spec(self, host: dict) -> Spec:
        """Names resolved, numbers checked. Raises UsageError, FileError."""
        check(self)
        course, vehicle = load_course(self.course), load_vehicle(self.vehicle or "swift")
        planner = Planner(self.vehicle or "swift", self.sampling, self.mppi, self.cost)
        for path, problem in faults(planner):
            raise UsageError(f"{flag(path)}: {problem}")
        try:
            whole_multiple(self.mppi.dt, self.plant_dt)
        except ValueError as error:
            raise UsageError(f"--{error}") from None
        laps = self.laps or course.laps
        return Spec(
            course=course,
            vehicle=vehicle,
            sampler=self.sampler,
            preset=self.preset,
            planner=planner,
            belief=self._belief(vehicle),
            seed=self.seed,
            laps=laps,
            timeout=self.timeout or default_timeout(course, laps),
            penalties=self.penalties,
            plant_dt=self.plant_dt,
            host=host,
        )

    def _belief(self, vehicle: Vehicle) -> Belief:
        said = {key: number for key, number in vars(self.model).items() if number is not None}
        belief = replace(Belief.of(vehicle), **said)
        check(belief, "model.")
        return belief


def default_timeout(course: Course, laps: int) -> float:
    """10 s to get going and 2 m/s along the straight lines between the gates [s]."""
    return 10.0 + laps * course.lap_length / 2.0


def _last(argv: Sequence[str], name: str, default: str) -> str:
    """What argv says after this flag, the last time it does."""
    words = [w for arg in argv for w in (arg.split("=", 1) if arg.startswith(f"{name}=") else [arg])]
    values = [b for a, b in pairwise(words) if a == name]
    return values[-1] if values else default
