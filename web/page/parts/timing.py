"""Events and the planner of the race at one instant, as elements."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees
from typing import NamedTuple

from quadsim.heat.result import Pass, overtakes
from quadsim.racing.events import Event
from quadsim.record.run import CRASHES
from quadsim.record.schema import NumberChange
from quadsim.web.page.parts.elements import (
    Content,
    Element,
    bad,
    bar,
    box,
    element,
    heading,
    label,
    line,
    rounded,
    small,
    table,
)
from quadsim.web.race.competitor import Competitor, heat_of
from quadsim.web.race.lap_timing import LapTiming
from quadsim.web.race.numbers_in_flight import drawn_samples, late_plans

EVENTS = 60  # number of the newest events in the list
GOOD_SHARE = 0.1  # share of effective samples at which the meter is full
FEW_SAMPLES = 5  # number of effective samples below which the meter is red
LEGEND = "in the scene: the plan white; sampled trajectories yellow, the cheapest, to violet"


def share_above_limit(entry: Competitor) -> float | None:
    """Return the relative excess of a flight's time over the best known limit [%].

    None: the flight did not finish, or no limit is known.
    """
    if entry.outcome != "finished" or entry.limit is None:
        return None
    return rounded(100.0 * entry.limit.above(sum(entry.laps)), 1)


def above_limits(entries: Sequence[Competitor]) -> list[str]:
    """Return these excesses as text, together for flights with the same limit."""
    found: dict[str, list[str]] = {}
    for entry in entries:
        share = share_above_limit(entry)
        if share is not None and entry.limit is not None:
            excess = f"{entry.name} {share:.1f} %"
            found.setdefault(f"{entry.limit.time:.3f}", []).append(excess)
    return [
        f"above the best known limit of {time} s: {', '.join(excesses)}"
        for time, excesses in found.items()
    ]


class Happening(NamedTuple):
    """A line of the list of events."""

    t: float  # [s]
    entry: Competitor
    content: str
    is_crash: bool = False


def events(entries: Sequence[Competitor], t: float) -> Element:
    """Return the list of events, newest first; the later events of a replay are dim."""
    found = []
    for entry in entries:
        for event in entry.events:
            found.append(Happening(event.t, entry, _event(event), event.kind in CRASHES))
        for change in entry.changes:
            found.append(Happening(change.t, entry, _change(change)))
    found += _overtakes(entries)
    found.sort(key=lambda happening: -happening.t)
    rows: list[list[Content]] = []
    for happening in found[:EVENTS]:
        content: Content = happening.content
        if happening.is_crash:
            content = bad(happening.content)
        if happening.t > t + 1e-6:
            content = element("span", content, look="later")
        rows.append([f"{happening.t:.3f}", label(happening.entry), content])
    return box(table(["t [s]", "run", "event"], rows, left=3) if rows else "nothing yet")


def _overtakes(entries: Sequence[Competitor]) -> list[Happening]:
    """Return the overtakes of a race of several vehicles; ghosts cannot overtake."""
    if len(entries) < 2 or not heat_of(entries):
        return []
    by_name = {entry.name: entry for entry in entries}
    passes = [
        [Pass(event.t, event.gate, event.lap) for event in entry.events if event.kind == "pass"]
        for entry in entries
    ]
    ends = [entry.last_t for entry in entries]
    return [
        Happening(event.t, by_name[event.name], f"overtakes {event.other} at gate {event.gate}")
        for event in overtakes(list(by_name), passes, ends)
    ]


def _event(event: Event) -> str:
    """Return an event in words."""
    place = f" {event.place}" if event.place else ""
    kind = event.kind.replace("_", " ")
    return f"{kind}{place} · lap {event.lap} · {event.speed:.1f} m/s"


def _change(change: NumberChange) -> str:
    """Return a change of a number in words."""
    name = change.name.replace("_", " ")
    return f"{name} {change.before:g} → {change.after:g}"


def planner(s: LapTiming) -> Element:
    """Return the planner's statistics: effective sample size, temperature, cost and time."""
    x = s.entry.x
    plan_ms = x["plan_ms"][s.i]
    spec = s.entry.spec
    if spec.pilot:
        flies = f"no plan: the learned pilot {spec.pilot.name} flies"
        return box(heading("learned pilot"), line(f"{flies}, {plan_ms:.2f} ms a command"))
    if spec.hand:
        axes = (spec.hand.roll, spec.hand.pitch, spec.hand.yaw)
        most = ", ".join(f"{degrees(axis.most):.0f}" for axis in axes)
        return box(
            heading("by hand"),
            line(f"no plan: a person flies, with rates up to {most} deg/s (roll, pitch, yaw)"),
        )
    if not s.entry.has_planner:
        return box(heading("manoeuvres"), line("no plan: manoeuvres excite the vehicle"))
    drawn = drawn_samples(s.entry, s.i)
    ess = float(x["ess"][s.i])
    target = spec.planner.mppi.ess_of(drawn.count or drawn.most)
    steered = f"target {target:.0f}" if target else "temperature fixed"
    meter = bar(
        ess / max((drawn.count or drawn.most) * GOOD_SHARE, 1.0),
        "tall" if ess > FEW_SAMPLES else "tall few",
    )
    update = line(
        element("b", f"{ess:.0f}"),
        f" effective of {drawn.words}, {steered}; temperature ",
        element("b", f"{x['temperature'][s.i]:.3g}"),
        ", planned in ",
        element("b", f"{plan_ms:.1f}"),
        " ms",
    )
    late = late_plans(s.entry, s.i)
    return box(
        element("div", label(s.entry)),
        heading("effective sample size"),
        meter,
        update,
        line(late) if late else "",
        heading("cost of the plan"),
        *_cost(s),
    )


def _cost(s: LapTiming) -> list[Element]:
    """Return the cost of the plan by term."""
    terms, when = _terms(s)
    if not terms:
        why = "not kept with this run" if s.entry.outcome else "shown together with the samples"
        return [line(f"J = {s.entry.x['cost'][s.i]:.3f}; its terms: - ({why})")]
    most = max(map(abs, terms.values()))
    rows: list[list[Content]] = []
    for name, value in terms.items():
        if value:
            look = "short cost" if value > 0 else "short"
            rows.append([name, f"{value:+.3f}", bar(abs(value) / most, look)])
    total = f"J = {sum(terms.values()):.3f}, the sum{when}; lower is better"
    return [table(["term", "mean", ""], rows), line(total), small(LEGEND)]


def _terms(s: LapTiming) -> tuple[dict[str, float], str]:
    """Return the terms of the plan's cost, from the last snapshot of a stored run, and its time."""
    if s.entry.sampled_trajectories and s.is_latest:
        return s.entry.sampled_trajectories.terms, ""
    found = s.entry.snapshot(s.i)
    if found is None:
        return {}, ""
    t, snapshot = found
    return snapshot.terms, f" at {t:.2f} s"
