"""The head of the page: who leads, by how much, what differs, and the state of the race."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Literal, NamedTuple

import msgspec

from quadsim.palette import HIT_ON_DARK, styles_on_dark
from quadsim.record.run import learned_by
from quadsim.report.run_text import learned_so_far, not_comparable
from quadsim.web.page.parts.elements import Element, rounded
from quadsim.web.page.parts.flight_result import Result, result
from quadsim.web.page.parts.timing import above_limits
from quadsim.web.race.lap_timing import LapTiming, order
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.race.standings import standings_at
from quadsim.web.state.differences import compared
from quadsim.web.state.line_up import LineUp
from quadsim.web.state.line_up_link import line_up_text
from quadsim.web.state.page_state import PageState

WATCH = "Watch who leads, and the chatter of the thrust: jumps that no motor can follow."
# The sentences that are shown while a flight is prepared, by Preparing.what
WAITS = {
    "building": "START: building flight {number} of {of}",
    "compiling": "Compiling planner {number} of {of} for this machine: once, it takes some 15 s",
}
# Share of the asked speed, or of real time, below which the page says that the machine is too slow
SLOW = 0.6

Phase = Literal[
    "rest",
    "building",
    "compiling",
    "planning",
    "waiting",
    "flying",
    "paused",
    "replay",
    "stopped",
    "ended",
    "editing",
]


class Word(msgspec.Struct):
    """A part of a sentence, in the colour of a competitor if it has one."""

    text: str
    colour: str = ""


class Head(msgspec.Struct):
    """The head of the page.

    Attributes:
        phase: state of the race.
        sentence: who leads, and by how much; before a race, what START flies.
        differs: what differs between the competitors.
        numbers: the leader's name, lap, lap time, next gate and speed.
        state: the state of the race in words.
        warnings: what a visitor has to know of the numbers; before a race, what to look for.
        more: what the course editor says, which stands beside the scene.
    """

    phase: Phase
    sentence: list[Word]
    differs: str = ""
    numbers: list[Word] = []
    state: str = ""
    warnings: list[str] = []
    more: Element | None = None


class Next(msgspec.Struct):
    """The line-up and course that START would fly, shown beside the button at all times.

    Attributes:
        sentence: the competitors and the course.
        problem: why START cannot fly them; empty: it can.
        set_up: the set-up as a part of an address, see quadsim.web.state.line_up_link; empty: it is
            too long for one.
        server: an identifier that is new each time the server starts.
    """

    sentence: list[Word]
    problem: str
    set_up: str
    server: str


class SeedsResult(NamedTuple):
    """The result of several seeds in one sentence, and the number of the last race of them."""

    race: int
    sentence: list[Word]


NO_SEEDS = SeedsResult(0, [])


def head_of(
    s: Snapshot, timings: list[LapTiming], coming: Head, seeds: SeedsResult = NO_SEEDS
) -> Head:
    """Return the head.

    Args:
        coming: the head before a race.
        seeds: result of several seeds, which stands in the head at the end of the last of them.
    """
    if s.preparing:
        words = WAITS[s.preparing.what].format(**s.preparing._asdict())
        return Head(s.preparing.what, [Word(words)])
    # Flights take off one after another.
    waiting = [one for one in s.competitors if s.flying and one.live and not len(one.t)]
    if waiting:
        names = _joined([Word(one.name, one.style.colour) for one in waiting], " and ")
        many = Word(": with many samples it takes seconds")
        return Head("planning", [Word("Planning the first step of "), *names, many])
    if not timings:
        return coming
    leader = order(timings)[0]
    several = len(timings) > 1
    sentence = _leads(timings, s.t) if several else _alone(leader)
    if seeds.sentence and s.race == seeds.race and all(one.over for one in timings):
        sentence = seeds.sentence
    differs = compared([one.entry.record for one in timings]) if several else ""
    return Head(
        phase=_phase(s, timings),
        sentence=sentence,
        differs=differs,
        numbers=_numbers(leader),
        state=_state(s, timings),
        warnings=_warnings(s, timings),
    )


def line_up_words(state: PageState, line_up: LineUp) -> list[Word]:
    """Return the competitors that START flies, in their colours."""
    styles = styles_on_dark([row.choices.kind for row in state.rows])
    pairs = zip(line_up.names, styles, strict=True)
    return _joined([Word(name, own.colour) for name, own in pairs], " against ")


def next_of(state: PageState, line_up: LineUp, server: str) -> Next:
    """Return what START flies. server: see Next."""
    where = Word(f" on {state.race.course_name}")
    set_up = ""
    with suppress(ValueError):
        set_up = line_up_text(state)
    sentence = [Word("START flies "), *line_up_words(state, line_up), where]
    return Next(sentence, line_up.problem, set_up, server)


def coming_head(state: PageState, line_up: LineUp) -> Head:
    """Return the head before a race: what START flies, and what to look for."""
    names = line_up_words(state, line_up)
    where = f"on {state.race.course_name}"
    if line_up.problem:
        return Head("rest", [Word("START cannot fly this", HIT_ON_DARK)], line_up.problem)
    if len(names) == 1:
        return Head("rest", [Word("START flies "), *names, Word(f" {where}")])
    sentence = [Word("START flies "), *names]
    differs = f"{where}, {state.world}. {line_up.compared}"
    return Head("rest", sentence, differs, warnings=[WATCH])


def _joined(words: Sequence[Word], between: str) -> list[Word]:
    """Return words with a text between each two."""
    found: list[Word] = []
    for word in words:
        found += [Word(between), word] if found else [word]
    return found


def _leads(timings: list[LapTiming], t: float) -> list[Word]:
    """Return one sentence with the leader and the lead."""
    headline = standings_at([one.entry for one in timings], t).headline
    return [
        Word(part) if isinstance(part, str) else Word(part.name, part.style.colour)
        for part in headline.parts
    ]


def _alone(s: LapTiming) -> list[Word]:
    """Return the sentence of a single flight: its result, or the lap that it flies."""
    name = Word(s.entry.name, s.entry.style.colour)
    if not s.over:
        return [name, Word(f" flies lap {s.lap} of {s.entry.laps_to_fly}")]
    ended: Result = result(s)
    return [name, Word(" "), Word(ended.content, ended.colour)]


def _numbers(s: LapTiming) -> list[Word]:
    """Return name, lap, lap time, next gate and speed of a competitor."""
    entry = s.entry
    gate = f"gate {s.gate}/{entry.legs.gates}" if s.gate else "finish"
    return [
        Word(entry.name, entry.style.colour),
        Word(f"lap {s.lap}/{entry.laps_to_fly}"),
        Word(f"{rounded(s.lap_time, 2):.2f} s"),
        Word(gate),
        Word(f"{entry.speed(s.i):.1f} m/s"),
    ]


def _phase(s: Snapshot, timings: Sequence[LapTiming]) -> Phase:
    """Return the state of a race with frames, as a visitor watches it."""
    if s.flying and not s.is_live:
        return "replay" if s.playing else "paused"
    if s.playing:
        if s.waiting:
            return "waiting"
        return "flying" if s.flying else "replay"
    if s.flying or not all(one.over for one in timings):
        return "paused"
    is_stopped = any(one.entry.outcome == "interrupted" for one in timings)
    return "stopped" if is_stopped else "ended"


def _state(s: Snapshot, timings: Sequence[LapTiming]) -> str:
    """Return the state of the race in words."""
    phase = _phase(s, timings)
    at = f"t {s.t:.2f} s"
    pace = f"{s.factor:.2f} x real time"
    if not s.playing:
        at = f"t {s.t:.2f} of {s.end:.2f} s"
        pace = ""
    words: str = phase
    if s.playing and not s.is_live:
        pace = f"{s.speed:g} x"
    if s.flying and not s.is_live:
        at = f"t {s.t:.2f} s, live at {s.flown:.2f} s"
    if phase == "waiting":
        words = "on the start, until the throttle is raised"
        pace = ""
    parts = [part for part in (words, at, pace) if part]
    first = timings[0].entry
    parts.append(f"{first.course.name}, seed {first.spec.seed}")
    if first.spec.sensing:
        parts.append(f"sensing {first.spec.sensing.name}")
    if first.spec.clock == "wall":
        parts.append("wall clock")
    return " · ".join(parts)


def _warnings(s: Snapshot, timings: Sequence[LapTiming]) -> list[str]:
    """Return what a visitor has to know of the numbers."""
    found = []
    if s.is_live and s.flying and 0.0 < s.factor < SLOW * min(s.speed, 1.0):
        found.append("this machine is too slow for real time")
    for timing in timings:
        remark = not_comparable(timing.entry.record)
        if remark:
            found.append(f"{timing.entry.name}: {remark}")
    found += above_limits([timing.entry for timing in order(timings) if timing.over])
    for timing in timings:
        learned = learned_so_far(*learned_by(timing.entry.x, timing.i))
        if learned:
            found.append(f"{timing.entry.name} learned in flight: {learned}")
    return found
