"""An attempt is one flight of a campaign, known by the hash of all that decides it; any process can fly it."""

from __future__ import annotations

import multiprocessing as mp
import sys
from contextlib import closing
from dataclasses import dataclass, replace
from functools import lru_cache
from hashlib import sha256

from quadsim.race.build import build, launch
from quadsim.race.spec import Spec
from quadsim.record.metrics import accumulated_cost, chatter
from quadsim.record.provenance import provenance
from quadsim.record.run import Recorder, Run, canonical, system_of

LABELS = ("host", "preset")  # keys of a spec's record that do not decide the flight
DRAWN = ("seed", "variation")
this_provenance = lru_cache(provenance)  # of the code in this process, as it was loaded
CRASHES = ("hit", "ground", "bounds", "wall")


@dataclass(frozen=True, eq=False)
class Flown:
    """What a worker returns."""

    run: Run
    provenance: dict  # of the worker: versions, commit, cpu
    fault: str | None  # the planner's error, if it raised one in flight


def attempt_key(spec: Spec, without: tuple[str, ...] = LABELS) -> str:
    """sha256 [hex] of the full specification and seed."""
    return sha256(canonical({k: v for k, v in spec.record().items() if k not in without})).hexdigest()


def variant_key(spec: Spec) -> str:
    """The same for all seeds of a variant."""
    return attempt_key(spec, LABELS + DRAWN)


def fly_attempt(spec: Spec) -> Flown:
    """One flight, in a worker on one thread. A planner that raises an error in flight counts as a crash."""
    if mp.parent_process() or "distributed.worker" in sys.modules:
        from controllers.rollout.threads import use_threads  # here: it loads the compiler

        use_threads(1)
    flown_by = this_provenance()  # before the flight: of the code that flies
    plant, controller, referee = build(spec)
    recorder = Recorder()
    fault = None
    with closing(plant):
        try:
            for frame in launch(spec, plant, controller, referee):
                recorder.add(replace(frame, snapshot=None))
        except (ValueError, FloatingPointError) as error:
            if not len(recorder):
                raise
            fault = str(error)
    run = recorder.run(spec.record())
    return Flown(replace(run, outcome="crashed") if fault else run, flown_by, fault)


def result(flown: Flown) -> dict:
    """The numbers of an attempt that reports are made of. Seconds, metres, m/s^2/s, milliseconds."""
    run = flown.run
    thrust = chatter(run) if system_of(run.spec) == "quadrotor" else None  # only a quadrotor commands thrust
    return {
        "laps": run.laps,
        "crash": _crash(run) if run.outcome == "crashed" else None,
        "fault": flown.fault,
        "cost": accumulated_cost(run),
        "thrust_tv": thrust and {of: thrust[of]["thrust_tv"] for of in ("commanded", "delivered")},
        "plan_ms": run.wall["plan_ms"],
        "real_time_factor": run.wall["real_time_factor"],
        "cpu": flown.provenance["cpu"],
        "digest": run.digest(),
    }


def _crash(run: Run) -> dict:
    """Kind, gate (0: none), lap and position [m], which has two coordinates in the plane."""
    x, last = run.telemetry, run.events[-1] if run.events else None
    crash = {"kind": "planner", "gate": 0, "position": [float(x[p][-1]) for p in ("px", "py", "pz") if p in x]}
    if last and last.kind in CRASHES:
        crash = {"kind": last.kind, "gate": last.gate, "position": last.position}
    return crash | {"lap": int(x["lap"][-1])}
