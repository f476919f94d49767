"""An attempt is one flight of a campaign, known by the hash of all that decides it; any process can
fly it.

That is its specification, and the versions of the libraries that it is computed with.
"""

from __future__ import annotations

import multiprocessing as mp
import sys
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from functools import lru_cache
from hashlib import sha256
from typing import NotRequired, TypedDict

from quadsim.record.metrics import chatter
from quadsim.record.provenance import provenance
from quadsim.record.run import PlanTime, Recorder, Run, canonical, system_of
from quadsim.record.turning_back import TurnedBack, turned_back
from quadsim.spec.build import build, launch
from quadsim.spec.spec import Spec

LABELS = ("host", "preset")  # keys of a spec's record that do not decide the flight
DRAWN = ("seed", "variation")
# Libraries whose versions decide a flight; the attempt's commit stands beside its key
LIBRARIES = ("numpy", "numba", "pybullet")
OF_PLANT = {"rotorpy": ("rotorpy", "scipy")}  # more of them, by plant
this_provenance = lru_cache(provenance)  # of the code in this process, as it was loaded
CRASHES = ("hit", "ground", "bounds", "wall")


@dataclass(frozen=True, eq=False)
class Flown:
    """What a worker returns."""

    run: Run
    provenance: dict  # of the worker: versions, commit, cpu
    fault: str | None  # the planner's error, if it raised one in flight


def attempt_key(record: dict, versions: Mapping[str, str | None] | None = None) -> str:
    """sha256 [hex] of the full specification, its seed, and the libraries' versions; left out: of
    this process.

    record: of a Spec.
    """
    used = this_provenance()["versions"] if versions is None else versions
    libraries = (*LIBRARIES, *OF_PLANT.get(record.get("plant", ""), ()))
    return _hash(record | {"libraries": {name: used.get(name) for name in libraries}})


def variant_key(record: dict, versions: Mapping[str, str | None] | None = None) -> str:
    """The same for all seeds of a variant."""
    return attempt_key({k: v for k, v in record.items() if k not in DRAWN}, versions)


def planner_key(record: dict) -> str:
    """The same for all seeds and libraries."""
    return _hash({k: v for k, v in record.items() if k not in DRAWN})


def _hash(record: dict) -> str:
    return sha256(canonical({k: v for k, v in record.items() if k not in LABELS})).hexdigest()


def fly_attempt(spec: Spec) -> Flown:
    """One flight, in a worker on one thread. A planner that raises an error in flight counts as a
    crash."""
    if mp.parent_process() or "distributed.worker" in sys.modules:
        from controllers.lanes.threads import use_threads  # here: it loads the compiler

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


class Crash(TypedDict):
    """Where a flight crashed."""

    kind: str  # of CRASHES, or planner
    gate: int  # 0: none
    obstacle: NotRequired[int]  # of a hit of one
    lap: int
    position: list[float]  # [m]; two coordinates in the plane


class Variation(TypedDict):
    """Total variation per second [m/s^2/s]."""

    commanded: float
    delivered: float


class Result(TypedDict):
    """The numbers of an attempt that reports are made of."""

    laps: list[float]  # [s]
    crash: Crash | None
    fault: str | None  # the planner's error
    thrust_tv: Variation | None
    rates_tv: NotRequired[Variation | None]  # of the body rates [rad/s^2]
    turned_back: NotRequired[list[TurnedBack]]
    plan_ms: PlanTime
    real_time_factor: float
    cpu: str
    digest: str


def result(flown: Flown) -> Result:
    """See Result."""
    run = flown.run
    return {
        "laps": run.laps,
        "crash": _crash(run) if run.outcome == "crashed" else None,
        "fault": flown.fault,
        **of_telemetry(run),
        "plan_ms": run.wall["plan_ms"],
        "real_time_factor": run.wall["real_time_factor"],
        "cpu": flown.provenance["cpu"],
        "digest": run.digest(),
    }


class OfTelemetry(TypedDict):
    """The part of a Result that stored telemetry gives as well."""

    thrust_tv: Variation | None
    rates_tv: Variation | None
    turned_back: list[TurnedBack]


def of_telemetry(run: Run) -> OfTelemetry:
    """See OfTelemetry."""
    if system_of(run.spec) != "quadrotor":  # only a quadrotor commands thrust
        return {"thrust_tv": None, "rates_tv": None, "turned_back": []}
    commanded, delivered = (chatter(run)[of] for of in ("commanded", "delivered"))
    return {
        "thrust_tv": {"commanded": commanded["thrust_tv"], "delivered": delivered["thrust_tv"]},
        "rates_tv": {
            "commanded": commanded["body_rates_tv"],
            "delivered": delivered["body_rates_tv"],
        },
        "turned_back": turned_back(run),
    }


def _crash(run: Run) -> Crash:
    x, last = run.telemetry, run.events[-1] if run.events else None
    lap = int(x["lap"][-1])
    if last and last.kind in CRASHES:
        where: Crash = {
            "kind": last.kind,
            "gate": last.gate,
            "lap": lap,
            "position": list(last.position),
        }
        if last.obstacle:
            where["obstacle"] = last.obstacle
        return where
    here = [float(x[p][-1]) for p in ("px", "py", "pz") if p in x]
    return {"kind": "planner", "gate": 0, "lap": lap, "position": here}
