"""The result of a race: the runs of the entrants, their order, and events between them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from hashlib import sha256
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from quadsim.course import Course
from quadsim.heat.loop import HeatFrame
from quadsim.heat.spec import HeatSpec
from quadsim.racing.along import Legs
from quadsim.racing.events import Event
from quadsim.racing.referee import way_left
from quadsim.record.run import RecordedRun, Recorder, canonical, hostless

# [s] Two that pass a gate within this time pass it side by side.
UNAMBIGUOUS = 0.05


class Placing(NamedTuple):
    """The result of one entrant."""

    # from 1
    rank: int
    name: str
    outcome: str
    # of the whole race, penalties included [s]; None: it has not finished
    time: float | None
    # gates passed
    passed: int
    # way that was left to the next gate [m]
    to_next_gate: float


class HeatEvent(NamedTuple):
    """An event between entrants: one overtakes, touches another, or is out.

    Examples:
        >>> from quadsim.heat.result import HeatEvent
        >>> HeatEvent(3.1, "overtake", "colored", "gaussian", gate=4, lap=1).kind
        'overtake'
    """

    # time of the race [s]
    t: float
    # overtake, contact, out
    kind: str
    # the entrant that overtook, that was touched, or that is out
    name: str
    # the other entrant; "" if there is none
    other: str = ""
    # number of the gate at which one overtook, or that was hit, from 1; 0: no gate
    gate: int = 0
    # number of the lap of `name`, from 1
    lap: int = 0


class HeatRecorder:
    """Collects the frames of a race.

    Attributes:
        record: the record of the race's specification.
        recorders: a recorder for each entrant.
        faults: the errors of controllers that have ended flights, by the entrant's name.
    """

    def __init__(self, heat: HeatSpec):
        """Begin before the start.

        Args:
            heat: specification of the race.
        """
        self._heat = heat
        # Taken before the race, in which parts of the user's own may change. Tuples become lists
        # now, so that loading gives back the same.
        self.record = json.loads(canonical(heat.record()))
        self.recorders = [Recorder() for _ in heat.entrants]
        self.faults: dict[str, str] = {}

    def add(self, frame: HeatFrame) -> None:
        """Add the next frame of the race."""
        self.recorders[frame.number].add(frame.frame)
        if frame.fault:
            self.faults[self._heat.names[frame.number]] = frame.fault

    def runs(self) -> tuple[RecordedRun, ...]:
        """Return the run of each entrant so far, in the order of the entrants."""
        records = run_records(self.record)
        of_each = zip(self._heat.names, self.recorders, records, strict=True)
        return tuple(
            replace(recorder.run(record), fault=self.faults.get(name, ""))
            for name, recorder, record in of_each
        )


def run_records(of_heat: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the spec of each entrant's run, which also describes the race.

    In a race with a single entrant it is the spec of the flight.

    Args:
        of_heat: record of the race's specification.
    """
    record = {**of_heat, "entrants": [dict(entrant) for entrant in of_heat["entrants"]]}
    entrants = record["entrants"]
    specs = [entrant.pop("spec") for entrant in entrants]
    if len(specs) == 1:
        return specs
    flown = [canonical(hostless(spec)) for spec in specs]
    together = sha256(canonical(record) + b"".join(flown)).hexdigest()
    return [
        spec
        | {
            "heat": {
                "name": entrant["name"],
                "number": k,
                "names": [one["name"] for one in entrants],
                "place": entrant["place"],
                "start_time": record["settings"]["stagger"] * (entrant["place"] - 1),
                "seed": record["seed"],
                "settings": record["settings"],
                "awareness": entrant["awareness"],
                # of the specs of all entrants
                "sha256": together,
            }
        }
        for k, (entrant, spec) in enumerate(zip(entrants, specs, strict=True), 1)
    ]


def placings(names: Sequence[str], runs: Sequence[RecordedRun], course: Course) -> list[Placing]:
    """Return the results, the winner first.

    Entrants that have finished are ranked by their times, the others behind them by the distance
    that they have reached.

    Args:
        names: names of the entrants.
        runs: runs of the entrants, in the same order.
        course: the course.
    """
    results = []
    reached: dict[str, float] = {}  # distances along the race [m]
    for name, run in zip(names, runs, strict=True):
        finished = run.outcome == "finished"
        passed = int(run.telemetry["passed"][-1])
        x, y, z = (float(run.telemetry[axis][-1]) for axis in ("px", "py", "pz"))
        gate = course.gates[passed % len(course.gates)]
        to_next = 0.0 if finished else way_left(gate, (x, y, z))
        time = sum(run.laps) if finished else None
        results.append(Placing(0, name, run.outcome, time, passed, to_next))
        reached[name] = _reached(run, course)

    def order(placing: Placing) -> tuple[bool, float, float]:
        time = placing.time
        return time is None, time or 0.0, -reached[placing.name]

    ranked = sorted(results, key=order)
    return [placing._replace(rank=rank) for rank, placing in enumerate(ranked, 1)]


def _reached(run: RecordedRun, course: Course) -> float:
    """Return the distance along the race that a run has reached [m]."""
    columns = run.telemetry
    p = np.column_stack([columns[axis] for axis in ("px", "py", "pz")])
    passed = columns["passed"]
    laps_begun = int(passed[-1]) // len(course.gates) + 1
    return float(Legs(course, laps_begun).progress(p, passed)[-1])


def heat_events(
    names: Sequence[str], runs: Sequence[RecordedRun], start_times: Sequence[float]
) -> list[HeatEvent]:
    """Return the events between entrants, in the order of time.

    Args:
        names: names of the entrants.
        runs: runs of the entrants, in the same order.
        start_times: start time of each entrant [s].
    """
    found = []
    for k, run in enumerate(runs):
        for event in run.events:
            # Both vehicles of a contact have it among their events.
            if event.kind == "contact" and event.vehicle - 1 > k:
                t = start_times[k] + event.t
                found.append(
                    HeatEvent(t, "contact", names[k], names[event.vehicle - 1], lap=event.lap)
                )
        if run.outcome not in ("finished", "interrupted"):
            found.append(_out(k, run, names, start_times[k]))
    passes = [
        [Pass(start + e.t, e.gate, e.lap) for e in run.events if e.kind == "pass"]
        for run, start in zip(runs, start_times, strict=True)
    ]
    ends = [start + run.duration for run, start in zip(runs, start_times, strict=True)]
    return sorted([*found, *overtakes(names, passes, ends)])


def _out(k: int, run: RecordedRun, names: Sequence[str], start_time: float) -> HeatEvent:
    """Return the event of an entrant that has not finished."""
    last: Event | None = run.events[-1] if run.events else None
    other = names[last.vehicle - 1] if last and last.vehicle else ""
    gate = last.gate if last else 0
    lap = int(run.telemetry["lap"][-1])
    return HeatEvent(start_time + run.duration, "out", names[k], other, gate, lap)


class Pass(NamedTuple):
    """A passage of a gate."""

    t: float  # of the race [s]
    gate: int
    lap: int


def overtakes(
    names: Sequence[str], passes: Sequence[Sequence[Pass]], ends: Sequence[float]
) -> Iterator[HeatEvent]:
    """Yield the overtakes, at which two entrants pass a gate in another order than before.

    An order counts if one entrant passes the gate at least UNAMBIGUOUS seconds before the other
    passes it or the other's flight ends.

    Args:
        names: names of the entrants.
        passes: passages of each entrant, in order.
        ends: end of each entrant's flight [s].
    """
    for a, b in combinations(range(len(names)), 2):
        yield from _overtakes_of_two((a, b), names, passes, ends)


def _overtakes_of_two(
    pair: tuple[int, int],
    names: Sequence[str],
    passes: Sequence[Sequence[Pass]],
    ends: Sequence[float],
) -> Iterator[HeatEvent]:
    """Yield the overtakes of two entrants."""
    leader = None
    for gate in range(max(len(passes[k]) for k in pair)):
        here = [passes[k][gate] if gate < len(passes[k]) else None for k in pair]
        # A vehicle that has not passed the gate would have done so after the end of its flight.
        times = [one.t if one else ends[k] for k, one in zip(pair, here, strict=True)]
        if abs(times[0] - times[1]) < UNAMBIGUOUS:
            continue
        first = 0 if times[0] < times[1] else 1
        passed = here[first]
        if passed is None:
            # Its flight ended before the other one passed the gate.
            return
        if leader is not None and first != leader:
            name, other = names[pair[first]], names[pair[1 - first]]
            yield HeatEvent(passed.t, "overtake", name, other, passed.gate, passed.lap)
        leader = first


def heat_digest(runs: Sequence[RecordedRun]) -> str:
    """Return the sha256 [hex] of everything that a race's seed determines, by its runs."""
    return sha256("".join(run.digest() for run in runs).encode()).hexdigest()
