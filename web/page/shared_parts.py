"""SharedParts: the parts of the page that are the same for all visitors."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from secrets import token_hex

from quadsim.web.page.due import Due
from quadsim.web.page.forms.course_editor import CourseEditor
from quadsim.web.page.parts.board import Board
from quadsim.web.page.parts.elements import EMPTY
from quadsim.web.page.parts.head import Head, SeedsResult, Word, coming_head, next_of
from quadsim.web.page.parts.line_up_table import table_of
from quadsim.web.page.parts.seeds_table import seeds_of
from quadsim.web.page.parts.time_line import time_line_of
from quadsim.web.page.screen import ForAll
from quadsim.web.race.series import Series
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.state.desk import Desk
from quadsim.web.state.line_up import LineUp, line_up_of
from quadsim.web.state.page_state import PageState


class SharedParts:
    """Puts up the time line, the seeds, and what the next START flies.

    Attributes:
        for_all: what all visitors see besides the race.
    """

    def __init__(self, board: Board, desk: Desk, series: Series, editor: CourseEditor):
        self._board = board
        self._desk = desk
        self._series = series
        self._editor = editor
        self._line_up = line_up_of(desk.state)
        self._line_up_of = _flown_of(desk.state)
        self._past_due = Due(0.0)
        self._coming_due = Due(0.0)
        self._edited_due = Due(0.0)
        self._server = token_hex(8)
        self.for_all = ForAll(Head("rest", []), Head("editing", []), EMPTY)

    def update(self, s: Snapshot) -> None:
        """Put up what has changed. s: the race at its latest time."""
        state = self._desk.state
        line_up = self._line_up_now(state)
        self._update_no_race(state, line_up)
        if self._past_due((s.race, [entry.past(inf) for entry in s.competitors])):
            self._board.put("time_line", time_line_of(s.competitors))
        seeds = seeds_of(self._series)
        self._board.put("seeds", seeds)
        result = SeedsResult(self._series.race, seeds.headline)
        if result != self.for_all.seeds:
            self.for_all = replace(self.for_all, seeds=result)
        if self._board.is_wanted("competitors"):
            self._board.put("line_up", table_of(state, line_up))

    def _line_up_now(self, state: PageState) -> LineUp:
        """Return what START flies, in words."""
        flown = _flown_of(state)
        if flown != self._line_up_of:
            self._line_up_of = flown
            self._line_up = line_up_of(state)
        return self._line_up

    def _update_no_race(self, state: PageState, line_up: LineUp) -> None:
        """Make the head before a race, and head and map of the course in work, if they changed."""
        if self._coming_due((line_up, _set_up_of(state))):
            self.for_all = replace(self.for_all, head=coming_head(state, line_up))
            self._board.put("next", next_of(state, line_up, self._server))
        if self._edited_due(self._editor.shown):
            said = self._editor.said()
            self.for_all = replace(
                self.for_all,
                edited=Head("editing", [Word("Course editor")], more=said),
                edited_map=self._editor.map(),
            )


def _set_up_of(state: PageState) -> object:
    """Return the part of the state that a link to the set-up names."""
    return state.race, state.rows, state.world, state.expect, state.rules


def _flown_of(state: PageState) -> object:
    """Return the part of the state that decides what START flies."""
    return state.start, state.world
