"""The planner as HTML: effective sample size, temperature, the terms of the plan's cost; chatter of the thrust."""

from __future__ import annotations

from collections.abc import Sequence

from quadsim.palette import HIT, NEXT
from quadsim.record.metrics import high_frequency_fraction, motor_corner, motor_residual, motor_tau, total_variation
from web.competitor import Competitor
from web.lap_timing import LapTiming
from web.page.html import MONO, bar, box, heading, label, small, table, text


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
    J = sum(terms.values())
    most = max(map(abs, terms.values())) or 1.0
    rows = [
        [text(name), f"{v:+.3f}", bar(abs(v) / most, "#6f86d6" if v > 0 else NEXT, width="180px")]
        for name, v in terms.items()
        if v
    ]
    return table(["term", "mean", ""], rows) + _line(f"J = {J:.3f}, the sum{when}; lower is better")


def _terms(s: LapTiming) -> tuple[dict[str, float], str]:
    """Of the plan's cost; for a stored run those of its last snapshot, and when it was taken."""
    if s.entry.sampled_trajectories:
        return s.entry.sampled_trajectories.terms, ""
    found = s.entry.snapshot(s.i)
    return (found[1].terms, f" at {found[0]:.2f} s") if found else ({}, "")


def chatter(entries: Sequence[Competitor]) -> str:
    """Figures of the whole run so far, for the spectrum's tab."""
    rows = []
    for e in entries:
        if len(e.t) > 16:
            t, u, a, tau = e.t, e.x["a_cmd"], e.x["a"], motor_tau(e.spec["vehicle"])
            share = 100 * high_frequency_fraction(t, u, motor_corner(tau))
            figures = (total_variation(t, u), total_variation(t, a), share, motor_residual(t, u, tau))
            rows.append([label(e.name, e.sampler), *(f"{v:.1f}" for v in figures)])
    note = (
        "total variation of the thrust, commanded and delivered [m/s²/s]; share of the commanded thrust's power above "
        "the motors' corner frequency [%]; residual: what is too fast for the motors, RMS [m/s²]"
    )
    return box(table(["run", "TV", "delivered", "> corner", "residual"], rows), small(note)) if rows else box("")


def _line(words: str) -> str:
    return f'<div style="{MONO};font-size:12px;margin-top:3px">{words}</div>'
