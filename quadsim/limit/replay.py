"""A stored solution as a run, for replay and for races on the page."""

from __future__ import annotations

from dataclasses import asdict

from quadsim.config.spec import Spec
from quadsim.dynamics.quadrotor import Control, State
from quadsim.limit.verify import referee_of
from quadsim.racing.events import Event, Frame
from quadsim.record.limits import LimitProblem, StoredSolution
from quadsim.record.run import RecordedRun, Recorder

# Rate of the referee's steps [Hz], and number of steps between two frames
RATE = 1000.0
EVERY = 10


def replayed(stored: StoredSolution, problem: LimitProblem) -> RecordedRun:
    """Return a solution as a run: 100 frames a second, with the referee's events."""
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
    return recorder.run(_spec(problem))


def _spec(problem: LimitProblem) -> dict:
    """Return the spec of the replay: the spec of the race, with the solution as its controller."""
    spec = Spec.of(problem.course, laps=problem.laps).record()
    return spec | {
        "vehicle": asdict(problem.vehicle),
        "plant": problem.model,
        "sampler": "limit",
        "preset": "limit",
        "own": {"controller": {"class": "best known limit"}},
    }
