"""Apply the playhead of a visitor to a race, which gives what this visitor watches.

As with a recorded broadcast, a visitor watches live, or from any time on at a speed of its own. A
flight goes on meanwhile. All functions are pure; `now` is the time on the wall clock [s].
"""

from __future__ import annotations

from dataclasses import replace

from quadsim.web.race.competitor import SAME_TIME
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.state.page_state import Playhead


def watched(head: Playhead, s: Snapshot, now: float) -> Snapshot:
    """Return the race at the time that the visitor watches.

    Args:
        head: what the visitor has asked for.
        s: the race at its latest time.
        now: on the wall clock [s]
    """
    head = of_race(head, s)
    if head.is_live:
        return s
    t = head.t + (now - head.at) * head.speed if head.is_playing else head.t
    if head.is_playing and t >= s.flown and s.flying:
        return s  # it has caught up
    is_playing = head.is_playing and t < s.flown
    return replace(
        s,
        t=max(min(t, s.flown), 0.0),
        playing=is_playing,
        is_live=False,
        factor=head.speed if is_playing else 0.0,
        waiting=False,
        speed=head.speed,
    )


def of_race(head: Playhead, s: Snapshot) -> Playhead:
    """Return the playhead for this race. A playhead of another race begins anew."""
    if head.race == s.race:
        return head
    # A visitor who opens the page later sees a replay from its start, too.
    began = max(s.began, head.at)
    return Playhead(s.race, is_live=s.has_flights, at=began, speed=head.speed)


def live(head: Playhead, s: Snapshot) -> Playhead:
    """Return the playhead at the latest time of the race."""
    return replace(of_race(head, s), is_live=True)


def play(head: Playhead, s: Snapshot, now: float, on: bool | None = None) -> Playhead:
    """Go on, or pause; None: the other of the two. At its end a replay begins again."""
    seen = watched(head, s, now)
    if on is None:
        on = not seen.playing
    if on == seen.playing:
        return of_race(head, s)
    at_end = on and not s.flying and seen.t > s.flown - SAME_TIME
    return _from(head, s, 0.0 if at_end else seen.t, now, on)


def restart(head: Playhead, s: Snapshot, now: float) -> Playhead:
    """Go on from the start of the race."""
    return _from(head, s, 0.0, now, True)


def seek(head: Playhead, s: Snapshot, now: float, t: float) -> Playhead:
    """Pause at t [s]."""
    return _from(head, s, min(max(t, 0.0), max(s.flown, 0.0)), now, False)


def step(head: Playhead, s: Snapshot, now: float, by: int) -> Playhead:
    """Pause at the next frame of any competitor, or at the one before if `by` is negative."""
    t = watched(head, s, now).t
    found = [frame for entry in s.competitors if (frame := entry.frame_beside(t, by)) is not None]
    nearest = min if by > 0 else max
    return seek(head, s, now, nearest(found, default=t))


def jump(head: Playhead, s: Snapshot, now: float) -> Playhead:
    """Pause at the first frame that has the next event of any competitor, if there is one."""
    t = watched(head, s, now).next_event
    return head if t is None else seek(head, s, now, t)


def with_speed(head: Playhead, s: Snapshot, now: float, speed: float) -> Playhead:
    """Go on at another speed. A visitor who watches live and asks for less falls behind."""
    seen = watched(head, s, now)
    head = replace(of_race(head, s), speed=speed)
    if seen.is_live and not (s.flying and speed < s.speed):
        return head
    return _from(head, s, seen.t, now, seen.playing)


def _from(head: Playhead, s: Snapshot, t: float, now: float, is_playing: bool) -> Playhead:
    """Return the playhead at t [s] of this race, no longer live."""
    return Playhead(s.race, False, is_playing, t, now, head.speed)
