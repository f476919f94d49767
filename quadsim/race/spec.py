"""What to fly, resolved: names become course, vehicle and planner; the same record builds the flight and is stored."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from functools import partial

import numpy as np

from controllers.adaptation import Adaptation
from controllers.costs.race import race_cost
from controllers.deadline import Deadline
from controllers.mppi import MPPI, build_mppi
from controllers.presets import Planner
from controllers.sampled_trajectories import take_snapshot
from quadsim.course import Course
from quadsim.physics.domain_randomization import draw, gusts
from quadsim.physics.plant import PLANTS, Plant, default_plant
from quadsim.race.clock import CLOCKS
from quadsim.race.events import Frame
from quadsim.race.flight import fly
from quadsim.race.referee import Referee
from quadsim.systems.quadrotor import ModelParams, quadrotor
from quadsim.vehicle import Vehicle


@dataclass(frozen=True)
class Spec:
    """One flight, whole. Same spec, same machine: the same Run to the last bit."""

    course: Course
    vehicle: Vehicle
    sampler: str
    preset: str
    planner: Planner
    model: ModelParams
    seed: int
    laps: int
    timeout: float  # [s]
    penalties: bool
    plant_dt: float  # [s]
    randomize: float = 0.0  # size of the domain randomization, see quadsim.physics.domain_randomization
    clock: str = "simulated"  # see quadsim.race.clock.CLOCKS
    deadline_ms: float | None = None  # shrink the samples so that a plan takes no longer
    host: dict = field(default_factory=dict)  # what must not change a flight: threads, folders

    def record(self) -> dict:
        """The JSON that a run keeps."""
        spec = asdict(self)
        variation = asdict(draw(streams(self.seed)[1], self.randomize))  # stored runs have it under this key
        spec.update(course=self.course.name, course_text=self.course.text, variation=variation)
        return spec


def launch(spec: Spec, plant: Plant, controller: MPPI, referee: Referee) -> Iterator[Frame]:
    """The frames of a flight that `build` made ready."""
    pilot = Deadline(controller, spec.deadline_ms) if spec.deadline_ms else controller
    picture = partial(take_snapshot, controller)
    return fly(plant, pilot, referee, spec.planner.mppi.dt, CLOCKS[spec.clock](), picture)


def build(spec: Spec) -> tuple[Plant, MPPI, Referee]:
    """The plant, the controller and the referee of one flight. The caller closes the plant."""
    stream, disturbance, wind = streams(spec.seed)
    referee = Referee(spec.course, spec.vehicle.radius, spec.laps, spec.timeout, spec.penalties)
    return _plant(spec, disturbance, wind), controller_of(spec, stream), referee


def controller_of(spec: Spec, stream: np.random.SeedSequence) -> MPPI:
    """The planner alone, drawing from this stream."""
    mppi = spec.planner.mppi
    cost = race_cost(spec.course, spec.vehicle.radius, spec.planner.cost, spec.laps)
    key = stream.generate_state(2, np.uint32)
    system, adaptation = quadrotor(spec.model, mppi.dt), Adaptation(spec.model, mppi.dt) if mppi.adapt else None
    return build_mppi(system, cost, spec.sampler, spec.planner.sampling, mppi, key, adaptation)


def streams(seed: int) -> tuple[np.random.SeedSequence, ...]:
    """The random streams of the planner, the domain randomization and the gusts: independent, so that every planner
    flies a seed under the same disturbances."""
    planner, plant = np.random.SeedSequence(seed).spawn(2)
    return planner, *plant.spawn(2)


def _plant(spec: Spec, disturbance: np.random.SeedSequence, wind: np.random.SeedSequence) -> Plant:
    plant = PLANTS[default_plant()]
    if spec.randomize == 0:
        return plant(spec.course, spec.vehicle, spec.plant_dt)
    drawn = draw(disturbance, spec.randomize)
    return plant(
        spec.course,
        drawn.vehicle(spec.vehicle),
        spec.plant_dt,
        start=drawn.start(spec.course.start),
        body=drawn.body(spec.vehicle),
        gusts=gusts(wind, drawn.gust, spec.plant_dt),
    )
