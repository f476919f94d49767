"""An attempt is one flight of a campaign, and any process can fly it.

Its key is the hash of all that decides the flight: the specification, and the versions of the
libraries that it is computed with.
"""

from __future__ import annotations

import multiprocessing as mp
import sys
from collections.abc import Mapping
from contextlib import closing
from copy import deepcopy
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import TypedDict, TypeVar

from quadsim.config.build import build
from quadsim.config.own import fault_in_flight, runs_own_code
from quadsim.config.spec import Spec
from quadsim.racing.flight import simulate
from quadsim.record.provenance import this_provenance
from quadsim.record.run import CRASHES, ERROR, PlanTime, RecordedRun, Recorder, canonical
from quadsim.report.metrics import chatter, motor_use
from quadsim.report.turning_back import TurnedBack, turned_back

LABELS = ("host", "preset")  # keys of a spec's record that do not decide the flight
# keys that differ between the attempts of one variant
DRAWN = ("seed", "variation", "drawn_faults")
# Libraries whose versions decide a flight. The commit of this project stands beside the key.
LIBRARIES = ("numpy", "numba", "pybullet")
LIBRARIES_OF_PLANT = {"rotorpy": ("rotorpy", "scipy"), "crazyflow": ("crazyflow", "jax")}

Flyable = TypeVar("Flyable")  # a Spec or a HeatSpec


@dataclass(frozen=True, eq=False)
class Flown:
    """An attempt that a worker has flown."""

    run: RecordedRun
    provenance: dict  # of the worker: versions, commit, cpu
    fault: str | None  # the error of the planner or of the user's own code that ended the flight


def attempt_key(
    record: dict, versions: Mapping[str, str | None] | None = None, twin: int = 0
) -> str:
    """Return the sha256 [hex] of a full specification, its seed and the libraries' versions.

    Args:
        record: record of a Spec.
        versions: versions of libraries by name; None: the versions of this process.
        twin: see quadsim.campaign.run.variants.Variant.
    """
    used = this_provenance()["versions"] if versions is None else versions
    names = LIBRARIES + LIBRARIES_OF_PLANT.get(record["plant"], ())
    decided = record | {"libraries": {name: used.get(name) for name in names}}
    return _hash(decided | {"twin": twin} if twin else decided)


def variant_key(
    record: dict, versions: Mapping[str, str | None] | None = None, twin: int = 0
) -> str:
    """Return the key of a variant: like `attempt_key`, but the same for all seeds."""
    return attempt_key(_without_seed(record), versions, twin)


def planner_key(record: dict) -> str:
    """Return a hash that is the same for all seeds and all versions of libraries."""
    return _hash(_without_seed(record))


def _without_seed(record: dict) -> dict:
    return {name: value for name, value in record.items() if name not in DRAWN}


def _hash(record: dict) -> str:
    deciding = {name: value for name, value in record.items() if name not in LABELS}
    return sha256(canonical(deciding)).hexdigest()


def fly_attempt(spec: Spec) -> Flown:
    """Fly an attempt, in a worker process on one thread.

    If a planner raises an error in flight, the outcome is a crash; if the flight has parts of the
    user's own, the outcome is an error. If the firmware ends in flight, the attempt has no outcome,
    as this says nothing about the variant.

    Raises:
        FirmwareError: the firmware does not run, or has ended in flight (a ValueError).
        Exception: the planner or a part of the user's own raised an error before the flight.
    """
    use_one_thread_in_a_worker()
    has_own_parts = bool(spec.own_objects())
    if has_own_parts:
        spec = with_fresh_parts(spec)
    # Before the flight, as these name the code and the parts that fly.
    flown_by = this_provenance()
    record = spec.record()
    parts = build(spec)
    recorder = Recorder()
    fault = None
    with closing(parts.plant):
        try:
            for frame in simulate(parts):
                recorder.add(replace(frame, snapshot=None))
        except Exception as error:
            # The user's own parts may raise anything.
            fault = fault_in_flight(error, has_own_parts)
            if fault is None or not len(recorder):
                raise
    run = recorder.run(record)
    if fault is not None:
        outcome = ERROR if runs_own_code(spec.own_objects()) else "crashed"
        run = replace(run, outcome=outcome, fault=fault)
    return Flown(run, flown_by, fault)


def use_one_thread_in_a_worker() -> None:
    """Use one thread if this is a worker process, because other workers use the other cores."""
    if mp.parent_process() or "distributed.worker" in sys.modules:
        from quadsim.controllers.lanes.threads import use_threads  # here: it loads the compiler

        use_threads(1)


def with_fresh_parts(spec: Flyable) -> Flyable:
    """Return a specification with copies of the user's own parts, which one flight may change.

    An attempt therefore does not depend on the attempts that this process has flown before.
    """
    try:
        return deepcopy(spec)
    except Exception:  # a part with an open file, say, which is flown as it is
        return spec


class Crash(TypedDict):
    """The place and the kind of a crash."""

    kind: str  # of CRASHES, or planner
    gate: int  # 0: none
    obstacle: int  # the one that was hit; 0: none
    lap: int
    position: list[float]  # [m]


class Variation(TypedDict):
    """The total variation of a control per second."""

    commanded: float
    delivered: float


class MotorNumbers(TypedDict):
    """The commands that a firmware gave to the motors, see quadsim.report.run_metrics."""

    variation: float  # [1/s]
    thrust_lost: float  # [m/s^2]


class Result(TypedDict):
    """The numbers of an attempt that reports are made of."""

    laps: list[float]  # [s]
    gates_passed: int
    crash: Crash | None
    fault: str | None  # the error that ended the flight
    thrust_tv: Variation  # [m/s^2/s]
    rates_tv: Variation  # of the body rates [rad/s^2]
    motors: MotorNumbers | None  # None: no firmware flew
    turned_back: list[TurnedBack]
    plan_ms: PlanTime
    real_time_factor: float
    cpu: str
    digest: str


def result(flown: Flown) -> Result:
    """Return the numbers of an attempt that a campaign keeps."""
    run = flown.run
    varied = chatter(run)
    commanded = varied["commanded"]
    delivered = varied["delivered"]
    motors = motor_use(run)
    return {
        "laps": run.laps,
        "gates_passed": len(run.gates),
        "crash": _crash(run) if run.outcome == "crashed" else None,
        "fault": flown.fault,
        "thrust_tv": {
            "commanded": commanded["thrust_tv"],
            "delivered": delivered["thrust_tv"],
        },
        "rates_tv": {
            "commanded": commanded["body_rates_tv"],
            "delivered": delivered["body_rates_tv"],
        },
        "motors": {"variation": motors.motor_variation, "thrust_lost": motors.thrust_lost}
        if motors
        else None,
        "turned_back": turned_back(run),
        "plan_ms": run.wall["plan_ms"],
        "real_time_factor": run.wall["real_time_factor"],
        "cpu": flown.provenance["cpu"],
        "digest": run.digest(),
    }


def _crash(run: RecordedRun) -> Crash:
    columns = run.telemetry
    lap = int(columns["lap"][-1])
    last = run.events[-1] if run.events else None
    if last is None or last.kind not in CRASHES:
        # No event ended the flight: the planner raised an error.
        position = [float(columns[axis][-1]) for axis in ("px", "py", "pz")]
        return {"kind": "planner", "gate": 0, "obstacle": 0, "lap": lap, "position": position}
    return {
        "kind": last.kind,
        "gate": last.gate,
        "obstacle": last.obstacle,
        "lap": lap,
        "position": list(last.position),
    }
