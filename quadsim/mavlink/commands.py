"""Commands obeys the messages of the client and makes its setpoints fly the vehicle."""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum, auto
from functools import partial
from time import perf_counter

from quadsim.mavlink.client import MavlinkClient
from quadsim.mavlink.clock import SimulatorClock
from quadsim.mavlink.downlink import Downlink
from quadsim.mavlink.messages import (
    CommandAck,
    CommandLong,
    DataTransmissionHandshake,
    Message,
    SetAttitudeTarget,
    SetPositionTargetLocalNed,
    Timesync,
)
from quadsim.mavlink.setpoints import (
    Rates,
    Setpoint,
    attitude_setpoint,
    control_of,
    path_setpoint,
)
from quadsim.mavlink.udp_link import UdpLink
from quadsim.vehicle import Vehicle

# Commands of COMMAND_LONG
ARM = 400
REQUEST_MESSAGE = 512
RESET = 31000
# Messages that REQUEST_MESSAGE may ask for: both parts of the track
TRACK_PARTS = (130.0, 131.0)
# MAV_RESULT
ACCEPTED = 0
DENIED = 2
UNSUPPORTED = 3
# [s] In lock step, the time for a setpoint; without one the flight goes on with the last one.
PATIENCE = 1.0
# [s] A race in lock step begins once the client has been quiet for so long, but no later than after
# PATIENCE: until then, the client may answer messages from before the race.
QUIET = 0.1
# [s] Time without a packet of the client, after which a race in lock step is over
SILENCE = 10.0


class Phase(Enum):
    """The phase of the present race."""

    START = auto()  # the vehicle stands at the start until the client arms it
    RACE = auto()  # the vehicle flies
    RESET = auto()  # the client has ended the race, and wants to start anew
    SILENT = auto()  # in lock step, no packet of the client has come for SILENCE


class Commands:
    """Obeys the client, and flies its setpoints.

    Attributes:
        phase: phase of the present race.
        is_armed: whether the vehicle is armed.
        wanted: messages since the last control period that want a setpoint each, in lock step.
        unanswered: periods in lock step in which no setpoint came within PATIENCE.

    Args:
        link: the link to the client.
        client: the controller, which flies by the last setpoint.
        downlink: sends the track, for which the client may ask.
        clock: time since the simulator's start.
        vehicle: the vehicle.
    """

    def __init__(
        self,
        link: UdpLink,
        client: MavlinkClient,
        downlink: Downlink,
        clock: SimulatorClock,
        vehicle: Vehicle,
    ):
        self.phase = Phase.START
        self.is_armed = False
        self.wanted = 0
        self.unanswered = 0
        self._link = link
        self._client = client
        self._downlink = downlink
        self._clock = clock
        self._vehicle = vehicle
        # setpoints since the last control period
        self._setpoints = 0
        # reading of the wall clock when the last packet came [s]
        self._heard = 0.0

    def begin_start(self) -> None:
        """Begin to wait at the start, with a vehicle that is not armed."""
        self.phase = Phase.START
        self.is_armed = False

    def begin_race(self) -> None:
        """Begin a race, in which only setpoints from now on count."""
        self._client.law = None
        self.phase = Phase.RACE
        self.wanted = 0
        self._setpoints = 0
        self._heard = perf_counter()

    # When the client is heard.

    def listen_until(self, end: float) -> None:
        """Obey the client until the wall clock is at `end` [s]; at least what has come by now."""
        while True:
            self._listen(end - perf_counter())
            if perf_counter() >= end:
                return

    def let_answers_pass(self) -> None:
        """Obey what the client still answers to messages from before the race."""
        end = perf_counter() + PATIENCE
        quiet_since = perf_counter()
        while perf_counter() < min(end, quiet_since + QUIET):
            if self._listen(QUIET):
                quiet_since = perf_counter()

    def await_setpoint(self) -> None:
        """Wait in lock step until each message that wants a setpoint has one, or for PATIENCE.

        A client from which no packet has come for SILENCE ends the race.
        """
        end = perf_counter() + PATIENCE
        while self._setpoints < self.wanted and self.phase is Phase.RACE:
            if perf_counter() >= end:
                self.unanswered += 1
                break
            self._listen(end - perf_counter())
        self._setpoints = 0
        self.wanted = 0
        if perf_counter() - self._heard >= SILENCE:
            self.phase = Phase.SILENT

    def _listen(self, wait: float) -> bool:
        """Obey the messages that have come, and return whether any has.

        Args:
            wait: time to wait for the first one [s].
        """
        messages = self._link.receive(wait)
        if messages:
            self._heard = perf_counter()
        for message in messages:
            for answer in self._answers(message):
                self._link.send(answer)
        return bool(messages)

    # What a message does.

    def _answers(self, message: Message) -> Iterator[Message]:
        """Obey a message, and yield the answers to it."""
        match message:
            case SetAttitudeTarget():
                self._take(attitude_setpoint(message, self._vehicle))
            case SetPositionTargetLocalNed():
                self._take(path_setpoint(message))
            case CommandLong():
                yield CommandAck(message.command, self._obey(message))
            case Timesync(tc1=theirs, ts1=ours):
                # A client that asks leaves one of the two at 0.
                now = round(1e9 * self._clock.boot)
                if not ours:
                    yield Timesync(theirs, now)
                elif not theirs:
                    yield Timesync(now, ours)
            case DataTransmissionHandshake():
                self._downlink.send_track()
            case _:
                pass

    def _take(self, setpoint: Setpoint | None) -> None:
        """Fly a setpoint; one whose numbers cannot be used changes nothing."""
        self._setpoints += 1
        if setpoint is None:
            self._link.received["unusable"] += 1
        elif self.is_armed:
            self._fly(setpoint)

    def _fly(self, setpoint: Setpoint) -> None:
        """Make a setpoint the law of the controller."""
        self._client.law = partial(control_of, setpoint, vehicle=self._vehicle)

    def _obey(self, command: CommandLong) -> int:
        """Obey a command, and return its MAV_RESULT."""
        if command.command == ARM:
            self.is_armed = command.param1 > 0.5
            if not self.is_armed:
                self._fly(Rates((0.0, 0.0, 0.0), 0.0))  # the motors stop
            return ACCEPTED
        if command.command == RESET:
            if self.phase is Phase.RACE:
                self.phase = Phase.RESET
            return ACCEPTED
        if command.command == REQUEST_MESSAGE:
            if command.param1 not in TRACK_PARTS:
                return DENIED
            self._downlink.send_track()
            return ACCEPTED
        return UNSUPPORTED
