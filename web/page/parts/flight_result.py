"""The end of a flight in words."""

from __future__ import annotations

from typing import NamedTuple

from quadsim.palette import FASTER, HIT_ON_DARK
from quadsim.web.race.lap_timing import LapTiming


class Result(NamedTuple):
    """The end of a flight, as a text in a colour; an empty one: that of the text around it."""

    content: str
    colour: str


def result(s: LapTiming) -> Result:
    """Return the result of a flight."""
    entry = s.entry
    if entry.outcome == "finished":
        return Result(f"FINISHED {sum(entry.laps):.3f} s", FASTER)
    if entry.outcome == "interrupted":
        return Result(f"STOPPED in lap {s.lap}", "")
    crash = s.crash
    if crash is None:
        return Result(f"DNF {entry.outcome}, lap {s.lap}", HIT_ON_DARK)
    where = {
        "contact": f"with {crash.place}",
        "hit": f"at {crash.place}",
        "ground": "on the ground",
        "bounds": "out of bounds",
    }
    return Result(f"CRASHED {where[crash.kind]}, lap {crash.lap}", HIT_ON_DARK)
