"""The playback of a race and the camera of a visitor, as commands over the link."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from quadsim.web.page.camera import Camera
from quadsim.web.page.link import LinkVisitor, Message
from quadsim.web.page.seats import Seat, Seats
from quadsim.web.page.server import PageServer
from quadsim.web.race import PageRace
from quadsim.web.session import Session


class Play(Message, tag="play"):
    """A visitor plays or pauses the race; None: the other of the two."""

    on: bool | None = None


class Step(Message, tag="step"):
    """A visitor goes one step forward or back."""

    steps: Literal[-1, 1]


class SetSpeed(Message, tag="set_speed"):
    """A visitor sets the race seconds per second."""

    speed: Annotated[float, Meta(ge=0.05, le=20.0)]


class NextEvent(Message, tag="next_event"):
    """A visitor goes to the next event."""


class ChooseCamera(Message, tag="camera"):
    """A visitor chooses the mode of its camera; None: the next one."""

    seat: Seat
    mode: Literal["free", "chase", "top", "FPV"] | None = None


class FollowNext(Message, tag="follow_next"):
    """A visitor's camera follows the next competitor."""

    seat: Seat


class Shown(Message, tag="shown"):
    """A notice for some seconds."""

    kind: Literal["error", "crash", "lap", "wait", "info"]
    title: str
    text: str = ""


class Playback:
    """Receives the commands of all visitors."""

    def __init__(self, server: PageServer, session: Session, seats: Seats, camera: Camera):
        self._session = session
        self._seats = seats
        self._camera = camera
        link = server.link
        link.on(Play, lambda _, asked: session.tell(PageRace.play, asked.on))
        link.on(Step, lambda _, asked: session.tell(PageRace.step, asked.steps))
        link.on(SetSpeed, lambda _, asked: session.tell(PageRace.set_speed, asked.speed))
        link.on(NextEvent, lambda _, asked: session.tell(PageRace.jump))
        link.on(ChooseCamera, self._choose)
        link.on(FollowNext, self._follow_next)

    def _choose(self, _: LinkVisitor, asked: ChooseCamera) -> None:
        self._camera.choose(self._seats.client_of(asked.seat), asked.mode)

    def _follow_next(self, visitor: LinkVisitor, asked: FollowNext) -> None:
        names = [entry.name for entry in self._session.snapshot.competitors]
        followed = self._camera.follow_next(self._seats.client_of(asked.seat), names)
        if followed:
            visitor.send(Shown("info", f"The camera follows {followed}", "chase and FPV"))
