"""Flights that the tests of runs, folders and metrics share."""

from math import pi, sin

import numpy as np

from controllers.plan import PlannerSnapshot
from quadsim.race.events import Event, Frame
from quadsim.record.archive import RunFolder
from quadsim.record.run import Run

SPEC = {
    "course": "test course",
    "course_text": "name: test course\n",
    "vehicle": {"name": "probe", "drag": (0.1, 0.1, 0.1), "rotors": {"tau": 0.05}},
    "sampler": "colored",
    "seed": 3,
    "host": {"threads": 2},
}


def event(t, kind="pass", gate=1, lap=1):
    return Event(t, kind, gate, lap, (0.1, -0.2), 12.3, (1.0, 2.0, 3.0))


def frame(k, lap=1, events=(), outcome=None, snapshot=None, plan_ms=5.0):
    t = 0.01 * k
    x = (0.3 * k, 0.0, 2.0, 3.0, 4.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0)
    u = (0.1, 0.2, 0.3, 9.81 + sin(2 * pi * t))
    return Frame(t, x, u, k, lap, 1, 50.0, 0.3, 1.5, plan_ms, 2 * t, events, outcome, snapshot)


def snapshot(seed=0, terms=("progress", "crash")):
    """As a planner may have made it."""
    rng = np.random.default_rng(seed)
    return PlannerSnapshot(rng.normal(size=(8, 5, 3)), {name: rng.normal() for name in terms})


def two_laps(spec=SPEC, outcome="finished", plan_ms=5.0, snapshot=None):
    """Three gates; the second lap has a hit."""
    events = {10: (event(0.095),), 20: (event(0.2, gate=2),), 30: (event(0.3, gate=3),)}
    events |= {
        40: (event(0.4, lap=2),),
        45: (event(0.45, "hit", 2, 2),),
        50: (event(0.5, gate=2, lap=2),),
    }
    events |= {60: (event(0.59, gate=3, lap=2),)}
    frames = [
        frame(k, 1 + (k >= 30), events.get(k, ()), None, snapshot, plan_ms) for k in range(60)
    ]
    return Run.from_frames(spec, [*frames, frame(60, 2, events[60], outcome, snapshot, plan_ms)])


def save(root, run):
    """-> its folder."""
    with RunFolder.open(root, run.spec) as folder:
        return folder.save(run)


def same(a: Run, b: Run) -> bool:
    """Every field of two runs, to the last bit."""
    named, other = _arrays(a), _arrays(b)
    return (a.spec, a.events, a.outcome, a.wall, list(named)) == (
        b.spec,
        b.events,
        b.outcome,
        b.wall,
        list(other),
    ) and all(
        x.dtype == other[k].dtype and np.array_equal(x, other[k], equal_nan=True)
        for k, x in named.items()
    )


def _arrays(run: Run) -> dict:
    snapshots = run.snapshots
    return run.telemetry | (
        {}
        if snapshots is None
        else {"pictured": snapshots.frames, "best": snapshots.best} | snapshots.terms
    )
