"""The time line under the scene: laps, gates and incidents of each competitor, and the playback."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, get_args

import msgspec

from quadsim.record.run import CRASHES
from quadsim.web.race.competitor import MISSES, Competitor
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.state.page_state import PaceName

MarkKind = Literal["gate", "lap", "bad"]
# Outcomes that need no mark of their own: a mark of an event, or the end of the lane, is at their
# time. None: the flight has no outcome yet.
ENDS_WITHOUT_MARK = (None, "finished", "crashed", "interrupted")
# the paces of flights
SPEEDS = tuple(float(pace.removesuffix(" x")) for pace in get_args(PaceName))


class TimeMark(msgspec.Struct, array_like=True):
    """An event on the time line, in words."""

    t: float  # [s]
    kind: MarkKind
    title: str


class Lane(msgspec.Struct):
    """A competitor on the time line. end: of its flight [s]; None: it still flies."""

    name: str
    colour: str
    end: float | None
    marks: list[TimeMark]


class TimeLine(msgspec.Struct):
    """The time line.

    Attributes:
        lanes: the competitors.
        laps: starts of the laps of the competitor with the most laps, and end of the last [s].
        speeds: of the playback, which a visitor may choose [race seconds per second].
    """

    lanes: list[Lane]
    laps: list[float]
    speeds: tuple[float, ...] = SPEEDS


class Now(msgspec.Struct):
    """The playback of a visitor at this moment."""

    race: int
    t: float  # [s]
    end: float  # [s]
    flown: float  # last time that can be shown [s]
    playing: bool
    flying: bool
    is_live: bool  # whether the latest time of the race is shown
    can_seek: bool
    has_next: bool  # whether there is a next event to go to
    speed: float  # race seconds per second that are asked for


def time_line_of(entries: Sequence[Competitor]) -> TimeLine:
    """Return the time line of competitors."""
    if not entries:
        return TimeLine([], [])
    longest = max(entries, key=lambda entry: len(entry.laps))
    return TimeLine([_lane(entry) for entry in entries], longest.lap_starts)


def _lane(entry: Competitor) -> Lane:
    flies = entry.live and entry.outcome is None
    marks = [
        TimeMark(event.t, _kind(event.kind, event.gate, entry), _words(event))
        for event in entry.events
    ]
    if entry.outcome not in ENDS_WITHOUT_MARK:
        marks.append(TimeMark(entry.last_t, "bad", f"{entry.outcome}, {entry.last_t:.2f} s"))
    return Lane(
        name=entry.name,
        colour=entry.style.colour,
        end=None if flies else entry.last_t,
        marks=marks,
    )


def _kind(kind: str, gate: int, entry: Competitor) -> MarkKind:
    if kind in (*CRASHES, *MISSES):
        return "bad"
    return "lap" if gate == entry.legs.gates else "gate"


def _words(event) -> str:
    place = f" {event.place}" if event.place else ""
    return f"{event.kind.replace('_', ' ')}{place}, lap {event.lap}, {event.t:.2f} s"


def now_of(s: Snapshot, flies: bool = False) -> Now:
    """Return the playback of a race for a visitor. flies: whether this one flies it by hand."""
    return Now(
        race=s.race,
        t=s.t,
        end=s.end,
        flown=s.flown,
        playing=s.playing,
        flying=s.flying,
        is_live=s.is_live,
        can_seek=bool(s.race) and not flies,
        has_next=s.next_event is not None,
        speed=s.speed,
    )
