"""Search for a limit: solve from several guesses, and the best again on a finer mesh.

The result is the fastest solution that passes the check.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from quadsim.course import Cylinder
from quadsim.limit.detours import Detour, Hit, detours
from quadsim.limit.dynamics import dynamics
from quadsim.limit.guess import FlownRun, Guess, flown, line_speeds, solved, straight
from quadsim.limit.limits import LimitProblem, Solution, StoredSolution
from quadsim.limit.replay import referee_of
from quadsim.limit.route import Route, segments
from quadsim.limit.solve import NotSolvedError, Show, solve
from quadsim.limit.verify import Verified, verify
from quadsim.racing.events import Event, flown_laps

# Makes the callback of each iteration from a guess's name and the number of nodes
Progress = Callable[[str, int], Show]
# Largest number of rounds of detours
ROUNDS = 6
# Ratio of intervals of the last mesh to the first
FINER = 1.5


class Solved(NamedTuple):
    """A solution and the findings of its check."""

    solution: Solution
    verified: Verified


@dataclass(frozen=True)
class SolveAttempt:
    """The result of one initial guess on one mesh."""

    start: str
    nodes: int
    # One line for each reason why the attempt does not count
    broken: list[str]
    # None if the optimiser gave up
    solved: Solved | None = None
    around: tuple[Detour, ...] = ()

    @property
    def time(self) -> float | None:
        """The duration of the race [s], None if there is no solution."""
        return self.solved.solution.time if self.solved else None


class Search:
    """The search of one problem."""

    def __init__(self, problem: LimitProblem):
        """Prepare a search.

        Raises:
            ValueError: the model does not support the vehicle, or the referee does not support the
                race.
        """
        referee_of(problem)
        self._problem = problem
        self._route = Route.of(problem)
        self._model = dynamics(problem.vehicle, problem.model, problem.reserve)

    def attempts(
        self, flights: Iterable[FlownRun], intervals: int, progress: Progress
    ) -> Iterator[SolveAttempt]:
        """Yield attempts from flights, from straight lines, and from the best one on a finer mesh.

        Args:
            flights: runs used as initial guesses.
            intervals: mean number of intervals to a gate.
            progress: see Progress.
        """
        found: list[SolveAttempt] = []
        mesh = self._route.mesh(intervals)
        for guess in self._guesses(flights):
            for attempt in self._rounds(guess, mesh, (), progress):
                found.append(attempt)
                yield attempt
        coarse = best(found) or _least_broken(found)
        if coarse and coarse.solved:
            name = f"{coarse.start}, refined"
            guess = solved(name, coarse.solved.solution, self._route)
            finer = self._route.mesh(FINER * intervals)
            yield from self._rounds(guess, finer, coarse.around, progress)

    def stored(self, attempts: Iterable[SolveAttempt]) -> StoredSolution | None:
        """Return the fastest verified attempt as a StoredSolution; None if there is none."""
        fastest = best(attempts)
        if not fastest or not fastest.solved:
            return None
        problem = self._problem
        solution, verified = fastest.solved
        return StoredSolution(
            course=problem.course.name,
            vehicle=problem.vehicle.name,
            laps=problem.laps,
            closed=problem.closed,
            lap_times=tuple(flown_laps(verified.events, problem.laps)),
            verified=verified.summary(),
            solution=solution,
            margin=problem.margin,
            reserve=problem.reserve,
            key=problem.key,
        )

    def _guesses(self, flights: Iterable[FlownRun]) -> Iterator[Guess]:
        for flight in flights:
            yield flown(flight, self._model)
        for speed in line_speeds(self._route, self._problem.vehicle.thrust_max):
            yield straight(self._route.points, self._model, speed)

    def _rounds(
        self, guess: Guess, mesh: list[int], around: tuple[Detour, ...], progress: Progress
    ) -> Iterator[SolveAttempt]:
        """Yield attempts from one guess, repeated with detours as long as frames are hit."""
        plan = segments(self._route, mesh)
        name = guess.name
        for k in range(ROUNDS):
            attempt = self._attempt(guess, mesh, around, progress)
            yield attempt
            if not attempt.solved:
                return
            hits = self._hits(attempt.solved.verified.events)
            if not hits:
                return
            solution = attempt.solved.solution
            around = (*around, *detours(solution, plan, self._route, hits))
            guess = solved(f"{name}, around frames {k + 1}", solution, self._route)

    def _hits(self, events: Iterable[Event]) -> list[Hit]:
        """Return the hit frames and boxes; hit cylinders need a finer mesh instead."""
        found = []
        for event in events:
            if event.kind != "hit":
                continue
            if event.obstacle:
                place = self._route.obstacles[event.obstacle - 1]
            else:
                place = self._problem.course.gates[event.gate - 1]
            if not isinstance(place, Cylinder):
                found.append(Hit(event.t, place))
        return found

    def _attempt(
        self, guess: Guess, mesh: list[int], around: tuple[Detour, ...], progress: Progress
    ) -> SolveAttempt:
        plan = segments(self._route, mesh)
        nodes = sum(segment.intervals for segment in plan) + 1
        show = progress(guess.name, nodes)
        try:
            solution = solve(self._route, self._model, mesh, guess, show, around)
        except NotSolvedError as error:
            return SolveAttempt(guess.name, nodes, [f"optimiser: {error}"])
        verified = verify(solution, self._model, referee_of(self._problem))
        return SolveAttempt(
            start=guess.name,
            nodes=nodes,
            broken=verified.broken,
            solved=Solved(solution, verified),
            around=around,
        )


def best(attempts: Iterable[SolveAttempt]) -> SolveAttempt | None:
    """Return the fastest verified attempt; None if there is none."""
    fastest = None
    for attempt in attempts:
        if attempt.time is None or attempt.broken:
            continue
        if fastest is None or fastest.time is None or attempt.time < fastest.time:
            fastest = attempt
    return fastest


def _least_broken(attempts: Iterable[SolveAttempt]) -> SolveAttempt | None:
    """Return the solved attempt with the fewest faults; None if none is solved."""
    found = [attempt for attempt in attempts if attempt.solved]
    return min(found, key=_faults, default=None)


def _faults(attempt: SolveAttempt) -> int:
    return len(attempt.broken)
