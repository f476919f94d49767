"""SYSTEMS: what can be flown or driven, each with its model, default cost, plant, referee, presets,
columns and units.

An entry is functions of a Spec, so that one loop, one archive, one report and one campaign engine
serve every system. A new system is a file in quadsim/dynamics, a cost, presets and an entry here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from controllers.costs import Cost
from controllers.costs.race import race_cost
from controllers.costs.race_view import with_view
from controllers.costs.reference import ReferenceWeights, reference_cost
from controllers.presets import PRESETS, Planner
from quadsim.course import COURSES, load_course, parse_course
from quadsim.dynamics import System, quadrotor
from quadsim.files.data_files import names, read_text
from quadsim.physics.domain_randomization import draw, gusts
from quadsim.physics.plant import PLANTS, Plant, start_state
from quadsim.race.referee import Referee
from quadsim.spec.reference import reference_of, stored_reference
from quadsim.streams import Streams, quadrotor_streams
from quadsim.vehicle import load_vehicle, vehicle_names


@dataclass(frozen=True)
class SystemEntry:
    """One system: its numbers, and how a Spec (quadsim.spec.spec) becomes what flies."""

    name: str
    states: Mapping[str, str]  # name -> unit
    controls: Mapping[str, str]
    folder: Path  # of its courses
    key: str  # that only its course files have
    default_course: str
    default_preset: str
    plant_dt: float | None  # step of the simulated world [s]; None: the control period
    presets: Mapping[str, Mapping[str, Planner]]
    load_course: Callable[[str], Any]
    parse_course: Callable[[str, str], Any]
    vehicles: Callable[[], tuple[str, ...]]
    load_vehicle: Callable[[str], Any]
    model_of: Callable[[Any], Any]  # what the planner assumes of a vehicle
    system: Callable[[Any, float], System]  # of such a model, at a control period [s]
    cost: Callable[[Any], Cost]
    start: Callable[[Any], tuple[float, ...]]  # state
    plant: Callable[[Any, Streams], Plant]
    referee: Callable[[Any], Any]
    timeout: Callable[[Any, int], float]  # of a course and a number of laps [s]
    streams: Callable[[int], Streams]  # of a seed

    @property
    def columns(self) -> dict[str, str]:
        """Telemetry column -> unit."""
        return telemetry_columns(self.states, self.controls)

    @property
    def control_units(self) -> str:
        return ", ".join(self.controls.values())

    @property
    def courses(self) -> tuple[str, ...]:
        """Names of the courses that come with the project."""
        return names(self.folder)


def telemetry_columns(states: Mapping[str, str], controls: Mapping[str, str]) -> dict[str, str]:
    """Telemetry column -> unit, in order."""
    counted = dict.fromkeys(("passed", "lap", "ess", "temperature", "cost"), "1")
    return {"t": "s", **states, **controls, **counted, "plan_ms": "ms"}


def _race_plant(spec: Any, streams: Streams) -> Plant:
    """A quadrotor among gates, its vehicle, start and gusts randomized by the seed."""
    build, course = PLANTS[spec.plant], spec.flown_course
    if spec.randomize == 0:
        return build(course, spec.vehicle, spec.plant_dt)
    varied = draw(streams.vehicle, spec.randomize)
    return build(
        course,
        varied.vehicle(spec.vehicle),
        spec.plant_dt,
        start=varied.start(spec.course.start),
        body=varied.body(spec.vehicle),
        gusts=gusts(streams.gusts, varied.gust, spec.plant_dt),
    )


def _race_cost(spec: Any) -> Cost:
    """Of the planner's map; where a camera has to find gates, with a nose that points where the
    vehicle flies."""
    weights = spec.planner.cost
    if isinstance(weights, ReferenceWeights):
        known = stored_reference(spec.course, spec.vehicle, spec.laps, weights)
        followed = reference_of(known, spec.vehicle, spec.planner.mppi.dt)
        return reference_cost(spec.course, spec.vehicle.radius, weights, followed)
    cost = race_cost(spec.course, spec.vehicle.radius, weights, spec.laps)
    if not (spec.sensing and spec.sensing.camera and spec.view_weight):
        return cost
    return with_view(cost, spec.view_weight)


def _race_timeout(course: Any, laps: int) -> float:
    """10 s to get going and 2 m/s along the straight lines between the gates [s]."""
    return 10.0 + laps * course.lap_length / 2.0


SYSTEMS: dict[str, SystemEntry] = {
    "quadrotor": SystemEntry(
        name="quadrotor",
        states=quadrotor.STATE_UNITS,
        controls=quadrotor.CONTROL_UNITS,
        folder=COURSES,
        key="gates",
        default_course="split_s_swift",
        default_preset="race",
        plant_dt=1 / 400,
        presets=PRESETS,
        load_course=load_course,
        parse_course=parse_course,
        vehicles=vehicle_names,
        load_vehicle=load_vehicle,
        model_of=quadrotor.ModelParams.of,
        system=quadrotor.quadrotor,
        cost=_race_cost,
        start=lambda spec: start_state(spec.course.start, spec.vehicle.radius),
        plant=_race_plant,
        referee=lambda spec: Referee(
            spec.flown_course, spec.vehicle.radius, spec.laps, spec.timeout, spec.penalties
        ),
        timeout=_race_timeout,
        streams=quadrotor_streams,
    ),
}


def system_of_course(name_or_path: str) -> str:
    """The system that a course is made for: by the folder its name lies in, or by a key of the
    file.

    A misspelt name is for the system of the course it is closest to, whose loader then proposes
    that course.
    """
    made_for = {course: name for name, entry in SYSTEMS.items() for course in entry.courses}
    if name_or_path in made_for:
        return made_for[name_or_path]
    path = Path(name_or_path)
    try:  # a pipe can be read once, a device without an end
        lines = read_text(path).splitlines() if path.is_file() else None
    except (OSError, ValueError):
        lines = None
    if lines is None:
        return next(
            (made_for[course] for course in get_close_matches(name_or_path, made_for, 1)),
            "quadrotor",
        )
    keys = {line.partition(":")[0] for line in lines}
    return next((name for name, entry in SYSTEMS.items() if entry.key in keys), "quadrotor")
