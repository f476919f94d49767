"""Spec: one flight, whole. The same record builds the flight and is stored with its run."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import asdict, dataclass, field, fields, is_dataclass
from functools import partial
from types import FunctionType
from typing import TYPE_CHECKING, Any

import numpy as np

from controllers.presets import Planner
from controllers.samplers import SAMPLERS
from quadsim.physics.domain_randomization import draw
from quadsim.race.clock import CLOCKS
from quadsim.race.events import Frame
from quadsim.race.flight import Controller, RefereeProtocol, fly
from quadsim.race.systems import SYSTEMS, SystemEntry

if TYPE_CHECKING:
    from controllers.mppi import MPPI
    from quadsim.physics.plant import Plant


@dataclass(frozen=True)
class OwnParts:
    """Objects of the user's own in place of named parts. A run keeps what they are called, not what they do.

    plant, controller, referee: an object for one flight, or a class or function that is called with the Spec.
    cost: a Cost, or a function of the default Cost that returns one.
    """

    system: SystemEntry | None = None
    cost: Any = None
    plant: Any = None
    controller: Any = None
    referee: Any = None

    def described(self) -> dict[str, dict]:
        """{role: {class, parameters}} of those that are given, as JSON."""
        given = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "system"}
        return {role: describe(part) for role, part in given.items() if part is not None}


@dataclass(frozen=True)
class Spec:
    """One flight, whole. Same spec, same machine: the same Run to the last bit.

    Made by `Spec.of("split_s_swift", sampler="gaussian", horizon=120)`; every setting of `race fly` is a keyword.
    """

    system: str  # of SYSTEMS
    course: Any  # Course, Corridor or PointGoal
    vehicle: Any
    sampler: str  # name, or the class name of the user's own
    preset: str
    planner: Planner
    model: Any  # the planner's model of the vehicle
    seed: int
    laps: int
    timeout: float  # [s]
    penalties: bool
    plant_dt: float  # [s]
    plant: str = "bullet"  # of physics.PLANTS; other systems are their own world
    randomize: float = 0.0  # size of domain randomization and disturbance, see quadsim.physics.domain_randomization
    clock: str = "simulated"  # of CLOCKS
    deadline_ms: float | None = None  # shrink the samples so that a plan takes no longer
    host: dict = field(default_factory=dict)  # what must not change a flight: threads, folders
    own: OwnParts = OwnParts()

    @classmethod
    def of(cls, course: Any = None, **settings: Any) -> Spec:
        """Names resolved, numbers checked; arguments as of `quadsim.fly`.

        Raises:
            SettingError: a ValueError of one line that names the setting.
            FileError: a course, vehicle or preset that cannot be read (a ValueError).
        """
        from quadsim.race.settings import resolve  # which makes a Spec

        return resolve(course, **settings)

    @property
    def entry(self) -> SystemEntry:
        return self.own.system or SYSTEMS[self.system]

    @property
    def streams(self) -> tuple[np.random.SeedSequence, ...]:
        return self.entry.streams(self.seed)

    def record(self) -> dict:
        """The JSON that a run keeps."""
        kept = {f.name: _plain(getattr(self, f.name)) for f in fields(self) if f.name not in ("course", "own")}
        kept |= {"course": self.course.name, "course_text": self.course.text}
        kept["variation"] = asdict(draw(self.streams[1], self.randomize if self.system == "quadrotor" else 0.0))
        own = self.own.described()
        if type(self.planner.sampling) not in SAMPLERS.values():
            own["sampler"] = describe(self.planner.sampling)
        if self.own.system:
            own["system"] = {"states": list(self.entry.states), "controls": list(self.entry.controls)}
        return kept | ({"own": own} if own else {})


def build(spec: Spec) -> tuple[Plant, Controller, RefereeProtocol]:
    """The world, the controller and the referee of one flight. The caller closes the plant.

    Raises ValueError where course, laps and vehicle do not fit together.
    """
    own, streams = spec.own, spec.streams
    referee = _made(own.referee, spec) or spec.entry.referee(spec)
    controller = _made(own.controller, spec) or planner_of(spec, streams[0])
    return _made(own.plant, spec) or spec.entry.plant(spec, streams), controller, referee


def planner_of(spec: Spec, stream: np.random.SeedSequence) -> MPPI:
    """The planner alone, drawing from this stream."""
    from controllers.adaptation import Adaptation
    from controllers.mppi import MPPI  # here: they load the compiler

    mppi = spec.planner.mppi
    cost, own = spec.entry.cost(spec), spec.own.cost
    if own is not None and own is not cost:
        cost = own(cost) if callable(own) else own
    adaptation = Adaptation(spec.model, mppi.dt) if mppi.adapt and spec.system == "quadrotor" else None
    system = spec.entry.system(spec.model, mppi.dt)
    return MPPI(system, cost, spec.planner.sampling, mppi, stream, adaptation)


def launch(spec: Spec, plant: Plant, controller: Any, referee: RefereeProtocol) -> Iterator[Frame]:
    """The frames of a flight that `build` made ready."""
    from controllers.deadline import Deadline
    from controllers.mppi import MPPI
    from controllers.sampled_trajectories import take_snapshot

    pilot = Deadline(controller, spec.deadline_ms) if spec.deadline_ms else controller
    snapshot = partial(take_snapshot, controller) if isinstance(controller, MPPI) else None
    return fly(plant, pilot, referee, spec.planner.mppi.dt, CLOCKS[spec.clock](), snapshot)


def frames(spec: Spec) -> Iterator[Frame]:
    """Fly: one Frame for each control step, the last one with the outcome. Whoever asks for frames sets the pace."""
    plant, controller, referee = build(spec)
    with closing(plant):
        yield from launch(spec, plant, controller, referee)


def describe(part: Any) -> dict:
    """{class, parameters} of a user's object, as JSON."""
    kind = part if _is_maker(part) else type(part)
    values = {} if kind is part else getattr(part, "__dict__", {})
    return {"class": f"{kind.__module__}.{kind.__qualname__}", "parameters": {k: _plain(v) for k, v in values.items()}}


def _is_maker(part: Any) -> bool:
    """A class or a function: called with the spec."""
    return isinstance(part, type | FunctionType)


def _made(part: Any, spec: Spec) -> Any:
    return part(spec) if _is_maker(part) else part


def _plain(value: Any) -> Any:
    """As JSON holds it; of other objects the class and its parameters."""
    if isinstance(value, str | int | float | bool) or value is None:
        return value
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
    return describe(value)
