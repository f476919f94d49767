"""The race at one instant, as HTML: head-up display, timing tower, events, planner."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees, isfinite
from typing import NamedTuple

from quadsim.heat.result import Pass, overtakes
from quadsim.palette import BEST, FASTER, NEXT
from quadsim.racing.events import Event
from quadsim.racing.hand import HAND
from quadsim.record.run import not_comparable
from web.competitor import CRASHES, Competitor, heat_of
from web.differences import compared
from web.drawn_samples import drawn_samples, late_plans
from web.lap_timing import LapTiming, order
from web.page.comparison import comparison, headline, result
from web.page.course_map import timeline
from web.page.html import (
    DIM,
    MONO,
    RED,
    TEXT,
    TRACK,
    bar,
    box,
    coloured,
    div,
    element,
    head_up,
    heading,
    label,
    rounded,
    small,
    table,
    text,
)
from web.page.laps import best_sectors, coloured_time
from web.race import Snapshot
from web.standings import standings_at

EVENTS = 60  # number of the newest events in the list
SLOWER = "#8b93a1"  # colour of a sector that is not the best
GOOD_SHARE = 0.1  # share of effective samples at which the meter is full
FEW_SAMPLES = 5  # number of effective samples below which the meter is red
LOWERS_COST = NEXT
RAISES_COST = "#6f86d6"
CENTRED = {"text_align": "center"}


def hud(s: Snapshot, timings: list[LapTiming], coming: str = "") -> str:
    """Return the head-up display.

    It shows the leader, the lead and the chatter of each thrust; lap, lap time, next gate and speed
    of the leader; and below the state of the race, the results and the time line.

    coming: description of the next START, as HTML.
    """
    if s.compiling:
        compiling = "Compiling the planner for this machine: once, it takes some 15 s"
        return head_up(div(compiling, **CENTRED, color=DIM))
    if s.is_taking_off:
        names = " and ".join(label(entry) for entry in s.competitors if entry.live)
        planning = f"Planning the first step of {names}: with many samples it takes seconds"
        return head_up(div(planning, **CENTRED, font_size="16px"))
    if not timings:
        return head_up(coming or div("Choose a race and press START", **CENTRED, color=DIM))
    leader = order(timings)[0]
    if len(timings) > 1:
        standings = standings_at([one.entry for one in timings], s.t)
        differ = compared([one.entry.spec for one in timings])
        leads = div(headline(standings), **CENTRED, font_size="18px") + small(text(differ))
    else:
        leads = _result(leader)
    above = "".join(_above(one, len(timings) > 1) for one in timings if one.over)
    line = timeline(s.competitors, s.t, s.end)
    return head_up(
        leads,
        _numbers(leader, len(timings) > 1),
        comparison(timings),
        above,
        _state(s, timings),
        line,
    )


def _numbers(s: LapTiming, has_name: bool) -> str:
    """Return lap, lap time, next gate and speed of a competitor, with its name if has_name."""
    entry = s.entry
    cells = [label(entry)] if has_name else []
    cells += [
        f"LAP {s.lap}/{entry.laps_to_fly}",
        f"{rounded(s.lap_time, 2):.2f} s",
        f"G{s.gate}/{entry.legs.gates}" if s.gate else "FINISH",
        f"{entry.speed(s.i):.1f} m/s",
    ]
    spans = "".join(f"<span>{cell}</span>" for cell in cells)
    row = div(
        spans,
        display="flex",
        justify_content="space-between",
        flex_wrap="wrap",
        gap="0 14px",
        font_size="15px" if has_name else "19px",
        font_weight=650,
        **MONO,
    )
    return row.replace("<div ", '<div class="numbers" ', 1)


def _result(s: LapTiming) -> str:
    """Return the result of a flight as HTML, which stays until the next race begins."""
    if not s.over:
        return ""
    ended = result(s)
    return div(coloured(ended.content, ended.colour), **CENTRED, font_size="17px", **MONO)


def _above(s: LapTiming, has_name: bool) -> str:
    """Return the excess of a flight's time over the best known limit, as HTML."""
    above = above_limit(s.entry)
    name = label(s.entry) + " " if has_name else ""
    return div(name + above, **CENTRED, font_size=TEXT) if above else ""


def above_limit(entry: Competitor) -> str:
    """Return the relative excess of a flight's time over the best known limit, as text.

    The text is empty for a flight that did not finish, and if no limit is known.
    """
    if entry.outcome != "finished" or entry.limit is None:
        return ""
    share = rounded(100.0 * entry.limit.above(sum(entry.laps)), 1)
    return f"{share:.1f} % above the best known limit of {entry.limit.time:.3f} s"


# Real-time factor below which the page says that the machine is too slow
SLOW = 0.6


def _state(s: Snapshot, timings: Sequence[LapTiming]) -> str:
    """Return the state of the race as text: flying, paused, ended or replay."""
    first = timings[0]
    all_over = all(one.over for one in timings)
    if s.playing:
        doing = "flying" if s.flying else "replay"
        pace = f"{s.factor:.2f} x real time"
        if s.waiting:
            doing = "on the start, until the throttle is raised"
            pace = ""
        if s.flying and 0.0 < s.factor < SLOW:
            pace += ": this machine is too slow for it"
    else:
        doing = "ended" if all_over and not s.flying else "paused"
        pace = f"of {s.end:.2f} s"
    parts = [part for part in (doing, f"t {s.t:.2f} s", pace) if part]
    sensing = first.entry.spec.get("sensing")
    if sensing:
        parts.append(f"sensing {text(sensing['name'])}")
    if first.entry.spec.get("clock") == "wall":
        parts.append("wall clock")
    for timing in timings:
        remark = not_comparable(timing.entry.spec)
        if remark:
            parts.append(coloured(f"{text(timing.entry.name)}: {remark}", RED))
    return div(" · ".join(parts), color=DIM, font_size=TEXT, **CENTRED, margin_top="2px")


def tower(timings: list[LapTiming]) -> str:
    """Return a row for each run, the leader first.

    Below each are the sectors of its lap and a bar with its share of the race.
    """
    head = ["", "run", "lap", "gap", "last", "best", "hits", "miss", "chatter"]
    gates = max(s.entry.legs.gates for s in timings)
    best = best_sectors([row for s in timings for row in s.sectors], gates)
    best_lap = min((s.best for s in timings if s.best), default=0.0)
    rows: list[list[str] | str] = []
    for s in order(timings):
        rows.append(_row(s, best_lap))
        rows.append(_sectors(s, best) + bar(s.progress, s.entry.style.colour))
    best_of_all = coloured("purple", BEST)
    own_best = coloured("green", FASTER)
    note = (
        f"gap [s] to the leader at the same place{_over(timings)}; {best_of_all} best of all, "
        f"{own_best} a run's own best; chatter: total variation of the commanded thrust [m/s²/s]"
    )
    return box(table(head, rows, left=2), small(note))


def _over(timings: Sequence[LapTiming]) -> str:
    """Return the compared part of the race, if it is not the whole race of everyone."""
    over = standings_at([one.entry for one in timings], timings[0].t).over
    return f", {over}" if over else ""


def _row(s: LapTiming, best: float) -> list[str]:
    """Return a run's row of the timing tower.

    best: the best lap of all [s].
    """
    own = s.best or 0.0
    return [
        str(s.standing.rank),
        label(s.entry),
        f"{s.lap}/{s.entry.laps_to_fly}",
        _gap(s),
        coloured_time(s.last, best, own) if s.last else "-",
        coloured_time(s.best, best, own) if s.best else "-",
        coloured(str(s.hits), RED) if s.hits else "0",
        coloured(str(s.misses), RED) if s.misses else "0",
        f"{s.chatter:.1f}",
    ]


def _gap(s: LapTiming) -> str:
    """Return a run's gap to the leader."""
    if s.standing.is_out:
        return coloured("DNF", RED)
    if s.standing.rank == 1:
        return "leader"
    gap = s.standing.gap
    return f"{rounded(gap, 2):+.2f}" if isfinite(gap) else "-"


def _sectors(s: LapTiming, best: list[float]) -> str:
    """Return a cell for each gate of this lap, coloured by its time relative to the best."""
    own = best_sectors(s.sectors, len(best))
    row = s.sectors[s.lap - 1] if len(s.sectors) >= s.lap else []
    cells = ""
    for gate in range(len(best)):
        title = f"G{gate + 1}"
        colour = TRACK  # not reached yet
        if gate < len(row):
            title += f": {row[gate]:.2f} s"
            colour = SLOWER
            if row[gate] == own[gate]:
                colour = FASTER
            if row[gate] == best[gate]:
                colour = BEST
        cell = div("", flex=1, height="8px", background=colour, border_radius="2px")
        cells += cell.replace("<div ", f'<div title="{title}" ', 1)
    return div(cells, display="flex", gap="2px", margin_bottom="3px")


class Happening(NamedTuple):
    """A line of the list of events."""

    t: float  # [s]
    entry: Competitor
    content: str
    is_crash: bool = False


def events(entries: Sequence[Competitor], t: float) -> str:
    """Return the list of events, newest first; the later events of a replay are dim."""
    found = []
    for entry in entries:
        for event in entry.events:
            found.append(Happening(event.t, entry, _event(event), event.kind in CRASHES))
        for change in entry.changes:
            found.append(Happening(change["t"], entry, _change(change)))
    found += _overtakes(entries)
    found.sort(key=lambda happening: -happening.t)
    rows: list[list[str] | str] = []
    for happening in found[:EVENTS]:
        content = happening.content
        if happening.is_crash:
            content = coloured(content, RED)
        if happening.t > t + 1e-6:
            content = element("span", content, opacity=0.65)
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
        Happening(
            event.t, by_name[event.name], f"overtakes {text(event.other)} at gate {event.gate}"
        )
        for event in overtakes(list(by_name), passes, ends)
    ]


def _event(event: Event) -> str:
    """Return an event in words."""
    place = f" {event.place}" if event.place else ""
    kind = text(event.kind).replace("_", " ")
    return f"{kind}{place} · lap {event.lap} · {event.speed:.1f} m/s"


def _change(change: Mapping) -> str:
    """Return a change of a number in words."""
    name = text(change["name"]).replace("_", " ")
    return f"{name} {change['from']:g} → {change['to']:g}"


def planner(s: LapTiming) -> str:
    """Return the planner's statistics: effective sample size, temperature, cost and time."""
    x = s.entry.x
    plan_ms = x["plan_ms"][s.i]
    pilot = s.entry.spec.get("pilot")
    if pilot:
        flies = f"no plan: the learned pilot {text(pilot['name'])} flies"
        return box(heading("learned pilot"), _line(f"{flies}, {plan_ms:.2f} ms a command"))
    if not s.entry.has_planner:
        rates = s.entry.spec[HAND]
        most = ", ".join(f"{degrees(rates[axis]['most']):.0f}" for axis in ("roll", "pitch", "yaw"))
        return box(
            heading("by hand"),
            _line(f"no plan: a person flies, with rates up to {most} deg/s (roll, pitch, yaw)"),
        )
    mppi = s.entry.spec["planner"]["mppi"]
    drawn = drawn_samples(s.entry, s.i)
    ess = float(x["ess"][s.i])
    target = mppi.get("target_ess")
    steered = f"target {target:g} of 1024" if target else "temperature fixed"
    colour = NEXT if ess > FEW_SAMPLES else RED
    meter = bar(ess / max((drawn.count or drawn.most) * GOOD_SHARE, 1.0), colour, height=8)
    update = (
        f"<b>{ess:.0f}</b> effective of {drawn.words}, {steered}; temperature "
        f"<b>{x['temperature'][s.i]:.3g}</b>, planned in <b>{plan_ms:.1f}</b> ms"
    )
    late = late_plans(s.entry, s.i)
    deadline = _line(late) if late else ""
    cost = heading("cost of the plan") + _cost(s)
    whose = div(label(s.entry), margin_top="2px")
    return box(whose, heading("effective sample size"), meter, _line(update), deadline, cost)


def _cost(s: LapTiming) -> str:
    """Return the cost of the plan by term."""
    terms, when = _terms(s)
    if not terms:
        why = "not kept with this run" if s.entry.outcome else "shown together with the samples"
        return _line(f"J = {s.entry.x['cost'][s.i]:.3f}; its terms: - ({why})")
    most = max(map(abs, terms.values()))
    rows: list[list[str] | str] = []
    for name, value in terms.items():
        if value:
            colour = RAISES_COST if value > 0 else LOWERS_COST
            rows.append(
                [text(name), f"{value:+.3f}", bar(abs(value) / most, colour, width="180px")]
            )
    total = f"J = {sum(terms.values()):.3f}, the sum{when}; lower is better"
    return table(["term", "mean", ""], rows) + _line(total)


def _terms(s: LapTiming) -> tuple[dict[str, float], str]:
    """Return the terms of the plan's cost, from the last snapshot of a stored run, and its time."""
    if s.entry.sampled_trajectories:
        return s.entry.sampled_trajectories.terms, ""
    found = s.entry.snapshot(s.i)
    if found is None:
        return {}, ""
    t, snapshot = found
    return snapshot.terms, f" at {t:.2f} s"


def _line(content: str) -> str:
    """Return a line of numbers."""
    return div(content, **MONO, font_size=TEXT, margin_top="3px")
