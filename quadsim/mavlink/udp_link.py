"""A UDP socket for messages to and from a client, and for the pictures of the camera."""

from __future__ import annotations

import socket
from collections import Counter
from collections.abc import Iterable
from ipaddress import ip_address
from select import select

from quadsim.files.values import SettingError
from quadsim.mavlink.messages import Message
from quadsim.mavlink.packets import Packer, parse

# [bytes] longest datagram
LONGEST = 65536
# Datagrams read at once, so that a flood does not hold up the flight
MOST = 200
ANY = "0.0.0.0"


class UdpLink:
    """Sends messages to one client, and receives its messages.

    The first messages go to the address and port that are given. Once the client has sent a
    message, all go to the port that it was sent from. Datagrams of other machines are counted
    and not read.

    Attributes:
        sent: messages sent, by name; datagrams of pictures count as "picture".
        received: messages received, by name; packets of other messages count as "unknown",
            pieces that are no packets as "bad", datagrams of other machines as "strange", setpoints
            whose numbers cannot be used as "unusable".

    Args:
        host: address of the client; if it is a loopback address, the socket receives from there
            alone.
        port: port of the client for messages.
        camera_port: port of the client for pictures.

    Raises:
        SettingError: the host has no address.
    """

    def __init__(self, host: str, port: int, camera_port: int):
        try:
            self._host = socket.gethostbyname(host)
        except OSError as error:
            problem = f"expected the address of a machine, got {host!r}: {error.strerror}"
            raise SettingError("client", problem) from None
        self._peer = (self._host, port)
        self._camera = (self._host, camera_port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        own = self._host if ip_address(self._host).is_loopback else ANY
        self._socket.bind((own, 0))
        self._packer = Packer()
        self.sent: Counter[str] = Counter()
        self.received: Counter[str] = Counter()

    @property
    def port(self) -> int:
        """The simulator's own port."""
        return self._socket.getsockname()[1]

    def send(self, message: Message) -> None:
        """Send a message; what the machine cannot send now is lost, as on any such link."""
        self._put(self._packer.packet(message), self._peer)
        self.sent[message.NAME] += 1

    def send_picture(self, datagrams: Iterable[bytes]) -> None:
        """Send the datagrams of a picture."""
        for datagram in datagrams:
            self._put(datagram, self._camera)
        self.sent["picture"] += 1

    def _put(self, datagram: bytes, address: tuple[str, int]) -> None:
        """Send a datagram; it is lost if the buffer is full or the address cannot be reached."""
        try:
            self._socket.sendto(datagram, address)
        except OSError:
            self.sent["lost"] += 1

    def receive(self, wait: float = 0.0) -> list[Message]:
        """Return the messages that have come.

        Args:
            wait: time to wait for the first one [s].
        """
        if not select([self._socket], [], [], max(wait, 0.0))[0]:
            return []
        found: list[Message] = []
        for _ in range(MOST):
            try:
                datagram, address = self._socket.recvfrom(LONGEST)
            except OSError:  # none is left
                break
            if address[0] != self._host:
                self.received["strange"] += 1
                continue
            parsed = parse(datagram)
            self.received["unknown"] += parsed.unknown
            self.received["bad"] += parsed.bad
            self.received.update(message.NAME for message in parsed.messages)
            if parsed.messages:
                self._peer = address
            found += parsed.messages
        return found

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
