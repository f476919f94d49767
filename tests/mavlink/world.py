"""Commands with a link and a downlink of a test: no socket is bound, and nothing flies."""

from quadsim.mavlink.client import MavlinkClient
from quadsim.mavlink.clock import SimulatorClock
from quadsim.mavlink.commands import Commands
from quadsim.mavlink.messages import (
    CommandAck,
    CommandLong,
    HomePosition,
    SetPositionTargetLocalNed,
)
from quadsim.mavlink.served import Served
from quadsim.mavlink.udp_link import Received
from quadsim.vehicle import load_vehicle

PILOT = ("127.0.0.1", 14550)
OTHER = ("127.0.0.1", 40000)
ACCEPTED, DENIED, UNSUPPORTED = 0, 2, 3  # MAV_RESULT
FORWARD = SetPositionTargetLocalNed(0, 1, 1, 1, 0b110111000111, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0)


def command(number, *numbers, system=1):
    """Return COMMAND_LONG."""
    return CommandLong(system, 1, number, 0, *numbers, *(7 - len(numbers)) * (0.0,))


ARM = command(400, 1.0)


class Link:
    """A link whose messages a test gives, and which keeps the answers."""

    def __init__(self):
        self.pilot = None
        self.received = {"unusable": 0, "for other systems": 0}
        self.given = []
        self.answers = []

    def receive(self, wait):
        found, self.given = self.given, []
        return found

    def answer(self, message, to):
        self.answers.append((message, to))

    def follow(self, pilot):
        self.pilot = pilot


class Downlink:
    """Counts the tracks that are sent."""

    def __init__(self):
        self.tracks = 0
        self.resets = 0
        self.custom_mode = 0
        self.has_countdown = False
        self.tells_poses = True
        self.intervals = []

    def set_interval(self, number, interval):
        self.intervals.append((number, interval))
        return number == 30.0

    def send_track(self):
        self.tracks += 1

    def home_position(self):
        return (
            HomePosition(0, 0, 0, 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0)) if self.tells_poses else None
        )


class World:
    """Commands with a link and a downlink of the test."""

    def __init__(self):
        self.link = Link()
        self.downlink = Downlink()
        self.client = MavlinkClient(Served(), None)
        self.commands = Commands(
            self.link, self.client, self.downlink, SimulatorClock(), load_vehicle("archer")
        )
        self.commands.begin_start()

    def say(self, *messages, sender=PILOT):
        """Let a program send messages; return the answers, each message alone."""
        self.link.given = [Received(message, sender) for message in messages]
        self.link.answers.clear()
        self.commands.listen_until(0.0)
        assert all(to == sender for _, to in self.link.answers)
        return [message for message, _ in self.link.answers]

    def result(self, message, sender=PILOT):
        """Let a program send a command; return the result."""
        (ack,) = [m for m in self.say(message, sender=sender) if isinstance(m, CommandAck)]
        return ack.result

    def fly(self):
        """Let the pilot arm the vehicle and fly."""
        assert self.result(ARM) == ACCEPTED
        self.commands.begin_race()
        assert self.say(FORWARD) == []
        return self.client.law
