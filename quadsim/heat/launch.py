"""Build the world, the planners and the marshal of a race, and simulate it."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from typing import cast

from controllers.costs.keep_clear import OtherVehicle, Room
from controllers.in_flight import PlannerInFlight
from controllers.samplers import Sampling
from quadsim.config.build import build, flight_frames, launched, planner_of
from quadsim.config.spec import Spec
from quadsim.heat.aware_planner import AwarePlanner, Eyes, Racecraft
from quadsim.heat.expectations import (
    OPPONENT_STEPS,
    ConstantVelocity,
    Expectation,
    Opponent,
    OwnPlans,
    ToldPlans,
)
from quadsim.heat.loop import (
    PlantInArena,
    RaceFrame,
    Started,
    Starter,
    in_turn,
    race_frames,
)
from quadsim.heat.marshal import Marshal, RaceReferee
from quadsim.heat.patience import Patience
from quadsim.heat.rules import RULES
from quadsim.heat.settings import Awareness
from quadsim.heat.side_by_side import SideBySide
from quadsim.heat.spec import HeatSpec
from quadsim.heat.traffic import Traffic
from quadsim.physics.downwash import Downwash
from quadsim.physics.plant import Arena, new_arena
from quadsim.racing.clock import PlanningClock
from quadsim.racing.flight import flight
from quadsim.racing.referee import Referee
from quadsim.streams import opponent_stream, sighting_stream

# Iterations of the first plan of another vehicle's flight
FIRST_ITERATIONS = 20
# Its effective sample size: a small one, as a poor plan gains more from the best samples
OPPONENT_ESS = 5.0


def heat_frames(
    heat: HeatSpec, watched: dict[int, AwarePlanner] | None = None
) -> Generator[RaceFrame, None, None]:
    """Build and simulate a race; yield a frame for each control step of each vehicle.

    A race of one is the flight of its spec.

    Args:
        heat: the race.
        watched: is given the planner of each vehicle when it starts, by number; a learned pilot has
            none.
    """
    if len(heat.entrants) == 1:
        for frame in flight_frames(heat.flown_spec(0)):
            yield RaceFrame(0, frame.t, frame)
        return
    first = heat.entrants[0].spec
    assert isinstance(first.plant, str)
    rules = RULES[heat.settings.rules]
    arena = new_arena(first.plant, heat.course, first.plant_dt, rules.collide)
    with closing(arena), SideBySide() as side_by_side:
        entrants = range(len(heat.entrants))
        streams = [sighting_stream(heat.seed, k) for k in entrants]
        traffic = Traffic(len(heat.entrants), heat.settings.sight, streams)
        starters = [_starter(heat, k, arena, traffic, watched) for k in entrants]
        radii = [entrant.spec.vehicle.radius for entrant in heat.entrants]
        marshal = Marshal(rules, [starter.referee for starter in starters], radii)
        make_plans = side_by_side if _may_plan_side_by_side(heat) else in_turn
        yield from race_frames(arena, starters, marshal, traffic, first.plant_dt, make_plans)


def _may_plan_side_by_side(heat: HeatSpec) -> bool:
    """Return whether the vehicles of a race may plan on several threads at once.

    On the wall clock each vehicle pays for its planning time, so it has the machine to itself
    meanwhile. A user's own controller or sampler may rely on being called on one thread.
    """
    specs = [entrant.spec for entrant in heat.entrants]
    on_wall_clock = any(spec.clock == "wall" for spec in specs)
    has_own_parts = any(
        spec.controller is not None or not isinstance(spec.planner.sampling, Sampling)
        for spec in specs
    )
    return not on_wall_clock and not has_own_parts


def _starter(
    heat: HeatSpec,
    k: int,
    arena: Arena,
    traffic: Traffic,
    watched: dict[int, AwarePlanner] | None,
) -> Starter:
    """Return entrant k on the start grid.

    Raises:
        SettingError: an object of the user's own cannot take its part.
        ValueError: course, laps and vehicle do not fit together.
    """
    spec = heat.flown_spec(k)
    referee = RaceReferee(
        Referee(
            spec.flown_course,
            spec.vehicle.radius,
            laps=spec.laps,
            timeout=spec.timeout,
            penalties=spec.penalties,
            patience=spec.patience,
        )
    )
    downwash = Downwash(spec.vehicle) if heat.settings.downwash else None
    start = partial(_start, heat, k, arena, traffic, referee, watched)
    return Starter(heat.start_time(k), referee, downwash, start)


def _start(
    heat: HeatSpec,
    k: int,
    arena: Arena,
    traffic: Traffic,
    referee: RaceReferee,
    watched: dict[int, AwarePlanner] | None,
) -> Started:
    """Put entrant k into the world, and begin its flight."""
    spec = heat.flown_spec(k)
    awareness = heat.awareness(k)
    others = other_vehicles(heat, k, awareness)
    minds = _minding(spec, others)
    parts = build(minds, arena, referee)
    steps = launched(minds, parts)

    planner = steps.controller
    if isinstance(planner, PlannerInFlight):
        clock = PlanningClock() if spec.clock == "wall" else steps.clock
        controller = AwarePlanner(
            planner,
            Eyes(k, traffic, heat.start_time(k), spec.course),
            expectation_of(heat, k, awareness, traffic),
            others,
            racecraft=_racecraft_of(awareness),
            tells=_is_asked_for_plans(heat, k),
        )
        steps = replace(steps, controller=controller, clock=clock)
        if watched is not None:
            watched[k] = controller
    # The plants of an arena can be pushed
    return Started(cast(PlantInArena, parts.plant), flight(**steps.arguments))


def _racecraft_of(awareness: Awareness) -> Racecraft:
    """Return the rules that an awareness asks for."""
    return Racecraft(
        ahead_share=awareness.ahead_share,
        patience=Patience(awareness.patience) if awareness.patience else None,
    )


def _minding(spec: Spec, others: dict[int, OtherVehicle]) -> Spec:
    """Return the flight whose planner also has the terms of other vehicles."""
    return replace(spec, terms=(*spec.terms, *(other.term for other in others.values())))


def is_compiled(heat: HeatSpec) -> bool:
    """Return whether all planners of a race were compiled on this machine before."""
    if len(heat.entrants) == 1:
        planners = [heat.flown_spec(0)]
    else:
        planners = [
            _minding(heat.flown_spec(k), other_vehicles(heat, k, heat.awareness(k)))
            for k in range(len(heat.entrants))
        ]
    return all(not spec.has_planner or planner_of(spec).is_cached for spec in planners)


def other_vehicles(heat: HeatSpec, k: int, awareness: Awareness) -> dict[int, OtherVehicle]:
    """Return the terms by which entrant k keeps clear of the others: number -> term."""
    spec = heat.entrants[k].spec
    if awareness.expect == "nothing" or spec.pilot or spec.controller:
        return {}
    numbers = [m for m in range(len(heat.entrants)) if m != k]
    return _clear_of(numbers, spec.planner.mppi.horizon, awareness)


def _clear_of(
    numbers: Sequence[int], horizon: int, awareness: Awareness
) -> dict[int, OtherVehicle]:
    """Return terms that keep clear of some vehicles: number -> term."""
    room = Room(
        weight=awareness.keep_weight,
        keep=awareness.keep,
        above=awareness.keep_above,
        below=awareness.keep_below,
    )
    # Terms are named by their order, so that the compiled loops are those of the number of others.
    return {m: OtherVehicle(n, room, horizon) for n, m in enumerate(numbers, 1)}


def expectation_of(
    heat: HeatSpec, k: int, awareness: Awareness, traffic: Traffic
) -> Expectation | None:
    """Return what entrant k expects of the others; None where it ignores them."""
    match awareness.expect:
        case "nothing":
            return None
        case "velocity":
            return ConstantVelocity()
        case "plans":
            return ToldPlans(traffic)
    noise = heat.settings.seen_velocity_noise
    return OwnPlans(k, partial(_opponent, heat, k), noise)


def _opponent(heat: HeatSpec, k: int, m: int) -> Opponent:
    """Return how entrant k plans the flight of entrant m: as its own, with fewer samples."""
    spec = heat.entrants[k].spec
    awareness = heat.awareness(k)
    mppi = replace(
        spec.planner.mppi,
        samples=awareness.own_samples,
        dt=OPPONENT_STEPS * spec.planner.mppi.dt,
        horizon=-(-spec.planner.mppi.horizon // OPPONENT_STEPS),
        iterations=1,
        first_iterations=FIRST_ITERATIONS,
        target_ess=OPPONENT_ESS,
    )
    others = _clear_of([n for n in range(len(heat.entrants)) if n != m], mppi.horizon, awareness)
    small = replace(
        spec,
        planner=replace(spec.planner, mppi=mppi),
        terms=tuple(other.term for other in others.values()),
        cost=None,
    )
    planner = planner_of(small, opponent_stream(heat.seed, k, m))
    return Opponent(planner, small.model, others)


def _is_asked_for_plans(heat: HeatSpec, k: int) -> bool:
    """Return whether another entrant expects to be told the plan of entrant k."""
    others = [m for m in range(len(heat.entrants)) if m != k]
    return any(heat.awareness(m).expect == "plans" for m in others)
