"""Spec: one flight, whole. The same record builds the flight and is stored with its run."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import asdict, dataclass, field, fields
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from controllers.presets import Planner
from controllers.samplers import SAMPLERS
from quadsim.physics.domain_randomization import draw
from quadsim.race.clock import CLOCKS
from quadsim.race.events import Frame
from quadsim.race.flight import Controller, RefereeProtocol, fly
from quadsim.race.own_parts import OwnParts, describe, made, plain
from quadsim.race.resolve import resolve
from quadsim.race.settings import SettingError
from quadsim.race.systems import SYSTEMS, SystemEntry

if TYPE_CHECKING:
    from controllers.mppi import MPPI
    from quadsim.physics.plant import Plant


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
    plant: str = "model"  # of physics.plant.PLANTS; model: the system is its own world
    randomize: float = 0.0  # size of domain randomization and disturbance, see quadsim.physics.domain_randomization
    clock: str = "simulated"  # of CLOCKS
    deadline_ms: float | None = None  # shrink the samples so that a plan takes no longer
    host: dict = field(default_factory=dict)  # what must not change a flight: threads, folders
    own: OwnParts = field(default_factory=OwnParts)

    @classmethod
    def of(cls, course: Any = None, **settings: Any) -> Spec:
        """Names resolved, numbers checked. Raises SettingError (a ValueError): one line that names the setting."""
        return cls(**resolve(course, **settings))

    @property
    def entry(self) -> SystemEntry:
        return self.own.system or SYSTEMS[self.system]

    @property
    def streams(self) -> tuple[np.random.SeedSequence, ...]:
        return self.entry.streams(self.seed)

    def record(self) -> dict:
        """The JSON that a run keeps."""
        kept = {f.name: plain(getattr(self, f.name)) for f in fields(self) if f.name not in ("course", "own")}
        kept |= {"course": self.course.name, "course_text": self.course.text}
        kept["variation"] = asdict(draw(self.streams[1], self.randomize if self.system == "quadrotor" else 0.0))
        own = self.own.described()
        if type(self.planner.sampling) not in SAMPLERS.values():
            own["sampler"] = describe(self.planner.sampling)
        if self.own.system:
            own["system"] = {"states": list(self.entry.states), "controls": list(self.entry.controls)}
        return kept | ({"own": own} if own else {})


def with_threads(spec: Spec) -> Spec:
    """The spec, whose number of threads (None: every core) is used from now on. Raises SettingError."""
    from controllers.rollout.threads import use_threads  # which loads the compiler

    try:
        spec.host["threads"] = use_threads(spec.host["threads"])
    except ValueError as error:  # "threads: expected ..."
        raise SettingError(*str(error).split(": ", 1)) from None
    return spec


def build(spec: Spec) -> tuple[Plant, Controller, RefereeProtocol]:
    """The world, the controller and the referee of one flight. The caller closes the plant.

    Raises ValueError where course, laps and vehicle do not fit together.
    """
    own, streams = spec.own, spec.streams
    referee = made(own.referee, spec) or spec.entry.referee(spec)
    controller = made(own.controller, spec) or planner_of(spec, streams[0])
    return made(own.plant, spec) or spec.entry.plant(spec, streams), controller, referee


def planner_of(spec: Spec, stream: np.random.SeedSequence) -> MPPI:
    """The planner alone, drawing from this stream."""
    from controllers.adaptation import Adaptation
    from controllers.mppi import MPPI  # here: they load the compiler

    mppi = spec.planner.mppi
    cost: Any = spec.entry.cost(spec)
    if spec.own.cost is not None:
        cost = spec.own.cost(cost) if callable(spec.own.cost) else spec.own.cost
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
