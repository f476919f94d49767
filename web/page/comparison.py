"""Comparison: the leader and the gaps, the result of each flight, the chatter of the thrust."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from quadsim.palette import FASTER
from web.lap_timing import LapTiming, Way, order, time_at
from web.page.html import (
    DIM,
    MONO,
    RED,
    TEXT,
    bar,
    coloured,
    div,
    element,
    label,
    rounded,
    small,
    text,
)

WHY_CHATTER = (
    "chatter: how much the commanded thrust jumps in a second [m/s²/s]. Motors lag and cannot"
    " follow, it only heats them: less is better."
)
# With more competitors than this, each row has one line
FEW = 4
FEWEST = 20  # smallest number of frames for the chatter


class Result(NamedTuple):
    """The end of a flight, as a text in a colour."""

    content: str
    colour: str


def result(s: LapTiming) -> Result:
    """Return the result of a flight."""
    entry = s.entry
    if entry.outcome == "finished":
        return Result(f"FINISHED {sum(entry.laps):.3f} s", FASTER)
    crash = s.crash
    if crash is None:
        return Result(f"DNF {text(entry.outcome)}, lap {s.lap}", RED)
    where = {
        "contact": f"with {crash.place}",
        "hit": f"at {crash.place}",
        "ground": "on the ground",
        "bounds": "out of bounds",
    }
    return Result(f"CRASHED {where[crash.kind]}, lap {crash.lap}", RED)


def headline(timings: Sequence[LapTiming]) -> str:
    """Return one sentence with the leader and the lead, as HTML."""
    going = [s for s in order(timings) if not _is_out(s)]
    if not going:
        first = label(order(timings)[0].entry)
        return f"nobody finished; {first} came farthest"
    first = label(going[0].entry)
    if len(going) == 1:
        return f"{first} {'finished alone' if going[0].over else 'flies on alone'}"
    second = going[1]
    behind = seconds_behind(second, going[0])
    if not second.over and rounded(behind, 2) == 0.0:
        return f"{first} is level with {label(second.entry)}"
    verb = "beats" if second.over else "leads"
    more = f" and {len(timings) - 2} more" if len(timings) > 2 else ""
    by = ""
    if np.isfinite(behind):
        by = f" by {element('b', f'{rounded(behind, 2):.2f} s', white_space='nowrap')}"
    return f"{first} {verb} {label(second.entry)}{more}{by}"


def seconds_behind(s: LapTiming, leader: LapTiming) -> float:
    """Return the time of a competitor behind the leader at its place [s]; nan: at the start."""
    if s.over and leader.over:
        return sum(s.entry.laps) - sum(leader.entry.laps)
    way = Way(leader.entry.t, leader.entry.progress)
    return s.t - float(time_at(np.array([s.place]), way)[0])


def comparison(timings: Sequence[LapTiming]) -> str:
    """Return a row for each competitor, the leader first, with the chatter in large figures.

    More than FEW competitors have rows of one line. On a phone, page.css shows the first FEW.
    """
    ranked = order(timings)
    going = [s for s in ranked if not _is_out(s)]
    most = max(s.chatter for s in timings)
    brief = len(timings) > FEW
    parts = []
    for s in [*going, *(s for s in ranked if _is_out(s))]:
        leader = going[0] if going else s
        cells = [
            div(label(s.entry), width="34%", overflow="hidden"),
            div(_standing(s, leader, brief), width="30%"),
            div(_chatter(s, most, brief), width="36%"),
        ]
        parts.append(div("".join(cells), display="flex", align_items="center", gap="8px", **MONO))
    rows = f'<div class="standings">{"".join(parts)}</div>'
    return div(rows + small(WHY_CHATTER), margin_top="4px")


def _is_out(s: LapTiming) -> bool:
    """Return whether a flight has ended without a finish."""
    return s.over and s.entry.outcome != "finished"


def _standing(s: LapTiming, leader: LapTiming, brief: bool) -> str:
    """Return the lap and the gap of a competitor, only the gap if brief, or the result."""
    if s.over:
        ended = result(s)
        return coloured(ended.content, ended.colour)
    lap = "" if brief else f"lap {s.lap}/{s.entry.laps_to_fly} "
    if s is leader:
        return f"{lap}leads"
    behind = seconds_behind(s, leader)
    if not np.isfinite(behind):
        return lap
    return f"{lap}{element('span', f'{rounded(behind, 2):+.2f} s', white_space='nowrap')}"


def _chatter(s: LapTiming, most: float, brief: bool) -> str:
    """Return the chatter of a competitor, unless brief with a bar relative to the largest."""
    if s.i < FEWEST:
        return element("span", "chatter -", color=DIM)
    size = "15px" if brief else "20px"
    figure = element("span", f"{s.chatter:.0f}", font_size=size, font_weight=700)
    word = element("span", " chatter", color=DIM, font_size=TEXT)
    share = s.chatter / max(most, 1e-9)
    return figure + word + ("" if brief else bar(share, s.entry.style.colour, height=4))
