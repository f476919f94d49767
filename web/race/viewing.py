"""Viewing: what each visitor watches, which is the session's race at the time of its playhead."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Concatenate, ParamSpec

from quadsim.web.race import playhead
from quadsim.web.race.session import Session
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.state.commands import ComeBack, Leave, SetPlayhead
from quadsim.web.state.desk import Desk
from quadsim.web.state.page_state import Playhead
from quadsim.web.state.view import View

Arguments = ParamSpec("Arguments")
Moved = Callable[Concatenate[Playhead, Snapshot, float, Arguments], Playhead]


class Viewing:
    """Answers what a visitor watches, and moves its playhead. Any thread may use it.

    Args:
        desk: owner of the playheads.
        session: of the race.
        clock: returns the time on the wall clock [s], as the race's own clock does.
    """

    def __init__(self, desk: Desk, session: Session, clock: Callable[[], float] = perf_counter):
        self._desk = desk
        self._session = session
        self._clock = clock

    def seen_by(self, visitor: int) -> Snapshot:
        """Return the race as a visitor watches it."""
        return playhead.watched(self._playhead(visitor), self._session.snapshot, self._clock())

    def view_of(self, visitor: int) -> View:
        """Return the choices of a visitor's display."""
        return self._desk.state.visitor(visitor).view

    def move(
        self,
        visitor: int,
        moved: Moved[Arguments],
        *arguments: Arguments.args,
        **keywords: Arguments.kwargs,
    ) -> None:
        """Move a visitor's playhead by a function of quadsim.web.race.playhead, such as `seek`."""
        s = self._session.snapshot
        after = moved(self._playhead(visitor), s, self._clock(), *arguments, **keywords)
        self._desk.do(SetPlayhead(visitor, after))

    def go_live(self, visitor: int) -> None:
        """Show a visitor the latest time of the race."""
        self.move(visitor, lambda head, s, _: playhead.live(head, s))

    def arrive(self, visitor: int) -> None:
        """Let a new visitor see a replay from its start."""
        self._desk.do(SetPlayhead(visitor, Playhead(at=self._clock())))

    def come_back(self, visitor: int, seat: str, before: int | None) -> None:
        """Show a visitor who is connected again what the visitor of this seat watched.

        before: number of the visitor that still has this seat; None: it has left.
        """
        if before is not None:
            self._desk.do(Leave(before, seat))
        self._desk.do(ComeBack(visitor, seat))

    def show(self, visitor: int, race: int, t: float | None) -> None:
        """Show a visitor a race from its start, or paused at t [s].

        Args:
            visitor: its number.
            race: number of the race, which may be about to begin.
            t: [s]
        """
        asked = Playhead(race, False, t is None, t or 0.0, self._clock())
        self._desk.do(SetPlayhead(visitor, asked))

    def _playhead(self, visitor: int) -> Playhead:
        return self._desk.state.visitor(visitor).playhead
