"""The flags of a flight, shared by every command that flies: what to fly, and every number of the planner."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Literal

from msgspec import Meta
from tyro.conf import DisallowNone, FlagCreatePairsOff, OmitArgPrefixes, Positional, arg
from tyro.extras import literal_type_from_choices

from controllers.config import MPPIConfig
from controllers.costs.race import RaceWeights
from controllers.presets import PRESETS, Planner, faults, preset
from controllers.rollout.threads import use_threads
from controllers.samplers import SAMPLERS
from quadsim.app.flags import UsageError, check, flag, otherwise
from quadsim.app.preset_file import SamplingNumbers, load_planner
from quadsim.course import Course, load_course
from quadsim.files.strict_yaml import unit
from quadsim.files.yaml_words import did_you_mean
from quadsim.race.flight import whole_multiple
from quadsim.race.spec import Spec
from quadsim.systems.quadrotor import Drag, Lag, ModelParams, Rate, Thrust, TiltCost
from quadsim.vehicle import Vehicle, load_vehicle, with_thrust_to_weight

if TYPE_CHECKING:
    SamplerName = str
else:
    SamplerName = literal_type_from_choices(SAMPLERS)  # so that shells complete it
Laps = Annotated[int, Meta(ge=1, le=1000)]
Count = Annotated[int, Meta(ge=1)]
Limit = Annotated[float, unit("s", gt=0, le=1e5)]
Ratio = Annotated[float, Meta(gt=1, le=20)]
Size = Annotated[float, Meta(ge=0, le=3)]
Millis = Annotated[float, unit("ms", gt=0, le=1e4)]
THE_VEHICLES = otherwise("the vehicle's")
_SAMPLING = SamplingNumbers.of(preset("race", "colored").sampling)


@dataclass(frozen=True)
class ModelFlags:
    """What the planner believes of the vehicle; left out: what the vehicle is."""

    rate_tau: Annotated[tuple[Lag, Lag, Lag] | None, THE_VEHICLES] = None  # lag of the body rates about x, y, z [s]
    motor_tau: Annotated[Lag | None, THE_VEHICLES] = None  # lag of the rotors, for thrust and torque [s]
    drag: Annotated[Drag | None, THE_VEHICLES] = None  # linear, isotropic [1/s]
    rate_max: Annotated[tuple[Rate, Rate, Rate] | None, THE_VEHICLES] = None  # limit of the rate commands [rad/s]
    tilt_cost: Annotated[tuple[TiltCost, TiltCost] | None, THE_VEHICLES] = None  # thrust given up to tilt [m]
    thrust_max: Annotated[Thrust | None, THE_VEHICLES] = None  # mass-normalised limit [m/s^2]


@dataclass(frozen=True)
class FlightFlags:
    """One flight, as the command line says it."""

    course: Annotated[str, Positional, arg(metavar="COURSE")] = "split_s_swift"  # see `race courses`, or a FILE.yaml
    sampler: Annotated[SamplerName, arg(metavar="|".join(SAMPLERS))] = "colored"  # of the perturbations
    preset: Annotated[str, arg(metavar="|".join((*PRESETS, "FILE.yaml")))] = "race"  # of every number not given here
    vehicle: Annotated[str, arg(metavar="NAME|FILE.yaml")] = "swift"  # see `race vehicles`
    thrust_to_weight: Annotated[Ratio | None, DisallowNone, THE_VEHICLES] = None  # stronger or weaker propellers
    laps: Annotated[Laps | None, DisallowNone, otherwise("the course's")] = None  # from the standing start
    seed: Annotated[int, Meta(ge=0, le=10**9)] = 0  # of everything random
    randomize: Size = 0.0  # size of the seed's start offset, vehicle tolerances and gusts: 1 is a careful day outdoors
    timeout: Annotated[Limit | None, DisallowNone, otherwise("10 s and 1 s for every 2 m")] = None  # of the flight [s]
    threads: Annotated[Count | None, DisallowNone, otherwise("every core")] = None  # results do not depend on it
    penalties: FlagCreatePairsOff[bool] = False  # a hit costs 3 s instead of ending the flight
    plant_dt: Annotated[float, unit("s", gt=0, le=0.02)] = 0.0025  # step of the simulated world [s]
    clock: Literal["simulated", "wall"] = "simulated"  # wall: the world does not wait for the planner
    deadline_ms: Annotated[Millis | None, DisallowNone, otherwise("none")] = None  # shrink the samples to hold it [ms]
    sampling: OmitArgPrefixes[SamplingNumbers] = field(default_factory=lambda: _SAMPLING)
    mppi: OmitArgPrefixes[MPPIConfig] = field(default_factory=MPPIConfig)
    cost: OmitArgPrefixes[RaceWeights] = field(default_factory=RaceWeights)
    model: DisallowNone[ModelFlags] = field(default_factory=ModelFlags)

    @classmethod
    def defaults(cls, argv: Sequence[str]) -> FlightFlags:
        """The numbers of the preset and sampler that argv asks for. Raises UsageError, FileError."""
        sampler, name = _last(argv, "--sampler", cls.sampler), _last(argv, "--preset", cls.preset)
        if sampler not in SAMPLERS:
            raise UsageError(f"--sampler: no sampler {sampler!r}: {did_you_mean(sampler, SAMPLERS)}")
        p = load_planner(name, sampler)
        sampling = SamplingNumbers.of(p.sampling)
        return cls(sampler=sampler, preset=name, vehicle=p.vehicle, sampling=sampling, mppi=p.mppi, cost=p.cost)

    def spec(self) -> Spec:
        """Names resolved, numbers checked. Raises UsageError, FileError."""
        check(self)
        course, vehicle = load_course(self.course), load_vehicle(self.vehicle)
        if self.thrust_to_weight:
            vehicle = with_thrust_to_weight(vehicle, self.thrust_to_weight)
        planner = Planner(self.vehicle, self.sampling.of_sampler(self.sampler), self.mppi, self.cost)
        for path, problem in faults(planner):
            raise UsageError(f"{flag(path)}: {problem}")
        try:
            whole_multiple(self.mppi.dt, self.plant_dt)
            threads = use_threads(self.threads)
        except ValueError as error:  # "dt: expected ..."
            raise UsageError(f"--{error}") from None
        laps = self.laps or course.laps
        return Spec(
            course=course,
            vehicle=vehicle,
            sampler=self.sampler,
            preset=self.preset,
            planner=planner,
            model=self._model(vehicle),
            seed=self.seed,
            laps=laps,
            timeout=self.timeout or default_timeout(course, laps),
            penalties=self.penalties,
            plant_dt=self.plant_dt,
            randomize=self.randomize,
            clock=self.clock,
            deadline_ms=self.deadline_ms,
            host={"threads": threads},
        )

    def _model(self, vehicle: Vehicle) -> ModelParams:
        said = {key: number for key, number in vars(self.model).items() if number is not None}
        model = replace(ModelParams.of(vehicle), **said)
        check(model, "model.")
        return model


def default_timeout(course: Course, laps: int) -> float:
    """10 s to get going and 2 m/s along the straight lines between the gates [s]."""
    return 10.0 + laps * course.lap_length / 2.0


def _last(argv: Sequence[str], name: str, default: str) -> str:
    """What argv says after this flag, the last time it does."""
    words = [w for arg in argv for w in (arg.split("=", 1) if arg.startswith(f"{name}=") else [arg])]
    values = [b for a, b in pairwise(words) if a == name]
    return values[-1] if values else default
