"""The loop of a race: several flights in one world with common physics steps.

In each physics step every flight (quadsim.racing.flight) continues until it requests the next step.
Vehicles whose control period has ended plan first, all with the information of that instant. Then
all forces are applied, the world makes its step, and the marshal checks all vehicles before their
own referees do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain, count
from typing import NamedTuple, Protocol

from quadsim.dynamics.expected_path import OtherVehicle
from quadsim.dynamics.quadrotor import State
from quadsim.heat.marshal import HeatReferee, Marshal, Move
from quadsim.heat.traffic import Traffic
from quadsim.physics.downwash import Downwash
from quadsim.physics.plant import Arena
from quadsim.physics.plant_state import PlantState
from quadsim.racing.events import Frame
from quadsim.racing.flight import PhysicsStep, Planning
from quadsim.rotation import Vec3


class PlantInArena(Protocol):
    """A plant that is stepped with its world; see quadsim.physics.plant.SharedPlant."""

    @property
    def state(self) -> PlantState[State]:
        """The state after the last physics step."""
        ...

    def push(self, u: Sequence[float], disturbance: Vec3 | None = None) -> None:
        """Apply the forces of the next physics step."""
        ...

    def arrive(self) -> PlantState[State]:
        """Return the state after the step."""
        ...

    def remove(self) -> None:
        """Remove the vehicle from the world."""
        ...

    def close(self) -> None:
        """Release the resources of the plant."""
        ...


class Started(NamedTuple):
    """A flight of a race that has begun."""

    plant: PlantInArena
    # the frames and the requests of the flight, see quadsim.racing.flight.flight
    steps: Iterator[Frame | Planning | PhysicsStep]
    # returns the other vehicles as the last plan of the flight expected them
    others: Callable[[], tuple[OtherVehicle, ...]]


def no_fault(error: Exception) -> str | None:
    """Return None, so that every error ends the race."""
    return None


class Starter(NamedTuple):
    """A vehicle on the start grid."""

    # when its flight starts, in the time of the race [s]
    start_time: float
    referee: HeatReferee
    # the flow below its rotors; None: the race has no downwash
    downwash: Downwash | None
    # puts the vehicle into the world
    start: Callable[[], Started]
    # returns the text of an error that ends this vehicle's flight alone; None: it ends the race
    fault: Callable[[Exception], str | None] = no_fault


# A function that makes all plans of one instant
MakePlans = Callable[[Sequence[Planning]], None]


def in_turn(plannings: Sequence[Planning]) -> None:
    """Make the plans one after the other."""
    for planning in plannings:
        planning.run()


class HeatFrame(NamedTuple):
    """One control step of one vehicle of a race."""

    # index of the vehicle
    number: int
    # time of the race [s]
    t: float
    frame: Frame
    # the other vehicles as the plan of this step expects them; times of their paths are of the race
    others: tuple[OtherVehicle, ...] = ()
    # the error of the vehicle's controller in this step, which ends its flight; "" if there is none
    fault: str = ""


def heat_loop(
    arena: Arena,
    starters: Sequence[Starter],
    marshal: Marshal,
    traffic: Traffic,
    dt: float,
    make_plans: MakePlans = in_turn,
) -> Iterator[HeatFrame]:
    """Simulate a race until the last flight has ended, and yield the frames of all flights.

    Args:
        arena: the world, which the caller closes.
        starters: the vehicles.
        marshal: marshal, which finds contacts between the vehicles.
        traffic: states and announced plans of all vehicles.
        dt: physics step [s].
        make_plans: function that makes all plans of one instant.
    """
    started: dict[int, Started] = {}
    try:
        yield from _race(arena, starters, marshal, traffic, dt, make_plans, started)
    finally:
        for flight in started.values():
            flight.plant.close()


def _race(
    arena: Arena,
    starters: Sequence[Starter],
    marshal: Marshal,
    traffic: Traffic,
    dt: float,
    make_plans: MakePlans,
    started: dict[int, Started],
) -> Iterator[HeatFrame]:
    """Yield the frames of a race; `started` collects the flights that have begun."""
    flying: set[int] = set()
    for step in count():
        t = step * dt

        # Vehicles whose time has come enter the world.
        for k, starter in enumerate(starters):
            if k not in started and t > starter.start_time - dt / 2:
                started[k] = starter.start()
                flying.add(k)
                traffic.note(k, t, started[k].plant.state.x, 0)

        # The vehicles whose control period has ended plan.
        first_items = {k: next(started[k].steps) for k in sorted(flying)}
        make_plans([item for item in first_items.values() if isinstance(item, Planning)])
        faults = end_flights(first_items, starters)
        traffic.publish()

        # Each flight goes on until it needs the next physics step. A flight that has ended leaves.
        commands: dict[int, tuple[float, ...]] = {}
        for k, first_item in first_items.items():
            for item in chain([first_item], started[k].steps):
                if isinstance(item, PhysicsStep):
                    commands[k] = item.u
                    break
                if isinstance(item, Frame):
                    yield HeatFrame(k, t, item, started[k].others(), faults.get(k, ""))
            else:
                flying.discard(k)
                started[k].plant.remove()
                traffic.leave(k)
        if not flying and len(started) == len(starters):
            return

        # One step of the world
        before = {k: started[k].plant.state for k in commands}
        for k, u in commands.items():
            started[k].plant.push(u, _downwash(starters, before, k))
        arena.step()

        # What has happened in it
        moves: dict[int, Move] = {}
        for k, old in before.items():
            new = started[k].plant.arrive()
            traffic.note(k, t + dt, new.x, starters[k].referee.passed)
            moves[k] = Move(old.t, new.t, old.position, new.position)
        marshal.observe(t + dt, moves)


def end_flights(items: Mapping[int, object], starters: Sequence[Starter]) -> dict[int, str]:
    """End the flights whose controllers have raised an error, and return their texts.

    Other errors are raised by the flights themselves.

    Args:
        items: the request of each flight, by the vehicle's number.
        starters: the vehicles.
    """
    faults: dict[int, str] = {}
    for k, item in items.items():
        if isinstance(item, Planning) and item.error is not None:
            fault = starters[k].fault(item.error)
            if fault is not None:
                item.ends_flight = True
                faults[k] = fault
    return faults


def _downwash(
    starters: Sequence[Starter], states: dict[int, PlantState[State]], k: int
) -> Vec3 | None:
    """Return the downwash on vehicle k by all others [N], world frame, None if there is none.

    Args:
        starters: the vehicles.
        states: states of the vehicles in flight.
        k: index of the vehicle.
    """
    below = starters[k].downwash
    if below is None:
        return None
    total: Vec3 | None = None
    for m, state in states.items():
        above = starters[m].downwash
        if m == k or above is None:
            continue
        force = above.force_on(below, state.x, states[k].x)
        if force is not None:
            x, y, z = total or (0.0, 0.0, 0.0)
            total = (x + force[0], y + force[1], z + force[2])
    return total
