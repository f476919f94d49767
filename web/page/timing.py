"""The race at one instant, as HTML: head-up display, timing tower, events, planner, map."""

from __future__ import annotations

from math import isfinite

import numpy as np

from quadsim.course import Course, Gate
from quadsim.palette import FASTER, HIT, NEXT, style
from quadsim.race.events import Event
from quadsim.record.run import not_comparable
from web.competitor import CRASHES, Competitor
from web.lap_timing import LapTiming, crashed_gates, order
from web.page.html import DIM, MARKER_EDGE, MONO, bar, box, coloured, heading, label, small, svg, table, text
from web.race import Snapshot

WIDTH, HEIGHT = 330, 190  # of the map [px]
EVENTS = 60  # newest that are listed


def hud(s: Snapshot, timings: list[LapTiming]) -> str:
    """Of the first competitor: lap, its time, next gate, speed, gap; below, what the race is doing."""
    if not timings:
        return box(f'<div style="text-align:center;color:{DIM}">Choose a race and press START</div>')
    first, entry = timings[0], timings[0].entry
    gate = f"G{first.gate}/{entry.legs.gates}" if first.gate else "FINISH"
    lap, speed = f"LAP {first.lap}/{entry.spec['laps']}", f"{entry.speed(first.i):.1f} m/s"
    cells = [lap, f"{first.lap_time:.2f} s", gate, speed]
    if gaps := [other.gap - first.gap for other in timings[1:] if isfinite(other.gap)]:
        behind = -min(gaps)
        cells.append(coloured(f"{behind:+.2f}", FASTER if behind < 0 else HIT))
    spans = "".join(f"<span>{c}</span>" for c in cells)
    look = f"display:flex;justify-content:space-between;gap:14px;font-size:19px;font-weight:650;{MONO}"
    return box(f'<div style="{look}">{spans}</div>', _state(s, first))


def _state(s: Snapshot, first: LapTiming) -> str:
    if s.playing:
        doing = "flying" if s.flying else "replay"
    else:
        doing = text(first.entry.outcome) if first.over and not s.flying else "paused"
    words = [doing, f"t {s.t:.2f} s", f"{s.factor:.2f} x real time" if s.playing else f"of {s.end:.2f} s"]
    if remark := not_comparable(first.entry.spec):
        words.append(coloured(remark, HIT))
    return f'<div style="color:{DIM};font-size:11px;text-align:center;margin-top:2px">{" · ".join(words)}</div>'


def tower(timings: list[LapTiming]) -> str:
    """One row a run, the leader first; below each a bar with its share of the race."""
    head = ["", "run", "lap", "now", "gap", "best", "chatter", "hits"]
    rows: list[list[str] | str] = []
    for place, s in enumerate(order(timings), 1):
        rows += [_row(place, s), bar(s.progress, style(s.entry.sampler).colour)]
    note = "gap [s]: behind at the same place; chatter: total variation of the commanded thrust [m/s²/s]"
    return box(table(head, rows, left=2), small(note))


def _row(place: int, s: LapTiming) -> list[str]:
    gap = "leader" if place == 1 else f"{s.gap:+.2f}" if isfinite(s.gap) else "-"
    best = f"{s.best:.3f}" if s.best else "-"
    hits = coloured(str(s.hits), HIT) if s.hits else "0"
    lap = f"{s.lap}/{s.entry.spec['laps']}"
    return [str(place), label(s.entry), lap, f"{s.lap_time:.2f}", gap, best, f"{s.chatter:.1f}", hits]


def events(entries: tuple[Competitor, ...], t: float) -> str:
    """What happened, newest first; the later events of a replay are dim."""
    found = [(e.t, entry, _event(e), e.kind in CRASHES) for entry in entries for e in entry.events]
    found += [(c["t"], entry, _change(c), False) for entry in entries for c in entry.changes]
    rows = []
    for when, entry, words, crash in sorted(found, key=lambda row: -row[0])[:EVENTS]:
        words = coloured(words, HIT) if crash else words
        words = words if when <= t + 1e-6 else f'<span style="opacity:.45">{words}</span>'
        rows.append([f"{when:.3f}", label(entry), words])
    return box(table(["t [s]", "run", "event"], rows, left=3) if rows else "nothing yet")


def _event(e: Event) -> str:
    gate = f" gate {e.gate}" if e.gate else ""
    return f"{text(e.kind).replace('_', ' ')}{gate} · lap {e.lap} · {e.speed:.1f} m/s"


def _change(c: dict) -> str:
    return f"{text(c['name']).replace('_', ' ')} {c['from']:g} → {c['to']:g}"


def planner(s: LapTiming) -> str:
    x, mppi = s.entry.x, s.entry.spec["planner"]["mppi"]
    ess, target = float(x["ess"][s.i]), mppi.get("target_ess", mppi.get("ess"))  # older runs say "ess"
    target = f"target {target:g}" if target else "temperature fixed"
    meter = bar(ess / max(mppi["samples"] * 0.1, 1.0), NEXT if ess > 5 else HIT, 8)
    words = (
        f"<b>{ess:.0f}</b> effective of {mppi['samples']} samples, {target}; "
        f"temperature <b>{x['temperature'][s.i]:.3g}</b>, planned in <b>{x['plan_ms'][s.i]:.1f}</b> ms"
    )
    return box(heading("effective sample size"), meter, _line(words), heading("cost of the plan"), _cost(s))


def _cost(s: LapTiming) -> str:
    terms, when = _terms(s)
    if not terms:
        why = "not kept with this run" if s.entry.outcome else "shown together with the samples"
        return _line(f"J = {s.entry.x['cost'][s.i]:.3f}; its terms: - ({why})")
    most, rows = max(map(abs, terms.values())), []
    for name, v in terms.items():
        if v:
            rows.append([text(name), f"{v:+.3f}", bar(abs(v) / most, "#6f86d6" if v > 0 else NEXT, width="180px")])
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


class Map:
    """The course from above as SVG, its longer side horizontal, with the drones on it."""

    def __init__(self, course: Course):
        points = course.points(frames=False)[:, :2]
        low, span = points.min(axis=0), np.maximum(np.ptp(points, axis=0), 1.0)
        self._turned = span[1] > span[0]
        if self._turned:
            low, span = low[::-1], span[::-1]
        self._scale = min((WIDTH - 90) / span[0], (HEIGHT - 60) / span[1])
        self._low, self._margin = low, (np.array([WIDTH, HEIGHT]) - span * self._scale) / 2
        path = [*points, points[1]] if course.loop else points
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in map(self._pixels, path))
        self._course = svg("polyline", points=path, fill="none", stroke="#4a5160", stroke_dasharray="3 4")
        self._gates = [self._gate(number, gate) for number, gate in enumerate(course.gates, 1)]

    def draw(self, timings: list[LapTiming]) -> str:
        """The next gate of the first competitor is green, gates that were hit are red."""
        hit, parts = crashed_gates(timings), [self._course]
        for number, (ends, number_text) in enumerate(self._gates, 1):
            colour = NEXT if timings and number == timings[0].gate else HIT if number in hit else "#e2e6ec"
            parts += [svg("line", stroke=colour, stroke_width=3, **ends), number_text]
        for s in reversed(timings):
            x, y = self._pixels(s.entry.rows(("px", "py"), s.i))
            parts.append(svg("circle", cx=x, cy=y, r=6, fill=style(s.entry.sampler).colour, stroke=MARKER_EDGE))
        return svg("svg", "".join(parts), viewBox=f"0 0 {WIDTH} {HEIGHT}", style="width:100%;display:block")

    def _pixels(self, p: np.ndarray) -> np.ndarray:
        """From x, y [m]."""
        x, y = ((p[::-1] if self._turned else p) - self._low) * self._scale + self._margin
        return np.array([x, y if self._turned else HEIGHT - y])

    def _gate(self, number: int, gate: Gate) -> tuple[dict, str]:
        """The ends of its line, and its number beside it."""
        centre, half = np.array(gate.position[:2]), gate.rotation[:2, 1] * max(*gate.opening, 1.6) / 2
        a, b = self._pixels(centre - half), self._pixels(centre + half)
        x, y = b + (b - a) / max(float(np.linalg.norm(b - a)), 1e-6) * 8
        number_text = svg("text", str(number), x=x, y=y + 3, fill="#aab2c0", font_size=10, text_anchor="middle")
        return dict(zip(("x1", "y1", "x2", "y2"), (*a, *b), strict=True)), number_text
