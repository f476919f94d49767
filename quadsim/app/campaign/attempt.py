"""Attempt: one flight of a campaign, known by the hash of all that decides it, flown anywhere."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass, replace
from functools import lru_cache
from hashlib import sha256

from controllers.rollout.threads import use_threads
from quadsim.race.spec import Spec, build, launch
from quadsim.record.metrics import chatter
from quadsim.record.provenance import provenance
from quadsim.record.run import Recorder, Run, canonical

LABELS = ("host", "preset")  # of a spec's record: they decide nothing
DRAWN = ("seed", "variation")
CRASHES = ("hit", "ground", "bounds")


@dataclass(frozen=True, eq=False)
class Flown:
    """What a worker sends home."""

    run: Run
    provenance: dict  # of the worker: versions, commit, cpu
    fault: str | None  # why the planner gave up, where it did


def attempt_key(spec: Spec) -> str:
    """sha256 [hex] of the full specification and seed."""
    return _hash(spec, LABELS)


def variant_key(spec: Spec) -> str:
    """The same for all seeds of an variant."""
    return _hash(spec, LABELS + DRAWN)


def fly_attempt(spec: Spec) -> Flown:
    """One flight on one thread. A planner that gives up in mid-flight has crashed: the vehicle would."""
    use_threads(1)
    flown_by = this_provenance()  # before the flight: of the code that flies
    plant, controller, referee = build(spec)
    recorder = Recorder()
    fault = None
    with closing(plant):
        try:
            for frame in launch(spec, plant, controller, referee):
                recorder.add(replace(frame, picture=None))
        except (ValueError, FloatingPointError) as error:
            if not len(recorder):
                raise
            fault = str(error)
    run = recorder.run(spec.record())
    return Flown(replace(run, outcome="crashed") if fault else run, flown_by, fault)


@lru_cache
def this_provenance() -> dict:
    """Of the code in this process, as it was loaded."""
    return provenance()


def result(flown: Flown) -> dict:
    """The numbers of an attempt that reports are made of. Seconds, metres, m/s^2/s, milliseconds."""
    run, last = flown.run, flown.run.events[-1] if flown.run.events else None
    thrust = chatter(run)
    crash = None
    if run.outcome == "crashed":
        ended = last if last and last.kind in CRASHES else None
        position = ended.position if ended else tuple(float(run.telemetry[p][-1]) for p in ("px", "py", "pz"))
        gate, kind = (ended.gate, ended.kind) if ended else (0, "planner")
        crash = {"kind": kind, "gate": gate, "lap": int(run.telemetry["lap"][-1]), "position": position}
    return {
        "laps": run.laps,
        "crash": crash,
        "fault": flown.fault,
        "thrust_tv": {of: thrust[of]["thrust_tv"] for of in ("commanded", "delivered")},
        "plan_ms": run.wall["plan_ms"],
        "real_time_factor": run.wall["real_time_factor"],
        "cpu": flown.provenance["cpu"],
        "digest": run.digest(),
    }


def _hash(spec: Spec, without: tuple[str, ...]) -> str:
    return sha256(canonical({k: v for k, v in spec.record().items() if k not in without})).hexdigest()
