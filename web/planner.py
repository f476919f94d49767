"""How the planner does, as HTML: effective sample size, temperature, the terms of the plan's cost; chatter figures."""

from __future__ import annotations

from collections.abc import Sequence

from quadsim.palette import HIT, NEXT
from quadsim.record.metrics import high_frequency_fraction, motor_corner, motor_residual, motor_tau, total_variation
from web.competitor import Competitor
from web.html import MONO, bar, box, heading, named, small, table, text
from web.lap_timing import LapTiming


def planner(s: LapTiming) -> str:
    x, mppi = s.competitor.x, s.competitor.spec["planner"]["mppi"]
    ess, target = float(x["ess"][s.i]), mppi.get("target_ess", mppi.get("ess"))  # older runs say "ess"
    target = f"target {target:g}" if target else "temperature fixed"
    meter = bar(ess / max(mppi["samples"] * 0.1, 1.0), NEXT if ess > 5 else HIT, 8)
    words = (
        f"<b>{ess:.0f}</b> effective of {mppi['samples']} samples, {target}; "
        f"temperature <b>{x['temperature'][s.i]:.3g}</b>, planned in <b>{x['plan_ms'][s.i]:.1f}</b> ms"
    )
    return box(heading("effective sample size"), meter, _line(words), heading("cost of the plan"), _terms(s))


def _terms(s: LapTiming) -> str:
    terms, when = _seen(s)
    if not terms:
        why = "not kept with this run" if s.competitor.outcome else "shown together with the samples"
        return _line(f"J = {s.competitor.x['cost'][s.i]:.3f}; its terms: - ({why})")
    J = sum(terms.values())
    terms = {name: value for name, value in terms.items() if value}
    most = max((abs(v) for v in terms.values()), default=1.0)
    rows = [
        [text(name), f"{v:+.3f}", bar(abs(v) / most, "#6f86d6" if v > 0 else NEXT, width="180px")]
        for name, v in terms.items()
    ]
    return table(["term", "mean", ""], rows) + _line(f"J = {J:.3f}, the sum{when}; less is better")


def _seen(s: LapTiming) -> tuple[dict[str, float], str]:
    """The terms of the plan, of a stored run the last that were kept, and when that was."""
    if s.competitor.sampled_trajectories:
        return s.competitor.sampled_trajectories.terms, ""
    kept = s.competitor.picture(s.i)
    return (kept[1].terms, f" at {kept[0]:.2f} s") if kept else ({}, "")


def chatter(competitors: Sequence[Competitor]) -> str:
    """Figures of the whole run so far, beside the spectrum."""
    rows = []
    for competitor in competitors:
        if len(competitor.t) > 16:
            t, u, a, tau = competitor.t, competitor.x["a_cmd"], competitor.x["a"], motor_tau(competitor.spec["vehicle"])
            share = 100 * high_frequency_fraction(t, u, motor_corner(tau))
            figures = (total_variation(t, u), total_variation(t, a), share, motor_residual(t, u, tau))
            rows.append([named(competitor.name, competitor.sampler), *(f"{v:.1f}" for v in figures)])
    head = ["run", "TV", "delivered", "> corner", "residual"]
    note = (
        "total variation of the thrust, commanded and delivered [m/s²/s]; share of its power above the motors' "
        "corner [%]; what no motor follows, RMS [m/s²]"
    )
    return box(table(head, rows), small(note)) if rows else box("")


def _line(words: str) -> str:
    return f'<div style="{MONO};font-size:12px;margin-top:3px">{words}</div>'
