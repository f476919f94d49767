"""Several starts on one mesh, the fastest once more on a finer one; the fastest that holds is the
best known."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import chain
from typing import Any

from quadsim.course import Box, Cylinder, Gate
from quadsim.limit.detours import Detour, detours
from quadsim.limit.dynamics import dynamics
from quadsim.limit.guess import Guess, flown, solved, speeds, straight
from quadsim.limit.solve import NotSolvedError, Show, solve
from quadsim.limit.task import mesh, race_task, segments
from quadsim.limit.verify import Verified, verify
from quadsim.record.limits import Race, Solution

ROUNDS = 6  # of detours at most
FINER = 1.5  # intervals of the last mesh over those of the first


@dataclass(frozen=True)
class Attempt:
    """One start on one mesh."""

    start: str
    nodes: int
    time: float | None  # of the solution, where there is one [s]
    broken: list[str]  # why it does not count, one line each
    solved: tuple[Solution, Verified] | None = None
    around: tuple[Detour, ...] = ()


class Search:
    """Of one race. Raises ValueError for a vehicle that the model does not cover."""

    def __init__(self, race: Race, referee: Callable[[], Any], show: Callable[[str, int], Show]):
        """referee: makes a new one, which lets a race go on after a hit, for each solution.
        show: of a start's name and a number of nodes, gives what is told after each iteration."""
        self.task = race_task(race.course, race.vehicle.radius, race.laps, race.closed, race.margin)
        self.model = dynamics(race.vehicle, race.model, race.reserve)
        self._gates, self._speeds = race.course.gates, speeds(self.task, race.vehicle.thrust_max)
        self._referee, self._show = referee, show

    def attempts(
        self, flights: Iterable[tuple[str, dict[str, Any], list[float]]], intervals: int
    ) -> Iterator[Attempt]:
        """From straight lines and from flights: name, telemetry, passes [s]. intervals: to a gate,
        in the mean."""
        lines = (straight(self.task, self.model, speed) for speed in self._speeds)
        found = []
        for guess in chain(
            (flown(name, self.model, x, passes) for name, x, passes in flights), lines
        ):
            for attempt in self._rounds(guess, mesh(self.task, intervals), ()):
                found.append(attempt)
                yield attempt
        fastest = best(found) or min(
            (a for a in found if a.time), key=lambda a: len(a.broken), default=None
        )
        if fastest and fastest.solved:
            finer = solved(f"{fastest.start}, refined", fastest.solved[0], self.task)
            yield from self._rounds(finer, mesh(self.task, FINER * intervals), fastest.around)

    def _rounds(
        self, guess: Guess, intervals: list[int], around: tuple[Detour, ...]
    ) -> Iterator[Attempt]:
        """One start; while frames beside the targets are hit, again with a detour around each."""
        plan, name = segments(self.task, intervals), guess.name
        for k in range(ROUNDS):
            attempt = self._attempt(guess, intervals, around)
            yield attempt
            hits = (
                [e for e in attempt.solved[1].events if e.kind == "hit"] if attempt.solved else []
            )
            if not hits or not attempt.solved:
                return
            # cylinders alone, which a finer mesh keeps clear of
            if not (hit := self._frames_and_boxes(hits)):
                return
            around = (*around, *detours(attempt.solved[0], plan, self.task, hit))
            guess = solved(f"{name}, around frames {k + 1}", attempt.solved[0], self.task)

    def _frames_and_boxes(self, hits: Iterable[Any]) -> list[tuple[float, Gate | Box]]:
        """When was which hit [s]."""
        places = [
            (e.t, self.task.obstacles[e.obstacle - 1] if e.obstacle else self._gates[e.gate - 1])
            for e in hits
        ]
        return [(t, place) for t, place in places if not isinstance(place, Cylinder)]

    def _attempt(self, guess: Guess, intervals: list[int], around: tuple[Detour, ...]) -> Attempt:
        nodes = sum(s.intervals for s in segments(self.task, intervals)) + 1
        try:
            solution = solve(
                self.task, self.model, intervals, guess, self._show(guess.name, nodes), around
            )
        except NotSolvedError as error:
            return Attempt(guess.name, nodes, None, [f"optimiser: {error}"])
        verified = verify(solution, self.model, self._referee())
        return Attempt(
            guess.name, nodes, solution.time, verified.broken, (solution, verified), around
        )


def best(attempts: Iterable[Attempt]) -> Attempt | None:
    """The fastest that holds, None where none does."""
    return min(
        (a for a in attempts if a.time and not a.broken), key=lambda a: a.time or 0.0, default=None
    )
