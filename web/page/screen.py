"""Screen: the parts of the page around the scene, as one visitor sees them."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass
from typing import NamedTuple

from quadsim.web.page.forms.playback import ShowNotice
from quadsim.web.page.parts.board import Board, PartName
from quadsim.web.page.parts.elements import EMPTY, Element
from quadsim.web.page.parts.head import NO_SEEDS, Head, SeedsResult, head_of
from quadsim.web.page.parts.moment import Moment
from quadsim.web.page.parts.time_line import now_of
from quadsim.web.page.parts.tower import Tower
from quadsim.web.page.server.link import LinkVisitor
from quadsim.web.page.stages import Stage
from quadsim.web.race.competitor import SAME_TIME
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.state.view import View

# Parts that are made while they are shown; the slow ones once a second
TABLES: tuple[PartName, ...] = ("planner", "events", "laps")
SLOW: tuple[PartName, ...] = ("curves", "chatter")


@dataclass(frozen=True, eq=False)
class ForAll:
    """The parts that the screens of all visitors have in common.

    Attributes:
        head: before the first race.
        edited: head while the visitor edits a course.
        edited_map: map of this course.
        seeds: result of the seeds that have been flown.
    """

    head: Head
    edited: Head
    edited_map: Element
    seeds: SeedsResult = NO_SEEDS


class Beats(NamedTuple):
    """The groups of parts that are due for all visitors in this update.

    Attributes:
        tables: what follows the time that is shown.
        slow: spectra, gaps, chatter; for a visitor who is sent less, the tables as well.
    """

    tables: bool
    slow: bool


class Seen(NamedTuple):
    """The moment of a race that a visitor watches, and its view.

    Attributes:
        moment: the race at the time that it watches.
        view: how it is drawn.
        stage: what stands in the scene.
        flies: whether the visitor flies by hand.
    """

    moment: Moment
    view: View
    stage: Stage
    flies: bool

    @property
    def is_drawn(self) -> bool:
        """Whether the scene has the race."""
        return bool(self.stage.race) and self.stage.race == self.moment.s.race


class Screen:
    """The parts of one visitor.

    Args:
        visitor: of the link.
        s: the race when the visitor came; its notices are not shown any more.
    """

    def __init__(self, board: Board, visitor: LinkVisitor, s: Snapshot):
        self._board = board
        self._visitor = visitor
        self._told = {notice.number for notice in s.notices}
        self._shown: dict[str, object] = {}
        self._slow: set[PartName] = set()  # slow parts whose tab was open at the last update

    def update(self, seen: Seen, for_all: ForAll, beats: Beats) -> None:
        """Show what has changed.

        Args:
            seen: what the visitor watches.
            for_all: what all visitors see besides the race.
            beats: what is due.
        """
        self._put("now", now_of(seen.moment.s, seen.flies))
        tables_are_due = beats.slow if seen.view.light else beats.tables
        if tables_are_due:
            self._update_tables(seen, for_all)
        # Whoever opens the tab of a slow part does not wait for the next beat.
        slow: set[PartName] = {name for name in SLOW if self._is_wanted(name)}
        if seen.is_drawn and (beats.slow or slow - self._slow):
            self._update_slow(seen.moment, slow)
        self._slow = slow
        self._notify(seen.moment.s)

    def forget(self) -> None:
        """Forget the visitor, who has left."""
        self._board.forget(self._visitor.number)

    def _update_tables(self, seen: Seen, for_all: ForAll) -> None:
        """Show head, map, tower and the tables that are open."""
        moment, stage, is_drawn = seen.moment, seen.stage, seen.is_drawn
        s = moment.s
        wanted = [name for name in TABLES if self._is_wanted(name)]
        by_place = seen.view.by_place
        if not self._is_new("tables", (moment, stage, by_place, for_all, wanted)):
            return
        if stage.is_edited:
            self._put("head", for_all.edited)
            self._put("map", for_all.edited_map)
            return
        head = moment.once(for_all, lambda: head_of(s, moment.timings, for_all.head, for_all.seeds))
        # A course that was chosen after a race stands in the scene in place of it.
        is_coming = not stage.race and stage.course and not s.preparing
        self._put("head", for_all.head if is_coming and not s.is_taking_off else head)
        if is_drawn:
            drawn = moment.drawn(by_place)
            name = ("map", by_place)
            self._put("map", moment.once(name, lambda: stage.map.draw(drawn)))
        elif not stage.race:
            self._put("map", stage.plain_map)
        # While the flights of START are prepared, the rows would be those of the race before.
        has_rows = is_drawn and not s.preparing
        self._put("tower", moment.tower if has_rows else Tower([]))
        if "planner" in wanted and is_drawn:
            self._put("planner", moment.planner)
        past = (s.race, is_drawn, [entry.past(s.t) for entry in s.competitors])
        if "events" in wanted and self._is_new("events", past):
            self._put("events", moment.events)
        if "laps" in wanted and self._is_new("laps", past):
            self._put("laps", moment.laps if is_drawn else EMPTY)

    def _update_slow(self, moment: Moment, wanted: Container[PartName]) -> None:
        """Show the curves that are not over time, and the chatter, if their tabs are open."""
        if "curves" in wanted and self._is_new("curves", moment):
            self._put("curves", moment.curves)
        if "chatter" in wanted and self._is_new("chatter", moment):
            self._put("chatter", moment.chatter)

    def _notify(self, s: Snapshot) -> None:
        """Show new notices; the notice of an event waits until the visitor watches its time."""
        for notice in s.notices:
            of_other_race = notice.t is not None and notice.race != s.race
            is_ahead = notice.t is not None and s.t < notice.t - SAME_TIME
            if notice.number in self._told or (is_ahead and not of_other_race):
                continue
            self._told.add(notice.number)
            if not of_other_race:
                self._visitor.send(ShowNotice(notice.kind, notice.title, notice.text))
        self._told &= {notice.number for notice in s.notices}

    def _put(self, name: PartName, content: object) -> None:
        """Show a part to this visitor."""
        self._board.put(name, content, self._visitor.number)

    def _is_wanted(self, name: PartName) -> bool:
        return self._board.is_wanted(name, self._visitor.number)

    def _is_new(self, name: str, what: object) -> bool:
        """Return whether something was last made of something else, and remember this."""
        if self._shown.get(name) == what:
            return False
        self._shown[name] = what
        return True
