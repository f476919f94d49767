"""The playback of a race and the camera, each a visitor's own, as commands over the link."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Literal

from msgspec import Meta

from quadsim.web.page.scene.camera import Camera, Mode
from quadsim.web.page.server.link import Link, LinkVisitor, Message
from quadsim.web.page.server.seats import Seat, Seats
from quadsim.web.race import playhead
from quadsim.web.race.session import Session
from quadsim.web.race.viewing import Arguments, Moved, Viewing

FLIES = "You fly, and see what is: let go of the sticks first"
PACE = "the flights are as fast as their pace, a setting of the race, and the machine allow"


class Play(Message, tag="play"):
    """A visitor plays or pauses; None: it switches between the two."""

    on: bool | None = None


class TakeSeatAgain(Message, tag="come_back"):
    """A page that was connected before, or is loaded again, asks for what its visitor watched."""

    seat: Seat  # the one that it had


class GoLive(Message, tag="live"):
    """A visitor watches the latest time of the race."""


class Seek(Message, tag="seek"):
    """A visitor watches another time [s]."""

    t: Annotated[float, Meta(ge=0, le=1e6)]


class SeekPlace(Message, tag="seek_place"):
    """A visitor watches the time at which the first competitor is this far along the race [m]."""

    place: Annotated[float, Meta(ge=0, le=1e8)]


class Step(Message, tag="step"):
    """A visitor goes one step forward or back."""

    steps: Literal[-1, 1]


class SetSpeed(Message, tag="set_speed"):
    """A visitor watches at another speed [race seconds per second]."""

    speed: Annotated[float, Meta(ge=0.05, le=20.0)]


class NextEvent(Message, tag="next_event"):
    """A visitor goes to the next event."""


class ChooseCamera(Message, tag="camera"):
    """A visitor chooses the mode of its camera; None: the next one."""

    seat: Seat
    mode: Mode | None = None


class FollowNext(Message, tag="follow_next"):
    """A visitor's camera follows the next competitor."""

    seat: Seat


class ShowNotice(Message, tag="shown"):
    """A notice for some seconds."""

    kind: Literal["error", "crash", "lap", "info"]
    title: str
    text: str = ""


class Playback:
    """Handles visitors' playback and camera messages, which never affect a flight in progress.

    Args:
        comes_back: is called with a visitor who is connected again, and the name of the seat.
    """

    def __init__(
        self,
        link: Link,
        session: Session,
        viewing: Viewing,
        seats: Seats,
        camera: Camera,
        comes_back: Callable[[LinkVisitor, str], None],
    ):
        self._session = session
        self._viewing = viewing
        self._seats = seats
        self._camera = camera
        self._comes_back = comes_back
        link.on(Play, lambda visitor, asked: self._move(visitor, playhead.play, asked.on))
        link.on(Step, lambda visitor, asked: self._move(visitor, playhead.step, asked.steps))
        link.on(NextEvent, lambda visitor, _: self._move(visitor, playhead.jump))
        link.on(SetSpeed, self._set_speed)
        link.on(GoLive, lambda visitor, _: viewing.go_live(visitor.number))
        link.on(TakeSeatAgain, self._come_back)
        link.on(Seek, lambda visitor, asked: self._move(visitor, playhead.seek, asked.t))
        link.on(SeekPlace, self._seek_place)
        link.on(ChooseCamera, self._choose)
        link.on(FollowNext, self._follow_next)

    def _move(
        self,
        visitor: LinkVisitor,
        moved: Moved[Arguments],
        *arguments: Arguments.args,
        **keywords: Arguments.kwargs,
    ) -> None:
        """Move a visitor's playhead, unless this visitor flies by hand."""
        if self._session.flies(visitor.number):
            visitor.send(ShowNotice("info", FLIES))
            return
        self._viewing.move(visitor.number, moved, *arguments, **keywords)

    def _come_back(self, visitor: LinkVisitor, asked: TakeSeatAgain) -> None:
        # The connection before may still seem to be there.
        before = self._seats.visitor_at(asked.seat)
        self._comes_back(visitor, asked.seat)
        self._viewing.come_back(visitor.number, asked.seat, before)

    def _set_speed(self, visitor: LinkVisitor, asked: SetSpeed) -> None:
        self._move(visitor, playhead.with_speed, asked.speed)
        seen = self._viewing.seen_by(visitor.number)
        if seen.is_live and seen.playing and asked.speed > seen.speed:
            visitor.send(ShowNotice("info", "You watch live", PACE))

    def _seek_place(self, visitor: LinkVisitor, asked: SeekPlace) -> None:
        for first in self._session.snapshot.competitors[:1]:
            if len(first.t):
                t = float(first.t[first.at_place(asked.place)])
                self._move(visitor, playhead.seek, t)

    def _choose(self, _: LinkVisitor, asked: ChooseCamera) -> None:
        self._camera.choose(self._seats.client_of(asked.seat), asked.mode)

    def _follow_next(self, visitor: LinkVisitor, asked: FollowNext) -> None:
        names = [entry.name for entry in self._session.snapshot.competitors]
        followed = self._camera.follow_next(self._seats.client_of(asked.seat), names)
        if followed:
            visitor.send(ShowNotice("info", f"The camera follows {followed}", "chase and FPV"))
