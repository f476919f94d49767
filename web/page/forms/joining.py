"""Joining: manual flight by a visitor, with sticks from cockpit.js.

Who flies is a part of every page. The instruments go to the visitor who has the sticks alone.
"""

from __future__ import annotations

from math import asin, atan2, degrees
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta
from viser.transforms import SO3

from quadsim.racing.hand import HAND, Sticks
from quadsim.web.page.parts.board import Board
from quadsim.web.page.scene.camera import FPV, Camera
from quadsim.web.page.server.link import LinkVisitor, Message
from quadsim.web.page.server.seats import Seat, Seats
from quadsim.web.race.cockpit import Cockpit
from quadsim.web.race.competitor import QUATERNION
from quadsim.web.race.lap_timing import LapTiming
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.race.viewing import Viewing

HandPhase = Literal["none", "waiting", "flying", "over"]
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
    """The answer to a position of the sticks; the page knows the round-trip time by its stamp."""

    stamp: float  # [ms]


class Taken(Message, tag="taken"):
    """The answer to a request for the sticks."""

    number: int  # of this visitor
    yours: bool  # whether the visitor has the sticks now


class HandFlight(msgspec.Struct):
    """The state of the manual flight, which every page has."""

    phase: HandPhase
    pilot: int | None = None  # number of the visitor who has the sticks
    silent: bool = False  # no recent stick input, so the failsafe acts
    was_down: bool = False  # the throttle was down, as it has to be before a start
    hover: float = 0.5  # throttle for hovering
    behind: str = ""  # name of the flight controller


class Instruments(Message, tag="instruments"):
    """The instruments of the visitor who flies."""

    t: float = 0.0  # [s]
    speed: float = 0.0  # [m/s]
    height: float = 0.0  # above the ground [m]
    roll: float = 0.0  # to the right [deg]
    pitch: float = 0.0  # nose up [deg]


NOBODY = HandFlight(phase="none")
LEVEL = Instruments()


class Joining:
    """Receives the sticks of one visitor at a time, and sends the instruments to that visitor."""

    def __init__(
        self, board: Board, cockpit: Cockpit, viewing: Viewing, seats: Seats, camera: Camera
    ):
        self._board = board
        self._cockpit = cockpit
        self._viewing = viewing
        self._camera = camera
        self._seats = seats
        self._pilot: LinkVisitor | None = None  # who took the sticks last
        self._sent = LEVEL
        link = board.link
        link.on(Take, self._take)
        link.on(LetGo, lambda visitor, _: cockpit.let_go(visitor.number))
        link.on(StickMessage, self._move)
        link.on_leave(lambda visitor: cockpit.let_go(visitor.number))

    def update(self, s: Snapshot, timings: list[LapTiming]) -> None:
        """Show the state of the manual flight, and send its pilot the instruments.

        Args:
            s: the race at its latest time.
            timings: of its competitors; none if nobody flies by hand.
        """
        timing = by_hand(timings) if s.by_hand else None
        self._board.put("by_hand", hand_flight(s, timing, self._cockpit))
        pilot = self._pilot
        if timing is None or pilot is None or pilot.number != self._cockpit.pilot:
            return
        shown = instruments(timing)
        if shown != self._sent:
            pilot.send(shown)
            self._sent = shown

    def _take(self, visitor: LinkVisitor, message: Take) -> None:
        yours = self._cockpit.take(visitor.number)
        visitor.send(Taken(visitor.number, yours))
        client = self._seats.client_of(message.seat)
        if yours:
            self._pilot = visitor
            self._sent = LEVEL
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


def hand_flight(s: Snapshot, timing: LapTiming | None, cockpit: Cockpit) -> HandFlight:
    """Return the state of the manual flight. timing: its own; None: nobody flies by hand."""
    if timing is None:
        return NOBODY
    entry = timing.entry
    phase: HandPhase = "over"
    if entry.outcome is None:
        phase = "waiting" if s.waiting else "flying"
    return HandFlight(
        phase=phase,
        pilot=cockpit.pilot,
        silent=phase == "flying" and cockpit.sticks is None,
        was_down=cockpit.was_down,
        hover=cockpit.hover,
        behind="Betaflight" if entry.spec.betaflight else "an ideal rate loop",
    )


def instruments(timing: LapTiming) -> Instruments:
    """Return the instruments of a manual flight."""
    entry = timing.entry
    rotation = SO3(entry.rows(QUATERNION, timing.i)).as_matrix()
    forward, left, up = rotation.T
    return Instruments(
        t=round(float(timing.t), 2),
        speed=round(float(entry.speed(timing.i)), 2),
        height=round(float(entry.x["pz"][timing.i]), 2),
        roll=round(degrees(atan2(left[2], up[2])), 1),
        pitch=round(degrees(asin(np.clip(forward[2], -1.0, 1.0))), 1),
    )
