"""Runs that the tests of runs, folders and metrics share."""

from math import pi, sin

import numpy as np

from quadsim.config.spec import Spec
from quadsim.controllers.plan import PlannerSnapshot
from quadsim.racing.events import Event, Frame
from quadsim.record.archive import RunFolder
from quadsim.record.run import RecordedRun
from quadsim.vehicle import load_vehicle

PROBE = load_vehicle("swift").but(name="probe", drag=(0.1, 0.1, 0.1), rotors={"motor_tau": 0.05})
# The record of a flight, with the text of a course that has no gates
SPEC = Spec.of("figure8", vehicle=PROBE, seed=3, laps=2, threads=2).record() | {
    "course": {"name": "test course", "text": "name: test course\n"},
}


def event(t, kind="pass", gate=1, lap=1):
    """Return an event at t [s]."""
    return Event(t, kind, gate, lap, (0.1, -0.2), 12.3, (1.0, 2.0, 3.0))


def frame(k, lap=1, events=(), outcome=None, snapshot=None, plan_ms=5.0):
    """Return the frame of control period k."""
    t = 0.01 * k
    x = (0.3 * k, 0.0, 2.0, 3.0, 4.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0)
    u = (0.1, 0.2, 0.3, 9.81 + sin(2 * pi * t))
    return Frame(t, x, u, k, lap, 1, 50.0, 0.3, 1.5, plan_ms, 2 * t, events, outcome, snapshot)


def snapshot(seed=0, terms=("progress", "crash")):
    """Return a snapshot as a planner may have made it."""
    rng = np.random.default_rng(seed)
    return PlannerSnapshot(rng.normal(size=(8, 5, 3)), {name: rng.normal() for name in terms})


def two_laps(spec=SPEC, outcome="finished", plan_ms=5.0, snapshot=None):
    """Return a run of two laps through three gates; the second lap has a hit."""
    events = {
        10: (event(0.095),),
        20: (event(0.2, gate=2),),
        30: (event(0.3, gate=3),),
        40: (event(0.4, lap=2),),
        45: (event(0.45, "hit", 2, 2),),
        50: (event(0.5, gate=2, lap=2),),
        60: (event(0.59, gate=3, lap=2),),
    }
    frames = [
        frame(k, 1 + (k >= 30), events.get(k, ()), None, snapshot, plan_ms) for k in range(60)
    ]
    frames.append(frame(60, 2, events[60], outcome, snapshot, plan_ms))
    return RecordedRun.from_frames(spec, frames)


def save(root, run):
    """Store a run. Return its folder."""
    with RunFolder.open(root, run.spec) as folder:
        return folder.save(run)


def same(a: RecordedRun, b: RecordedRun) -> bool:
    """Return whether two runs are equal in every field, to the last bit."""
    if (a.spec, a.events, a.outcome, a.wall) != (b.spec, b.events, b.outcome, b.wall):
        return False
    ours, theirs = _arrays(a), _arrays(b)
    return list(ours) == list(theirs) and all(_equal(ours[k], theirs[k]) for k in ours)


def _equal(a: np.ndarray, b: np.ndarray) -> bool:
    return a.dtype == b.dtype and np.array_equal(a, b, equal_nan=True)


def _arrays(run: RecordedRun) -> dict[str, np.ndarray]:
    """Return the arrays of a run by name."""
    if run.snapshots is None:
        return run.telemetry
    snapshots = run.snapshots
    pictured = {"pictured": snapshots.frames, "best": snapshots.best}
    return run.telemetry | pictured | snapshots.terms
