"""Commands obeys the messages of the client and makes its setpoints fly the vehicle."""

from __future__ import annotations

from enum import Enum, auto
from time import perf_counter

from quadsim.mavlink.client import MavlinkClient
from quadsim.mavlink.clock import SimulatorClock
from quadsim.mavlink.downlink import Downlink
from quadsim.mavlink.file_transfer import answer_of_no_files
from quadsim.mavlink.messages import (
    CommandAck,
    CommandInt,
    CommandLong,
    DataTransmissionHandshake,
    FileTransferProtocol,
    HomePosition,
    SetAttitudeTarget,
    SetMode,
    SetPositionTargetLocalNed,
    Statustext,
)
from quadsim.mavlink.packets import SYSTEM
from quadsim.mavlink.questions import VERSION, answers
from quadsim.mavlink.setpoints import Law, Rates, SetpointError, attitude_setpoint, path_setpoint
from quadsim.mavlink.udp_link import Address, Received, UdpLink
from quadsim.vehicle import Vehicle

# Commands of COMMAND_LONG
SET_MODE = 176
ARM = 400
SET_INTERVAL = 511
GET_HOME = 410
REQUEST_MESSAGE = 512
REQUEST_CAPABILITIES = 520
RESET = 31000
# Messages that REQUEST_MESSAGE may ask for: both parts of the track, and the version
TRACK_PARTS = (130.0, 131.0)
AUTOPILOT_VERSION = 148.0
# MAV_RESULT
ACCEPTED = 0
DENIED = 2
UNSUPPORTED = 3
GUIDED = 4  # the mode of ArduPilot's copters in which setpoints are flown
WARNING = 4  # MAV_SEVERITY_WARNING
# Texts that are sent at most until the next race begins; each is sent once to a program.
MOST_TEXTS = 50
# [s] In lock step, the time for a setpoint; without one the flight goes on with the last one.
PATIENCE = 1.0
# [s] A race in lock step begins once the client has been quiet for so long, but no later than after
# PATIENCE: until then, the client may answer messages from before the race.
QUIET = 0.1
# [s] Time without a packet of the client, in lock step without a setpoint, that ends a race
SILENCE = 10.0


class Phase(Enum):
    """The phases of a race."""

    START = auto()  # the vehicle stands at the start until the client arms it
    RACE = auto()  # the vehicle flies
    RESET = auto()  # the client has ended the race, and wants to start anew
    SILENT = auto()  # the client has been silent for SILENCE


class Commands:
    """Obeys the client, and flies its setpoints.

    The program that arms the vehicle is the pilot. Until the race ends, commands and setpoints of
    other programs are refused; their questions are answered.

    Attributes:
        phase: phase of the present race.
        is_armed: whether the vehicle is armed.
        counts_from: time since the simulator's start at which a program was first heard at the
            start, or asked for a reset there [s]; None: none was heard. A countdown begins then.
        wanted: messages since the last control period that want a setpoint each, in lock step.
        unanswered: periods in lock step in which no setpoint came within PATIENCE.

    Args:
        link: the link to the client.
        client: the controller, which flies by the last setpoint.
        downlink: sends the track and other messages for which the client may ask.
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
        self.counts_from: float | None = None
        self.wanted = 0
        self.unanswered = 0
        self._link = link
        self._client = client
        self._downlink = downlink
        self._clock = clock
        self._vehicle = vehicle
        # setpoints since the last control period
        self._setpoints = 0
        # readings of the wall clock at the pilot's last packet and at its last setpoint [s]
        self._heard = 0.0
        self._heard_setpoint = 0.0
        # what was sent to whom since the last race
        self._texts: set[tuple[Address, str]] = set()

    def begin_start(self) -> None:
        """Begin to wait at the start, with a vehicle that is not armed."""
        self.phase = Phase.START
        self.is_armed = False
        self.counts_from = None
        self._link.follow(None)
        self._texts.clear()

    def begin_race(self) -> None:
        """Begin a race, in which only setpoints from now on count."""
        self._client.law = None
        self.phase = Phase.RACE
        self.wanted = 0
        self._setpoints = 0
        self._heard = self._heard_setpoint = perf_counter()

    # When the client is heard.

    def listen_until(self, end: float) -> None:
        """Obey the client until the wall clock is at `end` [s], and all that has come by now."""
        while True:
            self._listen(end - perf_counter())
            if perf_counter() >= end:
                break
        if self.phase is Phase.RACE and perf_counter() - self._heard >= SILENCE:
            self.phase = Phase.SILENT

    def let_answers_pass(self) -> None:
        """Obey the client's answers to messages that were sent before the race."""
        end = perf_counter() + PATIENCE
        quiet_since = perf_counter()
        while perf_counter() < min(end, quiet_since + QUIET):
            if self._listen(QUIET):
                quiet_since = perf_counter()

    def await_setpoint(self) -> None:
        """Wait in lock step until each message that wants a setpoint has one, or for PATIENCE.

        A client that has sent no setpoint for SILENCE ends the race.
        """
        end = perf_counter() + PATIENCE
        while self._setpoints < self.wanted and self.phase is Phase.RACE:
            if perf_counter() >= end:
                self.unanswered += 1
                if self._link.pilot:
                    self._tell("lock step: no setpoint came for 1 s", self._link.pilot)
                break
            self._listen(end - perf_counter())
        self._setpoints = 0
        self.wanted = 0
        if perf_counter() - self._heard_setpoint >= SILENCE:
            self.phase = Phase.SILENT

    def _listen(self, wait: float) -> bool:
        """Obey the messages that have come, and return whether the pilot has sent any.

        Args:
            wait: time to wait for the first one [s].
        """
        found = self._link.receive(wait)
        wants_track = False
        for received in found:
            target = getattr(received.message, "target_system", 0)
            if target not in (0, SYSTEM):
                self._link.received["for other systems"] += 1
                continue
            if self.phase is Phase.START and self.counts_from is None:
                self.counts_from = self._clock.boot
            wants_track = self._obey(received) or wants_track
        # However often it was asked for, it is sent once.
        if wants_track:
            self._downlink.send_track()
        is_heard = any(self._may_fly(received.sender) for received in found)
        if is_heard:
            self._heard = perf_counter()
        return is_heard

    def _may_fly(self, sender: Address) -> bool:
        """Return whether a program is the pilot, or may become it."""
        return self._link.pilot in (None, sender)

    # What a message does.

    def _obey(self, received: Received) -> bool:
        """Obey and answer a message; return whether it asks for the track."""
        message = received.message
        sender = received.sender
        if isinstance(message, SetAttitudeTarget | SetPositionTargetLocalNed):
            self._take(message, sender)
        elif isinstance(message, CommandLong | CommandInt):
            command = message if isinstance(message, CommandLong) else _as_long(message)
            result = self._result(command, sender)
            self._link.answer(CommandAck(command.command, result), sender)
            return _asks_for_track(command)
        elif isinstance(message, SetMode):
            if self._may_fly(sender):
                self._downlink.custom_mode = message.custom_mode
        elif isinstance(message, DataTransmissionHandshake):
            return True
        elif isinstance(message, FileTransferProtocol):
            answer = answer_of_no_files(message, received.member)
            if answer:
                self._link.answer(answer, sender)
        else:
            for answer in answers(message, self._clock):
                if isinstance(answer, Statustext):
                    self._tell(answer.text.decode(), sender)
                else:
                    self._link.answer(answer, sender)
        return False

    def _take(
        self, message: SetAttitudeTarget | SetPositionTargetLocalNed, sender: Address
    ) -> None:
        """Fly a setpoint of the pilot; one that cannot be flown changes nothing, and says why."""
        if not self._may_fly(sender):
            self._tell("setpoint ignored: another program flies", sender)
            return
        self._setpoints += 1
        self._heard_setpoint = perf_counter()
        try:
            if isinstance(message, SetAttitudeTarget):
                setpoint = attitude_setpoint(message, self._vehicle)
            else:
                setpoint = path_setpoint(message)
        except SetpointError as error:
            self._link.received["unusable"] += 1
            self._tell(str(error), sender)
            return
        if self.is_armed:
            self._client.law = Law(setpoint, self._vehicle)
        else:
            self._tell("setpoint ignored: not armed (COMMAND_LONG 400)", sender)

    def _tell(self, text: str, to: Address) -> None:
        """Send a program a text once in a race."""
        if (to, text) not in self._texts and len(self._texts) < MOST_TEXTS:
            self._texts.add((to, text))
            self._link.answer(Statustext(WARNING, text.encode()), to)

    def _result(self, command: CommandLong, sender: Address) -> int:
        """Obey a command, and return its MAV_RESULT."""
        number = command.command
        if number in (ARM, SET_MODE, RESET):
            if not self._may_fly(sender):
                self._tell("command refused: another program flies", sender)
                return DENIED
            if number == ARM:
                return self._arm(command.param1, sender)
            if number == SET_MODE:
                return self._set_mode(command)
            self._reset(sender)
            return ACCEPTED
        if number == REQUEST_CAPABILITIES:
            self._link.answer(VERSION, sender)
            return ACCEPTED
        if number == SET_INTERVAL and command.param1 != AUTOPILOT_VERSION:
            is_set = self._may_fly(sender) and self._downlink.set_interval(
                command.param1, command.param2
            )
            return ACCEPTED if is_set else DENIED
        if number in (REQUEST_MESSAGE, SET_INTERVAL):
            return self._request(command.param1, sender)
        if number == GET_HOME:
            return self._request(HomePosition.ID, sender)
        return UNSUPPORTED

    def _arm(self, wanted: float, sender: Address) -> int:
        """Arm (1) or disarm (0) the vehicle, and return a MAV_RESULT."""
        if wanted not in (0.0, 1.0):
            return DENIED
        self.is_armed = wanted == 1.0
        if self.is_armed:
            self._link.follow(sender)
        else:
            if self.phase is Phase.START:
                self._link.follow(None)
            # The motors stop.
            self._client.law = Law(Rates((0.0, 0.0, 0.0), 0.0), self._vehicle)
        return ACCEPTED

    def _set_mode(self, command: CommandLong) -> int:
        """Take a mode, which HEARTBEAT tells from then on, and return a MAV_RESULT."""
        main, sub = command.param2, command.param3
        if not 0.0 <= main < 256.0 or not 0.0 <= sub < 256.0:
            return DENIED
        # MAVSDK numbers modes as PX4 does, in two bytes; ArduPilot's clients ask for GUIDED alone.
        is_guided = (main, sub) == (GUIDED, 0.0)
        self._downlink.custom_mode = GUIDED if is_guided else int(sub) << 24 | int(main) << 16
        return ACCEPTED

    def _reset(self, sender: Address) -> None:
        """End the race; at the start, begin the countdown anew."""
        if self.phase is Phase.RACE:
            self.phase = Phase.RESET
        elif self.phase is Phase.START:
            self.is_armed = False
            self._link.follow(None)
            self.counts_from = self._clock.boot
            self._downlink.resets += 1
            if not self._downlink.has_countdown:
                self._tell("the race begins when you arm, see --countdown", sender)

    def _request(self, wanted: float, sender: Address) -> int:
        """Send a message that was asked for, and return a MAV_RESULT."""
        if wanted in TRACK_PARTS:
            return ACCEPTED
        if wanted == AUTOPILOT_VERSION:
            self._link.answer(VERSION, sender)
            return ACCEPTED
        home = self._downlink.home_position()
        if wanted == HomePosition.ID and home is not None:
            self._link.answer(home, sender)
            return ACCEPTED
        return UNSUPPORTED


def _as_long(command: CommandInt) -> CommandLong:
    """Return a COMMAND_INT as COMMAND_LONG. No command that is obeyed has a place."""
    return CommandLong(
        command.target_system,
        command.target_component,
        command.command,
        confirmation=0,
        param1=command.param1,
        param2=command.param2,
        param3=command.param3,
        param4=command.param4,
        param5=float(command.x),
        param6=float(command.y),
        param7=command.z,
    )


def _asks_for_track(command: CommandLong) -> bool:
    """Return whether a command asks for the track."""
    return command.command == REQUEST_MESSAGE and command.param1 in TRACK_PARTS
