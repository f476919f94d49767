"""A UDP socket for messages to and from a client, and for the pictures of the camera."""

from __future__ import annotations

import socket
from collections import Counter
from collections.abc import Iterable
from ipaddress import ip_address
from select import select
from time import perf_counter
from typing import NamedTuple

from quadsim.files.values import SettingError
from quadsim.mavlink.messages import Message
from quadsim.mavlink.packets import Member, Packer, parse

# [bytes] longest datagram
LONGEST = 65536
# Datagrams and bytes read at once, so that a flood does not hold up the flight
MOST = 200
MOST_BYTES = 2 * LONGEST
ANY = "0.0.0.0"
# Programs that are sent messages at most, and the time after which a silent one is not [s]
MOST_LISTENERS = 4
FORGOTTEN = 10.0

Address = tuple[str, int]
EVERYBODY = Member(0, 0)  # in MAVLink, the target of a message to all


class Received(NamedTuple):
    """A message, the program that has sent it, and what the program calls itself."""

    message: Message
    sender: Address
    member: Member = EVERYBODY


class UdpLink:
    """Sends messages to a client and to programs beside it, and receives their messages.

    Messages go to the programs of the client's machine that are heard, up to MOST_LISTENERS. A
    program that is silent for FORGOTTEN is left out, but the pilot is not. While there is no pilot,
    messages also go to the address and port that are given. Datagrams of other machines are counted
    and not read.

    Attributes:
        pilot: the program that has armed the vehicle; None: none has.
        sent: messages sent, by name, each counted once; datagrams of pictures count as "picture".
        received: messages received, by name; packets of other messages count as "unknown",
            pieces that are no packets as "bad", datagrams of other machines as "strange", setpoints
            that cannot be flown as "unusable".

    Args:
        host: address of the client; if it is a loopback address, the socket receives from there
            alone.
        port: port of the client for messages.
        camera_port: port of the client for pictures.

    Raises:
        SettingError: the host has no address.
    """

    def __init__(self, host: str, port: int, camera_port: int):
        self._host = address_of(host)
        self._first = (self._host, port)
        self._camera = (self._host, camera_port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        own = self._host if ip_address(self._host).is_loopback else ANY
        self._socket.bind((own, 0))
        self._packer = Packer()
        # a program -> reading of the wall clock at its last message [s]
        self._heard: dict[Address, float] = {}
        self.pilot: Address | None = None
        self.sent: Counter[str] = Counter()
        self.received: Counter[str] = Counter()

    @property
    def port(self) -> int:
        """The simulator's own port."""
        return self._socket.getsockname()[1]

    def send(self, message: Message) -> None:
        """Send a message to all programs that listen; it is lost if it cannot be sent at once.

        Args:
            message: the message.
        """
        packet = self._packer.packet(message)
        for address in self._listeners():
            self._put(packet, address)
        self.sent[message.NAME] += 1

    def answer(self, message: Message, to: Address) -> None:
        """Send a message to one program."""
        self._put(self._packer.packet(message), to)
        self.sent[message.NAME] += 1

    def send_picture(self, datagrams: Iterable[bytes]) -> None:
        """Send the datagrams of a picture."""
        for datagram in datagrams:
            self._put(datagram, self._camera)
        self.sent["picture"] += 1

    def _listeners(self) -> list[Address]:
        """Return the addresses to which messages go."""
        late = perf_counter() - FORGOTTEN
        self._heard = {
            address: heard
            for address, heard in self._heard.items()
            if heard >= late or address == self.pilot
        }
        found = list(self._heard)
        if self.pilot is None and self._first not in found:
            found.append(self._first)
        return found

    def _put(self, datagram: bytes, address: Address) -> None:
        """Send a datagram; it is lost if the buffer is full or the address cannot be reached."""
        try:
            self._socket.sendto(datagram, address)
        except OSError:
            self.sent["lost"] += 1

    def receive(self, wait: float = 0.0) -> list[Received]:
        """Return the messages that have come.

        Args:
            wait: time to wait for the first one [s].
        """
        if not select([self._socket], [], [], max(wait, 0.0))[0]:
            return []
        found: list[Received] = []
        size = 0
        for _ in range(MOST):
            if size > MOST_BYTES:
                break
            try:
                datagram, address = self._socket.recvfrom(LONGEST)
            except OSError:  # none is left
                break
            size += len(datagram)
            if address[0] != self._host:
                self.received["strange"] += 1
                continue
            parsed = parse(datagram)
            self.received["unknown"] += parsed.unknown
            self.received["bad"] += parsed.bad
            self.received.update(message.NAME for message in parsed.messages)
            if parsed.packets or parsed.unknown:
                self._note(address)
            found += [Received(one.message, address, one.member) for one in parsed.packets]
        return found

    def _note(self, address: Address) -> None:
        """Note that a program was heard; beyond MOST_LISTENERS it is sent nothing."""
        if address in self._heard or len(self._heard) < MOST_LISTENERS:
            self._heard[address] = perf_counter()

    def follow(self, pilot: Address | None) -> None:
        """Take a program for the pilot, which is sent every message; None: nobody flies."""
        self.pilot = pilot
        if pilot is not None:
            self._heard[pilot] = perf_counter()

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


def address_of(host: str) -> str:
    """Return the address of a machine.

    Args:
        host: its name or its IPv4 address.

    Raises:
        SettingError: the machine has no address, or its address stands for several machines.
    """
    wanted = f"expected the name or the IPv4 address of a machine, got {host!r}"
    try:
        # UnicodeError: a part of the name is empty or too long
        found = socket.gethostbyname(host) if host else ""
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or "no name of a machine"
        raise SettingError("client", f"{wanted}: {reason}") from None
    if not found or ip_address(found).is_unspecified or ip_address(found).is_multicast:
        raise SettingError("client", wanted)
    return found
