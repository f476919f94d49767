"""Comparison: the leader and the gaps, the result of each flight, the chatter of the thrust."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import NamedTuple

from quadsim.palette import FASTER
from web.lap_timing import LapTiming, order
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
from web.standings import Standing, Standings

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


def headline(standings: Standings) -> str:
    """Return one sentence with the leader and the lead, as HTML."""

    def lead(number: str) -> str:
        return element("b", number, white_space="nowrap")

    return standings.headline.words(label, lead)


def comparison(timings: Sequence[LapTiming]) -> str:
    """Return a row for each competitor, the leader first, with the chatter in large figures.

    More than FEW competitors have rows of one line. On a phone, page.css shows the first FEW.
    """
    most = max(s.chatter for s in timings)
    brief = len(timings) > FEW
    alone = len(timings) == 1
    parts = []
    for s in order(timings):
        cells = [
            div(label(s.entry), width="34%", overflow="hidden"),
            div(_standing(s, alone), width="30%"),
            div(_chatter(s, most, brief), width="36%"),
        ]
        parts.append(div("".join(cells), display="flex", align_items="center", gap="8px", **MONO))
    rows = f'<div class="standings">{"".join(parts)}</div>'
    return div(rows + small(WHY_CHATTER), margin_top="4px")


def _standing(s: LapTiming, alone: bool) -> str:
    """Return the gap of a competitor, or its result; alone, its lap."""
    if s.over:
        ended = result(s)
        if s.entry.outcome == "finished":
            return coloured(f"{sum(s.entry.laps):.3f} s", ended.colour)
        return coloured(ended.content, ended.colour)
    if alone:
        return f"lap {s.lap}/{s.entry.laps_to_fly}"
    return element("span", gap_text(s.standing), white_space="nowrap")


def gap_text(s: Standing) -> str:
    """Return the gap of a competitor to the leader as text."""
    if s.is_out:
        return "out"
    if s.rank == 1:
        return "leads"
    return f"{rounded(s.gap, 2):+.2f} s" if isfinite(s.gap) else "-"


def _chatter(s: LapTiming, most: float, brief: bool) -> str:
    """Return the chatter of a competitor, unless brief with a bar relative to the largest."""
    if s.i < FEWEST:
        return element("span", "chatter -", color=DIM)
    size = "15px" if brief else "20px"
    figure = element("span", f"{s.chatter:.0f}", font_size=size, font_weight=700)
    word = element("span", " chatter", color=DIM, font_size=TEXT)
    share = s.chatter / max(most, 1e-9)
    return figure + word + ("" if brief else bar(share, s.entry.style.colour, height=4))
