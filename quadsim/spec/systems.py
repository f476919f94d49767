"""SYSTEMS: what can be flown or driven, each with its model, default cost, plant, referee, presets,
columns and units.

An entry is functions of a Spec, so that one loop, one archive, one report and one campaign engine
serve every system. A new system is a file in quadsim/dynamics, a cost, presets and an entry here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np

from controllers.costs import Cost
from controllers.costs.corridor import corridor_cost
from controllers.costs.quadratic import quadratic_cost
from controllers.costs.race import race_cost
from controllers.costs.race_view import with_view
from controllers.costs.reference import ReferenceWeights, reference_cost
from controllers.paper_presets import DOUBLE_INTEGRATOR, OFFROAD
from controllers.presets import PRESETS, Planner
from quadsim.course import COURSES, load_course, parse_course
from quadsim.course.corridor import CORRIDORS, load_corridor, parse_corridor
from quadsim.course.point_goal import GOALS, load_point_goal, parse_point_goal
from quadsim.dynamics import System, quadrotor
from quadsim.files.data_files import names, read_text
from quadsim.files.strict_yaml import FileError
from quadsim.files.yaml_errors import did_you_mean
from quadsim.paper import double_integrator, offroad
from quadsim.paper.referees import CorridorReferee, DurationReferee
from quadsim.physics.domain_randomization import draw, gusts
from quadsim.physics.plant import PLANTS, ModelPlant, Plant, diffusion, start_state
from quadsim.race.referee import Referee
from quadsim.spec.reference import reference_of, stored_reference
from quadsim.streams import Streams, double_integrator_streams, offroad_streams, quadrotor_streams
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
        known = stored_reference(spec.course, spec.vehicle, spec.laps, weights, "runs")
        followed = reference_of(known, spec.vehicle, spec.planner.mppi.dt)
        return reference_cost(spec.course, spec.vehicle.radius, weights, followed)
    cost = race_cost(spec.course, spec.vehicle.radius, weights, spec.laps)
    if not (spec.sensing and spec.sensing.camera and spec.view_weight):
        return cost
    return with_view(cost, spec.view_weight)


def _race_timeout(course: Any, laps: int) -> float:
    """10 s to get going and 2 m/s along the straight lines between the gates [s]."""
    return 10.0 + laps * course.lap_length / 2.0


def _drive_start(spec: Any) -> tuple[float, ...]:
    """Standing at the corridor's start, heading along its first leg."""
    return (*spec.course.points[0], *spec.course.directions[0].tolist(), 0.0, 0.0, 0.0, 0.0)


def _drive_plant(spec: Any, streams: Streams) -> Plant:
    """The vehicle's own numbers with a random disturbance, in finer steps than the planner's
    model."""
    system = offroad.offroad(spec.vehicle, spec.plant_dt)
    std = tuple(spec.randomize * offroad.DISTURBANCE.get(name, 0.0) for name in system.states)
    rng = np.random.default_rng(streams.gusts)
    return ModelPlant(system, _drive_start(spec), diffusion(std, spec.plant_dt, rng))


def _point_start(spec: Any) -> tuple[float, ...]:
    return (*spec.course.start, *spec.course.velocity)


def _point_plant(spec: Any, streams: Streams) -> Plant:
    system = double_integrator.double_integrator(spec.plant_dt, spec.vehicle)
    return ModelPlant(system, _point_start(spec))


def _only(kind: str, *known: Any) -> Callable[[str], Any]:
    """A lookup by name among vehicles that are no files."""
    by_name = {vehicle.name: vehicle for vehicle in known}

    def find(name: str) -> Any:
        if name not in by_name:
            raise FileError(f"no {kind} {name!r}: {did_you_mean(name, by_name)}")
        return by_name[name]

    return find


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
    "offroad": SystemEntry(
        name="offroad",
        states=offroad.STATE_UNITS,
        controls=offroad.CONTROL_UNITS,
        folder=CORRIDORS,
        key="points",
        default_course="zigzag",
        default_preset="paper",
        plant_dt=0.005,
        presets=OFFROAD,
        load_course=load_corridor,
        parse_course=parse_corridor,
        vehicles=lambda: (offroad.DRIVEN.name,),
        load_vehicle=_only("off-road vehicle", offroad.DRIVEN),
        model_of=lambda vehicle: offroad.NOMINAL,
        system=offroad.offroad,
        cost=lambda s: corridor_cost(
            s.course, s.vehicle.half_width, s.planner.cost, s.planner.mppi.dt
        ),
        start=_drive_start,
        plant=_drive_plant,
        referee=lambda spec: CorridorReferee(spec.course, spec.vehicle.half_width, spec.timeout),
        timeout=lambda course, laps: 40.0,
        streams=offroad_streams,
    ),
    "double_integrator": SystemEntry(
        name="double_integrator",
        states=double_integrator.STATE_UNITS,
        controls=double_integrator.CONTROL_UNITS,
        folder=GOALS,
        key="goal",
        default_course="table2",
        default_preset="paper",
        plant_dt=None,
        presets=DOUBLE_INTEGRATOR,
        load_course=load_point_goal,
        parse_course=parse_point_goal,
        vehicles=lambda: (double_integrator.POINT.name,),
        load_vehicle=_only("point mass", double_integrator.POINT),
        model_of=lambda vehicle: replace(vehicle),
        system=lambda model, dt: double_integrator.double_integrator(dt, model),
        cost=lambda spec: quadratic_cost(spec.course.goal, spec.planner.cost),
        start=_point_start,
        plant=_point_plant,
        referee=lambda spec: DurationReferee(spec.timeout),
        timeout=lambda course, laps: course.duration,
        streams=double_integrator_streams,
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
