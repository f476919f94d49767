"""The marshal of a race, which finds contacts between vehicles and applies the rules to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from math import dist, inf
from typing import NamedTuple

from quadsim.course.swept import first_within, lerp
from quadsim.heat.rules import Rules
from quadsim.racing.along import Along
from quadsim.racing.events import Event
from quadsim.racing.referee import CLEAR, Referee
from quadsim.rotation import Vec3

# [m] Vehicles that push each other away in the simulated world stay this near.
TOUCH_MARGIN = 2e-3


class Move(NamedTuple):
    """The positions of a vehicle before and after one physics step."""

    # times of its flight [s]
    t0: float
    t1: float
    # [m]
    p0: Vec3
    p1: Vec3


class HeatReferee:
    """The referee of one vehicle in a race, which also records the events of the marshal."""

    def __init__(self, referee: Referee):
        """Begin before the first gate.

        Args:
            referee: referee that applies the rules of a single flight.
        """
        self.flight = referee
        self._called: list[Event] = []
        self._out = False

    @property
    def outcome(self) -> str | None:
        """The outcome of the flight; None until it has ended."""
        return "crashed" if self._out else self.flight.outcome

    @property
    def passed(self) -> int:
        """The number of gates passed since the start."""
        return self.flight.passed

    @property
    def lap(self) -> int:
        """The number of the current lap, from 1."""
        return self.flight.lap

    @property
    def next_gate(self) -> int:
        """The index of the next gate, from 0."""
        return self.flight.next_gate

    def call(self, event: Event, out: bool) -> None:
        """Record an event of the marshal, after which the vehicle may be out."""
        self._called.append(event)
        self._out |= out

    def observe(
        self, t0: float, p0: Vec3, t1: float, p1: Vec3, contacts: Sequence[str] = ()
    ) -> list[Event]:
        """Return the events of one physics step, by Referee and by the marshal.

        A vehicle that is out cannot pass a gate any more.
        """
        called = self._called
        self._called = []
        if self._out:
            return called
        return called + self.flight.observe(t0, p0, t1, p1, contacts)


class Marshal:
    """Finds contacts between all vehicles of a race in every physics step."""

    def __init__(self, rules: Rules, referees: Sequence[HeatReferee], radii: Sequence[float]):
        """Begin before the start.

        Args:
            rules: consequences of a contact.
            referees: the referee of each vehicle.
            radii: radii of the vehicles [m].
        """
        self._rules = rules
        self._referees = referees
        self._radii = radii
        # until when two vehicles were last in contact [s]
        self._touched: dict[tuple[int, int], float] = {}

    def observe(self, t: float, moves: Mapping[int, Move]) -> None:
        """Find the contacts of one physics step, and report them to the referees.

        Args:
            t: time of the race after the step [s].
            moves: the moves of all vehicles in flight, by number.
        """
        for k, m in combinations(sorted(moves), 2):
            a = moves[k]
            b = moves[m]
            s = first_within(a.p0, a.p1, b.p0, b.p1, self._reach(k, m))
            if s is None:
                continue
            fresh = t - self._touched.get((k, m), -inf) >= CLEAR
            self._touched[k, m] = t
            if fresh:
                self._contact(s, (k, m), moves)

    def _reach(self, k: int, m: int) -> float:
        """Return the distance of centres that counts as a contact [m]."""
        if self._rules.contact is not None:
            return self._rules.contact
        margin = TOUCH_MARGIN if self._rules.collide else 0.0
        return self._radii[k] + self._radii[m] + margin

    def _contact(self, s: float, pair: tuple[int, int], moves: Mapping[int, Move]) -> None:
        """Report a contact to the referees.

        Args:
            s: fraction of the step at which the contact began.
            pair: numbers of the two vehicles.
            moves: the moves of all vehicles.
        """
        at = {k: lerp(moves[k].p0, moves[k].p1, s) for k in pair}
        out = self._out(pair, at)
        for k, other in (pair, pair[::-1]):
            move = moves[k]
            referee = self._referees[k]
            event = Event(
                t=move.t0 + s * (move.t1 - move.t0),
                kind="contact",
                gate=0,
                lap=referee.lap,
                offset=(0.0, 0.0),
                speed=dist(move.p0, move.p1) / (move.t1 - move.t0),
                position=at[k],
                vehicle=other + 1,
            )
            referee.call(event, k in out)

    def _out(self, pair: tuple[int, int], at: Mapping[int, Vec3]) -> tuple[int, ...]:
        """Return the numbers of the vehicles that are out after a contact of two vehicles.

        Args:
            pair: numbers of the two vehicles.
            at: positions of the vehicles at the contact, by number [m].
        """
        if self._rules.out != "chaser":
            return pair if self._rules.out == "both" else ()
        first, second = (self._along(k, at[k]) for k in pair)
        return (pair[0],) if first < second else (pair[1],)

    def _along(self, k: int, position: Vec3) -> Along:
        """Return the progress of a vehicle, by its referee's count of gates."""
        referee = self._referees[k].flight
        return Along.of(referee.course, referee.passed, position)
