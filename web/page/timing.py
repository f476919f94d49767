"""The race at one instant, as HTML: head-up display, timing tower, events, planner."""

from __future__ import annotations

from math import isfinite

from quadsim.palette import BEST, FASTER, NEXT
from quadsim.race.events import Event
from quadsim.record.run import not_comparable
from web.competitor import CRASHES, Competitor
from web.lap_timing import LapTiming, order
from web.page.course_map import timeline
from web.page.html import (
    DIM,
    MONO,
    RED,
    TRACK,
    bar,
    box,
    coloured,
    head_up,
    heading,
    label,
    small,
    table,
    text,
)
from web.page.laps import best_sectors, coloured_time
from web.race import Snapshot

EVENTS = 60  # newest that are listed
SLOWER = "#8b93a1"  # of a sector that is no best


def hud(s: Snapshot, timings: list[LapTiming]) -> str:
    """Of the first competitor: lap, its time, next gate, speed, gap; below, what the race is doing,
    the results and the time line.
    """
    if s.compiling or not timings:
        words = "Compiling the planner for this machine: once, it takes some 20 s"
        words = words if s.compiling else "Choose a race and press START"
        return head_up(f'<div style="text-align:center;color:{DIM}">{words}</div>')
    first, entry = timings[0], timings[0].entry
    gate = f"G{first.gate}/{entry.legs.gates}" if first.gate else "FINISH"
    lap, speed = f"LAP {first.lap}/{entry.spec['laps']}", f"{entry.speed(first.i):.1f} m/s"
    cells = [lap, f"{first.lap_time:.2f} s", gate, speed]
    if gaps := [other.gap - first.gap for other in timings[1:] if isfinite(other.gap)]:
        behind = -min(gaps)
        cells.append(coloured(f"{behind:+.2f} s", FASTER if behind < 0 else RED))
    spans = "".join(f"<span>{c}</span>" for c in cells)
    look = f"display:flex;justify-content:space-between;flex-wrap:wrap;gap:0 14px;font-size:19px;font-weight:650;{MONO}"
    results = "".join(_result(one, len(timings) > 1) for one in timings if one.over)
    line = timeline(s.competitors, s.t, s.end)
    return head_up(
        f'<div class="numbers" style="{look}">{spans}</div>', results, _state(s, first), line
    )


def _remark(words: str) -> str:
    return box(f'<div style="text-align:center;color:{DIM}">{words}</div>')


def _result(s: LapTiming, named: bool) -> str:
    """How its flight ended. It stays until another race begins."""
    words, colour = result(s)
    name = label(s.entry) + " " if named else ""
    above = f'<div style="text-align:center;font-size:12px">{above_limit(s.entry)}</div>'
    return f'<div style="text-align:center;font-size:17px;{MONO}">{name}{coloured(words, colour)}</div>{above}'


def above_limit(entry: Competitor) -> str:
    """Of a flight that finished; empty where no limit of its race is known."""
    if entry.outcome != "finished" or entry.limit is None:
        return ""
    share = round(100.0 * entry.limit.above(sum(entry.laps)), 1) + 0.0  # no negative zero
    return f"{share:.1f} % above the best known limit of {entry.limit.time:.3f} s"


def result(s: LapTiming) -> tuple[str, str]:
    """In words, and their colour."""
    entry = s.entry
    if entry.outcome == "finished":
        return f"FINISHED {sum(entry.laps):.3f} s", FASTER
    if crash := s.crash:
        where = {"hit": f"at {crash.place}", "ground": "on the ground", "bounds": "out of bounds"}
        return f"CRASHED {where[crash.kind]}, lap {crash.lap}", RED
    return f"DNF {text(entry.outcome)}, lap {s.lap}", RED


def _state(s: Snapshot, first: LapTiming) -> str:
    still = "ended" if first.over and not s.flying else "paused"
    doing = still if not s.playing else "flying" if s.flying else "replay"
    words = [
        doing,
        f"t {s.t:.2f} s",
        f"{s.factor:.2f} x real time" if s.playing else f"of {s.end:.2f} s",
    ]
    if sensing := first.entry.spec.get("sensing"):
        words.append(f"sensing {text(sensing['name'])}")
    if remark := not_comparable(first.entry.spec):
        words.append(coloured(remark, RED))
    return f'<div style="color:{DIM};font-size:11px;text-align:center;margin-top:2px">{" · ".join(words)}</div>'


def tower(timings: list[LapTiming]) -> str:
    """One row a run, the leader first; below each the sectors of its lap and a bar with its share
    of the race."""
    head = ["", "run", "lap", "gap", "last", "best", "hits", "miss", "chatter"]
    gates = max(s.entry.legs.gates for s in timings)
    best = best_sectors([row for s in timings for row in s.sectors], gates)
    laps = [s.best for s in timings if s.best]
    rows: list[list[str] | str] = []
    for place, s in enumerate(order(timings), 1):
        rows.append(_row(place, s, min(laps, default=0.0)))
        rows.append(_sectors(s, best) + bar(s.progress, s.entry.style.colour))
    note = (
        f"gap [s]: behind at the same place; last, best: lap [s]; {coloured('purple', BEST)} the best of all, "
        f"{coloured('green', FASTER)} a run's own best; chatter: total variation of the commanded thrust [m/s²/s]"
    )
    return box(table(head, rows, left=2), small(note))


def _row(place: int, s: LapTiming, best: float) -> list[str]:
    lost = s.over and s.entry.outcome != "finished"
    gap = (
        coloured("DNF", RED)
        if lost
        else "leader"
        if place == 1
        else f"{s.gap:+.2f}"
        if isfinite(s.gap)
        else "-"
    )
    last, own = (coloured_time(t, best, s.best or 0.0) if t else "-" for t in (s.last, s.best))
    hits, misses = (coloured(str(n), RED) if n else "0" for n in (s.hits, s.misses))
    lap = f"{s.lap}/{s.entry.spec['laps']}"
    return [str(place), label(s.entry), lap, gap, last, own, hits, misses, f"{s.chatter:.1f}"]


def _sectors(s: LapTiming, best: list[float]) -> str:
    """A cell a gate of this lap, as its time compares; grey: no best, dark: not there yet."""
    own = best_sectors(s.sectors, len(best))
    row = s.sectors[s.lap - 1] if len(s.sectors) >= s.lap else []
    cells = ""
    for gate, (record, mine) in enumerate(zip(best, own, strict=True)):
        t = row[gate] if gate < len(row) else None
        colour = TRACK if t is None else BEST if t == record else FASTER if t == mine else SLOWER
        words = f"G{gate + 1}: {t:.2f} s" if t is not None else f"G{gate + 1}"
        cells += f'<div title="{words}" style="flex:1;height:8px;background:{colour};border-radius:2px"></div>'
    return f'<div style="display:flex;gap:2px;margin-bottom:3px">{cells}</div>'


def events(entries: tuple[Competitor, ...], t: float) -> str:
    """What happened, newest first; the later events of a replay are dim."""
    found = [(e.t, entry, _event(e), e.kind in CRASHES) for entry in entries for e in entry.events]
    found += [(c["t"], entry, _change(c), False) for entry in entries for c in entry.changes]
    rows = []
    for when, entry, words, crash in sorted(found, key=lambda row: -row[0])[:EVENTS]:
        words = coloured(words, RED) if crash else words
        words = words if when <= t + 1e-6 else f'<span style="opacity:.65">{words}</span>'
        rows.append([f"{when:.3f}", label(entry), words])
    return box(table(["t [s]", "run", "event"], rows, left=3) if rows else "nothing yet")


def _event(e: Event) -> str:
    place = f" {e.place}" if e.place else ""
    return f"{text(e.kind).replace('_', ' ')}{place} · lap {e.lap} · {e.speed:.1f} m/s"


def _change(c: dict) -> str:
    return f"{text(c['name']).replace('_', ' ')} {c['from']:g} → {c['to']:g}"


def planner(s: LapTiming) -> str:
    x, mppi = s.entry.x, s.entry.spec["planner"]["mppi"]
    if pilot := s.entry.spec.get("pilot"):
        words = f"no plan: the learned pilot {text(pilot['name'])} flies, {x['plan_ms'][s.i]:.2f} ms a command"
        return box(heading("learned pilot"), _line(words))
    # older runs say "ess"
    ess, target = float(x["ess"][s.i]), mppi.get("target_ess", mppi.get("ess"))
    target = f"target {target:g}" if target else "temperature fixed"
    meter = bar(ess / max(mppi["samples"] * 0.1, 1.0), NEXT if ess > 5 else RED, 8)
    words = (
        f"<b>{ess:.0f}</b> effective of {mppi['samples']} samples, {target}; "
        f"temperature <b>{x['temperature'][s.i]:.3g}</b>, planned in <b>{x['plan_ms'][s.i]:.1f}</b> ms"
    )
    return box(
        heading("effective sample size"), meter, _line(words), heading("cost of the plan"), _cost(s)
    )


def _cost(s: LapTiming) -> str:
    terms, when = _terms(s)
    if not terms:
        why = "not kept with this run" if s.entry.outcome else "shown together with the samples"
        return _line(f"J = {s.entry.x['cost'][s.i]:.3f}; its terms: - ({why})")
    most, rows = max(map(abs, terms.values())), []
    for name, v in terms.items():
        if v:
            rows.append(
                [
                    text(name),
                    f"{v:+.3f}",
                    bar(abs(v) / most, "#6f86d6" if v > 0 else NEXT, width="180px"),
                ]
            )
    J = sum(terms.values())
    return table(["term", "mean", ""], rows) + _line(f"J = {J:.3f}, the sum{when}; lower is better")


def _terms(s: LapTiming) -> tuple[dict[str, float], str]:
    """Of the plan's cost; for a stored run those of its last snapshot, and when it was taken."""
    if s.entry.sampled_trajectories:
        return s.entry.sampled_trajectories.terms, ""
    found = s.entry.snapshot(s.i)
    return (found[1].terms, f" at {found[0]:.2f} s") if found else ({}, "")


def _line(words: str) -> str:
    return f'<div style="{MONO};font-size:12px;margin-top:3px">{words}</div>'
