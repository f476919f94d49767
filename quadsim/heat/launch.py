"""Build the world, the planners and the marshal of a race, and simulate it."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Mapping
from contextlib import closing
from dataclasses import replace
from functools import partial
from typing import assert_never, cast

from quadsim.config.build import build, flight_frames, planner_of, racing_referee
from quadsim.config.own import fault_in_flight
from quadsim.config.spec import Spec
from quadsim.controllers.costs.keep_clear import Clearance, KeepClear
from quadsim.controllers.in_flight import PlannerInFlight
from quadsim.controllers.samplers import Sampling
from quadsim.dynamics.expected_path import OtherVehicle
from quadsim.heat.aware_planner import AwarePlanner, Perception, Tactics
from quadsim.heat.expectations import (
    OPPONENT_STEPS,
    AnnouncedPlans,
    ConstantVelocity,
    Expectation,
    OpponentModel,
    OwnPlans,
)
from quadsim.heat.loop import (
    HeatFrame,
    PlantInArena,
    Started,
    Starter,
    heat_loop,
    in_turn,
)
from quadsim.heat.marshal import HeatReferee, Marshal
from quadsim.heat.patience import Patience
from quadsim.heat.rules import RULES
from quadsim.heat.settings import Awareness
from quadsim.heat.side_by_side import SideBySide
from quadsim.heat.spec import HeatSpec
from quadsim.heat.traffic import Traffic
from quadsim.physics.downwash import Downwash
from quadsim.physics.plant import Arena, new_arena
from quadsim.racing.clock import PlanningClock
from quadsim.racing.flight import FlightParts, flight
from quadsim.streams import opponent_stream, sighting_stream

# Iterations of the first plan of an opponent's flight
FIRST_ITERATIONS = 20


def heat_frames(heat: HeatSpec) -> Generator[HeatFrame, None, None]:
    """Build and simulate a race; yield a frame for each control step of each vehicle.

    A race with a single entrant is the flight of its spec.
    """
    if len(heat.entrants) == 1:
        for frame in flight_frames(heat.flown_spec(0)):
            yield HeatFrame(0, frame.t, frame)
        return
    first = heat.entrants[0].spec
    assert isinstance(first.plant, str)
    rules = RULES[heat.settings.rules]
    arena = new_arena(first.plant, heat.course, first.plant_dt, rules.collide)
    with closing(arena), SideBySide() as side_by_side:
        entrants = range(len(heat.entrants))
        streams = [sighting_stream(heat.seed, k) for k in entrants]
        traffic = Traffic(len(heat.entrants), heat.settings.sight, streams)
        starters = [_starter(heat, k, arena, traffic) for k in entrants]
        radii = [entrant.spec.vehicle.radius for entrant in heat.entrants]
        marshal = Marshal(rules, [starter.referee for starter in starters], radii)
        make_plans = side_by_side if _may_plan_side_by_side(heat) else in_turn
        yield from heat_loop(arena, starters, marshal, traffic, first.plant_dt, make_plans)


def _may_plan_side_by_side(heat: HeatSpec) -> bool:
    """Return whether the vehicles of a race may plan on several threads at once.

    With the wall clock each vehicle is delayed by its planning time, so it must not share the
    machine while it plans. A user's own controller or sampler may not support several threads.
    """
    specs = [entrant.spec for entrant in heat.entrants]
    on_wall_clock = any(spec.clock == "wall" for spec in specs)
    has_own_parts = any(
        spec.controller is not None or not isinstance(spec.planner.sampling, Sampling)
        for spec in specs
    )
    return not on_wall_clock and not has_own_parts


def _starter(heat: HeatSpec, k: int, arena: Arena, traffic: Traffic) -> Starter:
    """Return entrant k on the start grid.

    Raises:
        SettingError: one of the user's own objects does not fit its role.
        ValueError: course, laps and vehicle do not fit together.
    """
    spec = heat.flown_spec(k)
    referee = HeatReferee(racing_referee(spec))
    downwash = Downwash(spec.vehicle) if heat.settings.downwash else None
    return Starter(
        start_time=heat.start_time(k),
        referee=referee,
        downwash=downwash,
        start=partial(_start, heat, k, arena, traffic, referee),
        fault=partial(_fault, spec),
    )


def _fault(spec: Spec, error: Exception) -> str | None:
    """Return the text of an error that ends the flight of a spec; see `fault_in_flight`."""
    return fault_in_flight(error, bool(spec.own_objects()))


def _start(heat: HeatSpec, k: int, arena: Arena, traffic: Traffic, referee: HeatReferee) -> Started:
    """Put entrant k into the world, begin its flight, and return it."""
    # The planner's cost has a term for each other vehicle.
    terms = keep_clear_terms(heat, k)
    spec = with_terms(heat.flown_spec(k), terms)
    parts = build(spec, arena, referee)
    others = _no_others
    if isinstance(parts.controller, PlannerInFlight):
        planner = aware_planner(heat, k, parts.controller, traffic, terms)
        others = planner.last_others
        parts = _with_planner(parts, planner, spec.clock)
    # The plants of an arena can be pushed.
    plant = cast(PlantInArena, parts.plant)
    return Started(plant, flight(parts), others)


def _no_others() -> tuple[OtherVehicle, ...]:
    """Return no vehicle, because learned pilots and users' own controllers predict none."""
    return ()


def _with_planner(parts: FlightParts, planner: AwarePlanner, clock: str) -> FlightParts:
    """Return a flight with this planner, which is delayed by its own planning time only."""
    if clock == "wall":
        return replace(parts, controller=planner, clock=PlanningClock())
    return replace(parts, controller=planner)


def aware_planner(
    heat: HeatSpec,
    k: int,
    planner: PlannerInFlight,
    traffic: Traffic,
    terms: Mapping[int, KeepClear],
) -> AwarePlanner:
    """Return the planner of entrant k, which keeps clear of the others.

    Args:
        heat: the race.
        k: index of the entrant.
        planner: planner of the entrant, whose cost has the terms.
        traffic: states and announced plans of all vehicles.
        terms: the cost term for the clearance from each vehicle, by the vehicle's number.
    """
    awareness = heat.awareness(k)
    return AwarePlanner(
        planner,
        Perception(k, traffic, heat.start_time(k), heat.course),
        expectation_of(heat, k, traffic),
        terms,
        tactics=_tactics(awareness),
        announces=_announces(heat, k),
    )


def _tactics(awareness: Awareness) -> Tactics:
    """Return the tactics of an awareness."""
    return Tactics(
        ahead_share=awareness.ahead_share,
        patience=Patience(awareness.patience) if awareness.patience else None,
    )


def _announces(heat: HeatSpec, k: int) -> bool:
    """Return whether entrant k announces its plans, because another entrant uses them."""
    others = [m for m in range(len(heat.entrants)) if m != k]
    return any(heat.awareness(m).expect == "plans" for m in others)


def is_compiled(heat: HeatSpec) -> bool:
    """Return whether all planners of a race were compiled on this machine before."""
    entrants = range(len(heat.entrants))
    specs = [with_terms(heat.flown_spec(k), keep_clear_terms(heat, k)) for k in entrants]
    return all(not spec.has_planner or planner_of(spec).is_cached for spec in specs)


def with_terms(spec: Spec, terms: Mapping[int, KeepClear]) -> Spec:
    """Return a flight whose planner's cost also has these terms."""
    return replace(spec, terms=(*spec.terms, *terms.values()))


def keep_clear_terms(heat: HeatSpec, k: int) -> dict[int, KeepClear]:
    """Return the cost terms for the clearance of entrant k, by the other vehicle's number."""
    spec = heat.entrants[k].spec
    awareness = heat.awareness(k)
    if awareness.expect == "nothing" or spec.pilot or spec.controller:
        return {}
    others = [m for m in range(len(heat.entrants)) if m != k]
    return _keep_clear_of(others, len(spec.planner.mppi.step_lengths), awareness)


def _keep_clear_of(
    vehicles: Iterable[int], horizon: int, awareness: Awareness
) -> dict[int, KeepClear]:
    """Return cost terms for the clearance from some vehicles, by number."""
    assert awareness.keep is not None  # a HeatSpec holds the number
    clearance = Clearance(
        weight=awareness.keep_weight,
        keep=awareness.keep,
        above=awareness.keep_above,
        below=awareness.keep_below,
    )
    # Terms are named by their order, so that all races of as many vehicles share compiled loops.
    return {m: KeepClear(m, f"clear_of_{n}", clearance, horizon) for n, m in enumerate(vehicles, 1)}


def expectation_of(heat: HeatSpec, k: int, traffic: Traffic) -> Expectation | None:
    """Return the prediction of other vehicles by entrant k, None if it ignores them."""
    match heat.awareness(k).expect:
        case "nothing":
            return None
        case "velocity":
            return ConstantVelocity()
        case "plans":
            return AnnouncedPlans(traffic)
        case "own":
            noise = heat.settings.seen_velocity_noise
            return OwnPlans(k, partial(_opponent, heat, k), noise)
        case unknown:
            assert_never(unknown)


def _opponent(heat: HeatSpec, k: int, m: int) -> OpponentModel:
    """Return the planner with which entrant k predicts the flight of entrant m.

    It is the planner of entrant k with fewer samples. Settings of entrant k that act through its
    cost therefore act on the prediction as well.
    """
    spec = heat.entrants[k].spec
    awareness = heat.awareness(k)
    mppi = replace(
        spec.planner.mppi,
        samples=awareness.own_samples,
        dt=OPPONENT_STEPS * spec.planner.mppi.dt,
        horizon=-(-spec.planner.mppi.horizon // OPPONENT_STEPS),
        iterations=1,
        first_iterations=FIRST_ITERATIONS,
    )
    others = [n for n in range(len(heat.entrants)) if n != m]
    terms = _keep_clear_of(others, len(mppi.step_lengths), awareness)
    small = replace(
        spec,
        planner=replace(spec.planner, mppi=mppi),
        terms=tuple(terms.values()),
        cost=None,
    )
    planner = planner_of(small, opponent_stream(heat.seed, k, m))
    return OpponentModel(planner, small.model)
