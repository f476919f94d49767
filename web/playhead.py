"""Playhead: the time of a race that one visitor watches, as a value.

As with a recorded broadcast, a visitor watches live, or from any time on at a speed of its own. A
flight goes on meanwhile. All methods are pure; `now` is the time on the wall clock [s].
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from quadsim.web.snapshot import SAME, Snapshot


@dataclass(frozen=True)
class Playhead:
    """What a visitor has asked for.

    Attributes:
        race: number of the race that it is of. Any other race begins anew: live if it is flown,
            from its start if it is a replay.
        is_live: whether the visitor watches the latest time; after the flights, their end.
        is_playing: whether the time goes on.
        t: time of the race [s] at the time `at`.
        at: on the wall clock [s].
        speed: race seconds per second.
    """

    race: int = 0
    is_live: bool = True
    is_playing: bool = True
    t: float = 0.0
    at: float = 0.0
    speed: float = 1.0

    def watched(self, s: Snapshot, now: float) -> Snapshot:
        """Return the race at the time that the visitor watches.

        Args:
            s: the race at its latest time.
            now: [s]
        """
        head = self.of(s)
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

    def of(self, s: Snapshot) -> Playhead:
        """Return the playhead of this race, in which it begins anew unless it is of it."""
        if self.race == s.race:
            return self
        # A visitor who comes later sees a replay from its start, too.
        began = max(s.began, self.at)
        return Playhead(s.race, is_live=s.has_flights, at=began, speed=self.speed)

    def live(self, s: Snapshot) -> Playhead:
        """Return the playhead at the latest time of the race."""
        return replace(self.of(s), is_live=True)

    def play(self, s: Snapshot, now: float, on: bool | None = None) -> Playhead:
        """Go on, or pause; None: the other of the two. At its end a replay begins again."""
        seen = self.watched(s, now)
        if on is None:
            on = not seen.playing
        if on == seen.playing:
            return self.of(s)
        at_end = on and not s.flying and seen.t > s.flown - SAME
        return self._from(s, 0.0 if at_end else seen.t, now, on)

    def restart(self, s: Snapshot, now: float) -> Playhead:
        """Go on from the start of the race."""
        return self._from(s, 0.0, now, True)

    def seek(self, s: Snapshot, now: float, t: float) -> Playhead:
        """Pause at t [s]."""
        return self._from(s, min(max(t, 0.0), max(s.flown, 0.0)), now, False)

    def step(self, s: Snapshot, now: float, by: int) -> Playhead:
        """Pause, `by` frames of the first competitor later."""
        seen = self.watched(s, now)
        for entry in s.competitors:
            if len(entry.t):
                frame = min(max(entry.at(seen.t) + by, 0), len(entry.t) - 1)
                return self.seek(s, now, float(entry.t[frame]))
        return self

    def jump(self, s: Snapshot, now: float) -> Playhead:
        """Pause at the next event of any competitor, if there is one."""
        t = self.watched(s, now).next_event
        return self if t is None else self.seek(s, now, t)

    def with_speed(self, s: Snapshot, now: float, speed: float) -> Playhead:
        """Go on at another speed. Who watches live and asks for less falls behind."""
        seen = self.watched(s, now)
        head = replace(self.of(s), speed=speed)
        if seen.is_live and not (s.flying and speed < s.speed):
            return head
        return head._from(s, seen.t, now, seen.playing)

    def _from(self, s: Snapshot, t: float, now: float, is_playing: bool) -> Playhead:
        """Return the playhead at t [s] of this race, no longer live."""
        return Playhead(s.race, False, is_playing, t, now, self.speed)
