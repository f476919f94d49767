"""FlightControls: START, STOP and restart over the link, which several visitors share."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from typing import Annotated

from msgspec import Meta

from quadsim.web.page.server.link import Link, LinkVisitor, Message
from quadsim.web.page.server.seats import Seats
from quadsim.web.race import playhead
from quadsim.web.race.next_start import NextStart
from quadsim.web.race.page_race import PageRace
from quadsim.web.race.series import MOST_SEEDS, Series
from quadsim.web.race.session import Session
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.race.viewing import Viewing

Act = Callable[[], None]


class PressStart(Message, tag="start"):
    """A visitor presses START, for one seed or for several in a row."""

    seeds: Annotated[int, Meta(ge=1, le=MOST_SEEDS)] = 1


class PressStop(Message, tag="stop"):
    """A visitor presses STOP."""


class PressRestart(Message, tag="restart"):
    """A visitor asks for the same flights again, or for the start of a replay."""


class Confirm(Message, tag="confirm"):
    """A visitor's answer `yes` to the question of this number."""

    number: Annotated[int, Meta(ge=0, le=10**9)]


class Question(Message, tag="question"):
    """A question for one visitor, with the words of both answers."""

    number: int
    title: str
    yes: str
    no: str


class FlightControls:
    """Begins and ends flights; a visitor has to confirm the end of another visitor's flight.

    Attributes:
        series: what START flies, one seed after another.
    """

    def __init__(
        self, link: Link, session: Session, start: NextStart, viewing: Viewing, seats: Seats
    ):
        self._session = session
        self._seats = seats
        self._viewing = viewing
        self._next = start
        self.series = Series(session)
        self._pilot: int | None = None  # number of the visitor who began the flight
        self._pilot_seat = ""  # the seat of a pilot who has left; otherwise empty
        self._numbers = count(1)
        self._factor = start.desk.state.factor  # race seconds per second that flights have
        # of each visitor the number of its question, and what it asks for
        self._asked: dict[int, tuple[int, Act]] = {}
        link.on(PressStart, self._start)
        link.on(PressStop, self._stop)
        link.on(PressRestart, self._restart)
        link.on(Confirm, self._confirm)
        link.on_leave(self._forget)

    def turn(self, s: Snapshot) -> None:
        """Start the next seed once a race has ended, and give flights the pace that was chosen.

        Args:
            s: the race at its latest time.
        """
        self.series.turn(s)
        factor = self._next.desk.state.factor
        if factor != self._factor:
            self._factor = factor
            self._session.tell(PageRace.set_speed, factor)

    @property
    def _is_on(self) -> bool:
        """Whether something flies, or another seed of a series will."""
        return self._session.snapshot.flying or self.series.is_on

    def _start(self, visitor: LinkVisitor, asked: PressStart) -> None:
        def act() -> None:
            self.series.begin(self._next.choices, self._next.runs, asked.seeds)

        self._ask_first(visitor, act)

    def _stop(self, visitor: LinkVisitor, _: PressStop) -> None:
        """End the present flights and the seeds that would follow, if any."""

        def act() -> None:
            self.series.end()
            self._session.tell(PageRace.end_flights)

        if self._is_on:
            self._ask_first(visitor, act)

    def _restart(self, visitor: LinkVisitor, _: PressRestart) -> None:
        """Fly again, or show the visitor a replay from its start."""
        if self._session.snapshot.has_flights:
            self._ask_first(visitor, lambda: self._session.tell(PageRace.restart))
        else:
            self._viewing.move(visitor.number, playhead.restart)

    def _ask_first(self, visitor: LinkVisitor, act: Act) -> None:
        """Act, after a confirmation if this would end another visitor's flight."""

        def act_as_pilot() -> None:
            self._pilot, self._pilot_seat = visitor.number, ""
            act()

        is_own = self._pilot in (None, visitor.number)
        if not self._is_on or is_own:
            act_as_pilot()
            return
        number = next(self._numbers)
        self._asked[visitor.number] = (number, act_as_pilot)
        title = "Another visitor's flight is on"
        visitor.send(Question(number, title, yes="End it", no="Let it fly"))

    def come_back(self, visitor: LinkVisitor, seat: str) -> None:
        """Give a visitor who is connected again the flight that it began before.

        Args:
            visitor: the visitor, who has a new number.
            seat: name of the visitor's seat.
        """
        # The visitor's earlier connection may still look open.
        is_there = self._pilot is not None and self._seats.visitor_at(seat) == self._pilot
        if is_there or (seat and seat == self._pilot_seat):
            self._pilot, self._pilot_seat = visitor.number, ""

    def _forget(self, visitor: LinkVisitor) -> None:
        """Forget the question to a visitor who has left.

        The flight still belongs to this visitor, who may load the page again, unless the visitor
        has no seat by which to be recognised.
        """
        self._asked.pop(visitor.number, None)
        if self._pilot == visitor.number:
            self._pilot_seat = self._seats.name_of(visitor)
            self._pilot = visitor.number if self._pilot_seat else None

    def _confirm(self, visitor: LinkVisitor, answer: Confirm) -> None:
        number, act = self._asked.pop(visitor.number, (None, None))
        if act is not None and number == answer.number:
            act()
