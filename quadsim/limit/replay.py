"""Convert a stored solution to a run, for replays and for races on the page."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from quadsim.dynamics.quadrotor import Control, State
from quadsim.limit.limits import LimitProblem, StoredSolution
from quadsim.racing.events import Event, Frame
from quadsim.racing.referee import Referee
from quadsim.record.run import RecordedRun, Recorder

# Rate of the referee's steps [Hz], and number of steps between two frames
RATE = 1000.0
EVERY = 10
# Time limit of the referee, which no solution reaches [s]
TIMEOUT = 1e4


def referee_of(problem: LimitProblem) -> Referee:
    """Return a new referee that continues after a hit, so that it reports all hits of a race.

    Raises:
        ValueError: laps on an open course, or a gate too small for the vehicle.
    """
    radius = problem.vehicle.radius
    return Referee(problem.course, radius, problem.laps, TIMEOUT, penalties=True)


def replayed(stored: StoredSolution, problem: LimitProblem, spec: dict[str, Any]) -> RecordedRun:
    """Return a solution as a run: 100 frames a second, with the referee's events.

    Args:
        stored: the solution.
        problem: the solution's race.
        spec: spec of a flight of this race, whose vehicle and controller are replaced by the
            solution's.
    """
    referee = referee_of(problem)
    path = stored.path(RATE)
    times = path[:, 0].tolist()
    points = [(x, y, z) for _, x, y, z in path.tolist()]
    states = stored.states(problem.vehicle, path[:, 0])
    last = len(times) - 1
    recorder = Recorder()
    events: list[Event] = []
    for k, t in enumerate(times):
        if k:
            events += referee.observe(times[k - 1], points[k - 1], t, points[k])
        if k % EVERY and k != last:
            continue
        x = State(*states[k].tolist())
        frame = Frame(
            t=t,
            x=x,
            u=Control(*x.body_rates, thrust=x.thrust),
            passed=referee.passed,
            lap=referee.lap,
            gate=referee.next_gate + 1,
            ess=0.0,
            temperature=0.0,
            cost=0.0,
            plan_ms=0.0,
            elapsed=t,
            events=tuple(events),
            outcome=referee.outcome if k == last else None,
        )
        recorder.add(frame)
        events = []
    return recorder.run(spec | _solution_as_controller(problem))


def _solution_as_controller(problem: LimitProblem) -> dict[str, Any]:
    """Return the keys of a spec that describe the vehicle and the solution as the controller."""
    return {
        "vehicle": asdict(problem.vehicle),
        "plant": problem.model,
        "sampler": "limit",
        "preset": "limit",
        "own": {"controller": {"class": "best known limit"}},
    }
