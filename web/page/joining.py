"""Joining: manual flight by a visitor, with sticks from cockpit.js and instruments sent back."""

from __future__ import annotations

from math import asin, atan2, degrees
from time import perf_counter
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta
from viser.transforms import SO3

from quadsim.racing.hand import HAND, Sticks
from quadsim.web.cockpit import Cockpit
from quadsim.web.competitor import QUATERNION
from quadsim.web.lap_timing import LapTiming
from quadsim.web.page.camera import FPV, Camera
from quadsim.web.page.link import Link, LinkVisitor, Message
from quadsim.web.page.seats import Seat, Seats
from quadsim.web.snapshot import Snapshot
from quadsim.web.viewing import Viewing

REMINDER = 1.0  # time after which an unchanged state is sent again, for new pages [s]

Deflection = Annotated[float, Meta(ge=-1.0, le=1.0)]


class Take(Message, tag="take"):
    """A visitor requests the sticks."""

    seat: Seat  # of the same visitor at viser's server


class LetGo(Message, tag="let_go"):
    """A visitor lets go of the sticks."""


class StickMessage(Message, tag="sticks"):
    """The sticks of a visitor, with the time on the page's own clock."""

    roll: Deflection
    pitch: Deflection
    yaw: Deflection
    throttle: Annotated[float, Meta(ge=0.0, le=1.0)]
    stamp: float  # [ms]


class Heard(Message, tag="heard"):
    """The answer to sticks, whose stamp gives the round-trip time."""

    stamp: float  # [ms]


class Taken(Message, tag="taken"):
    """The answer to a request for the sticks."""

    number: int  # of this visitor
    yours: bool  # whether the visitor has the sticks now


class Instruments(Message, tag="instruments"):
    """The instruments for manual flight."""

    phase: Literal["none", "waiting", "flying", "over"]
    pilot: int | None = None  # number of the visitor who has the sticks
    silent: bool = False  # no recent stick input, so the failsafe acts
    was_down: bool = False  # the throttle was down, as it has to be before a start
    hover: float = 0.5  # throttle for hovering
    behind: str = ""  # name of the flight controller
    t: float = 0.0  # [s]
    speed: float = 0.0  # [m/s]
    height: float = 0.0  # above the ground [m]
    roll: float = 0.0  # to the right [deg]
    pitch: float = 0.0  # nose up [deg]


NOBODY = Instruments(phase="none")


class Joining:
    """Receives the sticks of one visitor at a time, and sends instruments to all visitors."""

    def __init__(
        self, link: Link, cockpit: Cockpit, viewing: Viewing, seats: Seats, camera: Camera
    ):
        self._link = link
        self._cockpit = cockpit
        self._viewing = viewing
        self._camera = camera
        self._seats = seats
        self._sent = NOBODY
        self._sent_at = 0.0
        self._link.on(Take, self._take)
        self._link.on(LetGo, lambda visitor, _: cockpit.let_go(visitor.number))
        self._link.on(StickMessage, self._move)
        self._link.on_leave(lambda visitor: cockpit.let_go(visitor.number))

    def update(self, s: Snapshot, timings: list[LapTiming]) -> None:
        """Send the state of the manual flight.

        Args:
            s: the race at its latest time.
            timings: of its competitors; none if nobody flies by hand.
        """
        shown = instruments(s, by_hand(timings), self._cockpit)
        now = perf_counter()
        if shown != self._sent or now - self._sent_at > REMINDER:
            self._link.send_all(shown)
            self._sent = shown
            self._sent_at = now

    def _take(self, visitor: LinkVisitor, message: Take) -> None:
        yours = self._cockpit.take(visitor.number)
        visitor.send(Taken(visitor.number, yours))
        client = self._seats.client_of(message.seat)
        if yours:
            self._viewing.go_live(visitor.number)
        if yours and client:
            self._camera.choose(client, FPV)

    def _move(self, visitor: LinkVisitor, message: StickMessage) -> None:
        sticks = Sticks(message.roll, message.pitch, message.yaw, message.throttle)
        if self._cockpit.move(visitor.number, sticks):
            visitor.send(Heard(message.stamp))


def by_hand(timings: list[LapTiming]) -> LapTiming | None:
    """Return the live manual flight, None if there is none."""
    return next((one for one in timings if one.entry.live and one.entry.sampler == HAND), None)


def instruments(s: Snapshot, timing: LapTiming | None, cockpit: Cockpit) -> Instruments:
    """Return the instruments for manual flight."""
    if not s.by_hand or timing is None:
        return NOBODY
    entry = timing.entry
    rotation = SO3(entry.rows(QUATERNION, timing.i)).as_matrix()
    forward, left, up = rotation.T
    phase = "over"
    if entry.outcome is None:
        phase = "waiting" if s.waiting else "flying"
    return Instruments(
        phase=phase,
        pilot=cockpit.pilot,
        silent=phase == "flying" and cockpit.sticks is None,
        was_down=cockpit.was_down,
        hover=cockpit.hover,
        behind="Betaflight" if entry.spec.get("betaflight") else "an ideal rate loop",
        t=round(float(s.t), 2),
        speed=round(float(entry.speed(timing.i)), 2),
        height=round(float(entry.x["pz"][timing.i]), 2),
        roll=round(degrees(atan2(left[2], up[2])), 1),
        pitch=round(degrees(asin(np.clip(forward[2], -1.0, 1.0))), 1),
    )
