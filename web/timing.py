"""Head-up display, timing tower, map and events, as HTML."""

from __future__ import annotations

from math import hypot, isfinite

from quadsim.palette import FASTER, HIT, style
from quadsim.record.run import not_comparable
from web.competitor import Competitor
from web.html import DIM, MONO, bar, box, coloured, named, small, table, text
from web.lap_timing import HITS, LapTiming, order
from web.race import Snapshot

WIDTH, HEIGHT = 330, 190  # of the map [px]
EVENTS = 60  # newest that are listed


def hud(s: Snapshot, all_: list[LapTiming]) -> str:
    """Of the first competitor: lap, its time, next gate, speed, gap; what the race is doing."""
    if not all_:
        return box(f'<div style="text-align:center;color:{DIM}">Choose a race and press START</div>')
    me, x = all_[0], all_[0].competitor.x
    speed = hypot(*(x[k][me.i] for k in ("vx", "vy", "vz")))
    gaps = [o.gap - me.gap for o in all_[1:] if isfinite(o.gap)]
    gate = f"G{me.gate}/{me.competitor.legs.gates}" if me.gate else "FINISH"
    cells = [f"LAP {me.lap}/{me.competitor.spec['laps']}", f"{me.lap_time:.2f} s", gate, f"{speed:.1f} m/s"]
    if gaps:
        lead = -min(gaps)
        cells.append(coloured(f"{lead:+.2f}", FASTER if lead < 0 else HIT))
    return box(_big(cells), _state(s, me))


def _big(cells: list[str]) -> str:
    spans = "".join(f"<span>{c}</span>" for c in cells)
    look = f"display:flex;justify-content:space-between;gap:14px;font-size:19px;font-weight:650;{MONO}"
    return f'<div style="{look}">{spans}</div>'


def _state(s: Snapshot, me: LapTiming) -> str:
    doing = "flying" if s.flying else "replay"
    if not s.playing:
        doing = "paused" if s.flying or not me.over else text(me.competitor.outcome or "paused")
    words = [doing, f"t {s.t:.2f} s", f"{s.factor:.2f} x real time" if s.playing else f"of {s.end:.2f} s"]
    if remark := not_comparable(me.competitor.spec):
        words.append(coloured(remark, HIT))
    return f'<div style="color:{DIM};font-size:11px;text-align:center;margin-top:2px">{" · ".join(words)}</div>'


def tower(all_: list[LapTiming]) -> str:
    """One row a run, the leader first; below each, over the whole width, how far it is."""
    head = ["", "run", "lap", "now", "gap", "best", "chatter", "hits"]
    rows: list[list[str] | str] = []
    for place, s in enumerate(order(all_), 1):
        rows += [_row(place, s), bar(s.progress, style(s.competitor.sampler).colour)]
    note = "gap [s]: behind at the same place; chatter: commanded thrust that no motor follows, RMS [m/s²]"
    return box(table(head, rows, left=2), small(note))


def _row(place: int, s: LapTiming) -> list[str]:
    gap = "leader" if place == 1 else f"{s.gap:+.2f}" if isfinite(s.gap) else "-"
    best = f"{s.best:.3f}" if s.best else "-"
    hits = coloured(str(s.hits), HIT) if s.hits else "0"
    name, lap = named(s.competitor.name, s.competitor.sampler), f"{s.lap}/{s.competitor.spec['laps']}"
    return [str(place), name, lap, f"{s.lap_time:.2f}", gap, best, f"{s.chatter:.2f}", hits]


def hit_gates(all_: list[LapTiming]) -> set[int]:
    """1-based numbers of the gates hit so far."""
    return {e.gate for s in all_ for e in s.competitor.events if e.kind == "hit" and e.t <= s.competitor.t[s.i] + 1e-9}


def events(competitors: tuple[Competitor, ...], t: float) -> str:
    """What happened, newest first; what is still to come in a replay is dim."""
    found = [(e.t, competitor, _event(e), e.kind in HITS) for competitor in competitors for e in competitor.events]
    found += [(c["t"], competitor, _change(c), False) for competitor in competitors for c in competitor.changes]
    rows = []
    for when, competitor, words, bad in sorted(found, key=lambda row: -row[0])[:EVENTS]:
        words = coloured(words, HIT) if bad else words
        words = words if when <= t + 1e-6 else f'<span style="opacity:.45">{words}</span>'
        rows.append([f"{when:.3f}", named(competitor.name, competitor.sampler), words])
    return box(table(["t [s]", "run", "event"], rows, left=3)) if rows else box("nothing yet")


def _event(e) -> str:
    gate = f" gate {e.gate}" if e.gate else ""
    return f"{text(e.kind).replace('_', ' ')}{gate} · lap {e.lap} · {e.speed:.1f} m/s"


def _change(c: dict) -> str:
    return f"{text(c['name']).replace('_', ' ')} {c['from']:g} → {c['to']:g}"
