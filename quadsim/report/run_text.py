"""Describe a run as text: one line, and the paragraph that `print(run)` shows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from quadsim.controllers.excitation import EXCITE
from quadsim.physics.link import WIRE, LinkConfig
from quadsim.racing.hand import HAND
from quadsim.record.run import (
    CRASHES,
    ERROR,
    INTERACTIVE,
    LearnedDelay,
    LearnedRotor,
    RecordedRun,
    has_planner,
    own_parts,
)
from quadsim.report.estimate_metrics import lost_estimate
from quadsim.report.given_state import given_state
from quadsim.report.preset_changes import preset_changes
from quadsim.report.run_metrics import RunMetrics

# Lap times in the paragraph, at most
LAPS = 6
# Text for each kind of crash; a hit names the gate or the obstacle
ENDS = {"hit": "hit", "ground": "hit the ground", "bounds": "left the bounds", "wall": "hit a wall"}


def one_line(run: RecordedRun) -> str:
    """Return a run on one line: course, outcome, laps, time, controller and vehicle."""
    laps = f"{len(run.laps)} of {run.spec['laps']} laps"
    head = f"{run.course_name}: {run.outcome}, {laps}, {run.duration:.3f} s"
    return f"{head}, {flown_with(run.spec)}"


def paragraph(run: RecordedRun, metrics: RunMetrics) -> str:
    """Return a run in a few sentences: outcome, laps, conditions, limit, chatter, planning time."""
    return " ".join(_sentences(run, metrics))


def _sentences(run: RecordedRun, metrics: RunMetrics) -> Iterator[str]:
    laps = f"{len(run.laps)} of {run.spec['laps']} laps in {run.duration:.3f} s"
    yield f"{run.course_name}: {run.outcome}, {laps}{crash_place(run)}."
    yield f"Flown with {flown_with(run.spec)}."
    for line in (given_state(run.spec), lost_estimate(run)):
        if line:
            yield f"{line[0].upper()}{line[1:]}."
    if learned := learned_text(run):
        yield f"Learned in flight: {learned}."
    if run.laps:
        yield f"Lap times: {lap_times(run)}."
    if metrics.above_limit is not None:
        yield f"The race is {limit_text(metrics)}."
    yield f"Thrust chatter is {chatter_text(metrics)}."
    if metrics.motor_variation is not None:
        yield f"The firmware's motor commands vary by {motor_text(metrics)}."
    if not (run.spec.get(HAND) or run.spec.get(EXCITE)):
        who = "The pilot" if run.spec.get("pilot") else "A plan"
        yield f"{who} took {planning_text(metrics)}."
    remark = not_comparable(run.spec)
    if remark:
        yield f"{remark[0].upper()}{remark[1:]}."


def crash_place(run: RecordedRun) -> str:
    """Return the place where a crash or an error ended a run, as text that continues a sentence.

    It is "" for other runs.
    """
    if run.outcome == ERROR:
        return f"; an error of your own code ended it: {run.fault}"
    if run.outcome != "crashed":
        return ""
    last = run.events[-1] if run.events else None
    if last is None or last.kind not in CRASHES:
        return "; the planner raised an error" + (f": {run.fault}" if run.fault else "")
    what = f"{ENDS[last.kind]} {last.place}" if last.kind == "hit" else ENDS[last.kind]
    return f"; it {what} in lap {last.lap}, at {place_text(last.position)}"


def place_text(position: Iterable[float]) -> str:
    """Return a position [m] as text, such as "(1.0, 2.0, 3.0) m"."""
    return f"({', '.join(f'{number:.1f}' for number in position)}) m"


def lap_times(run: RecordedRun) -> str:
    """Return the times of the first laps as text."""
    times = [f"{t:.3f}" for t in run.laps[:LAPS]]
    more = ", ..." if len(run.laps) > LAPS else ""
    return f"{', '.join(times)}{more} s"


def learned_text(run: RecordedRun) -> str:
    """Return what was found of rotors and delay by the end of a flight; "" if nothing was."""
    return learned_so_far(run.learned, run.learned_delay)


def learned_so_far(rotors: Sequence[LearnedRotor], delay: LearnedDelay | None) -> str:
    """Return what is found of rotors and delay in flight, as text; "" if nothing is."""
    found = [
        f"rotor {rotor} at {100.0 * share:.0f} %, from {since:.1f} s"
        for rotor, share, since in rotors
    ]
    if delay:
        late, since = delay
        found.append(f"commands {1e3 * late:.0f} ms late, from {since:.1f} s")
    return ", ".join(found)


def limit_text(metrics: RunMetrics) -> str:
    """Return the distance to the limit as text, for a run with `above_limit`."""
    # Adding 0.0 makes a negative zero a plain one
    above = round(100.0 * (metrics.above_limit or 0.0), 1) + 0.0
    return f"{above:.1f} % above the best known limit of {metrics.limit:.3f} s"


def chatter_text(metrics: RunMetrics) -> str:
    """Return the chatter of the thrust as text."""
    commanded = f"{metrics.thrust_tv:.1f} m/s^2 per second commanded"
    return f"{commanded} and {metrics.thrust_tv_delivered:.1f} delivered"


def motor_text(metrics: RunMetrics) -> str:
    """Return the variation of the firmware's motor commands, and the lost thrust, as text."""
    variation = f"{metrics.motor_variation:.1f} per second"
    return f"{variation}, and {metrics.thrust_lost:.2f} m/s^2 of thrust is lost at full motors"


def planning_text(metrics: RunMetrics) -> str:
    """Return the computing time of a control step as text."""
    return f"{metrics.plan_ms_p50:.1f} ms (p95 {metrics.plan_ms_p95:.1f} ms)"


def flown_with(spec: dict[str, Any]) -> str:
    """Return the controller of a flight and its settings on one line.

    The line names the vehicle, the plant, the flight controller, the seed, the sensors, the link,
    the numbers of the planner that differ from its preset, and the faults.
    """
    controlled = _controlled_by(spec)
    parts = [controlled]
    if has_planner(spec):
        parts.append(f"preset {spec['preset']}")
    behind = " behind Betaflight" if spec.get("betaflight") else ""
    parts.append(f"vehicle {spec['vehicle']['name']}{behind}")
    # The other plants have the same dynamics
    if spec.get("plant") in ("rotorpy", "crazyflow"):
        parts.append(f"plant {spec['plant']}")
    parts.append(f"seed {spec['seed']}")
    heat = spec.get("heat")
    if heat:
        parts.append(
            f"{heat['name']} among {len(heat['names'])}, rules {heat['settings']['rules']}"
        )
    sensing = spec.get("sensing")
    if sensing:
        parts.append(f"sensing {sensing['name']}")
    link = LinkConfig.of(spec)
    if link != WIRE:
        parts.append(str(link))
    if controlled.endswith("sampling") and preset_changes(spec):
        parts.append(preset_changes(spec))
    faults = spec.get("drawn_faults")
    if faults:
        parts.append(f"fault{'s' if len(faults) > 1 else ''} {' and '.join(faults)}")
    return ", ".join(parts)


def _controlled_by(spec: dict[str, Any]) -> str:
    """Return the controller of a flight as text."""
    own = own_parts(spec)
    pilot = spec.get("pilot")
    if "controller" in own:
        return f"controller {own['controller']}"
    if pilot:
        return f"pilot {pilot['name']}"
    if spec.get(HAND):
        return "the sticks of a person"
    if spec.get(EXCITE):
        return "manoeuvres that excite the vehicle"
    return f"{spec['sampler']} sampling"


def not_comparable(spec: dict[str, Any]) -> str:
    """Return a remark on a run whose planner was changed in flight, "" for any other run.

    The remark is shown wherever the run is compared with others.
    """
    changes = len(spec.get(INTERACTIVE, ()))
    if not changes:
        return ""
    plural = "s" if changes > 1 else ""
    return f"interactive, not comparable: {changes} change{plural} in flight"
