"""MAVLink 2 packets: the frame around a payload, with its checksum.

    0xFD length incompatible compatible sequence system component message(3) payload crc(2)

A signed packet has a signature of 13 bytes behind the checksum, which is not checked.
"""

from __future__ import annotations

from struct import Struct
from typing import NamedTuple

from quadsim.mavlink.messages import MESSAGES, Message, layout, pack, unpack, x25

MAGIC = 0xFD
HEADER = Struct("<BBBBBBBHB")
CRC = Struct("<H")
SIGNED = 1  # the only flag of `incompatible` that is known
SIGNATURE = 13  # length of a signature [bytes]
# Pieces of a datagram that are no packets, after which the rest of it is left out: each false
# beginning of a packet costs a checksum
MOST_BAD = 20
# The simulator as a member of a MAVLink network: an autopilot
SYSTEM = 1
COMPONENT = 1


class Member(NamedTuple):
    """A member of a MAVLink network."""

    system: int
    component: int


class Packet(NamedTuple):
    """A message, and the member of the network that sent it."""

    message: Message
    member: Member


class Parsed(NamedTuple):
    """The packets of a datagram, and the number of its other parts."""

    packets: list[Packet]
    # packets that are whole, of messages that the simulator does not know
    unknown: int
    # pieces that are no packets: damaged, cut off, another protocol
    bad: int

    @property
    def messages(self) -> list[Message]:
        """The messages of the packets."""
        return [packet.message for packet in self.packets]


class Packer:
    """Puts messages into packets, which it numbers."""

    def __init__(self, system: int = SYSTEM, component: int = COMPONENT):
        """Number packets of this member of the network."""
        self._system = system
        self._component = component
        self._sequence = 0

    def packet(self, message: Message) -> bytes:
        """Return the next packet."""
        payload = pack(message)
        low, high = message.ID & 0xFFFF, message.ID >> 16
        header = HEADER.pack(
            MAGIC, len(payload), 0, 0, self._sequence, self._system, self._component, low, high
        )
        self._sequence = (self._sequence + 1) % 256
        crc = x25(bytes([layout(type(message)).crc_extra]), x25(header[1:] + payload))
        return header + payload + CRC.pack(crc)


def parse(datagram: bytes) -> Parsed:
    """Return the packets of a datagram, and the numbers of its other parts; none is an error.

    After a piece that is no packet, the search goes on at the next byte that may begin one, up to
    MOST_BAD such pieces.
    """
    packets: list[Packet] = []
    unknown = 0
    bad = 0
    at = 0
    while at < len(datagram) and bad < MOST_BAD:
        end = _end_of_packet(datagram, at)
        if end is None:
            bad += 1
            at = datagram.find(MAGIC, at + 1)
            if at < 0:
                break
            continue
        packet = _packet(datagram[at:end])
        if packet is None:
            unknown += 1
        else:
            packets.append(packet)
        at = end
    return Parsed(packets, unknown, bad)


def _end_of_packet(data: bytes, at: int) -> int | None:
    """Return where the packet that begins at a byte ends, None if none begins there.

    The checksum of a message that is not known cannot be checked.
    """
    if data[at] != MAGIC or at + HEADER.size > len(data):
        return None
    _, length, flags, _, _, _, _, low, high = HEADER.unpack_from(data, at)
    end = at + HEADER.size + length
    if flags & ~SIGNED or end + CRC.size > len(data):
        return None
    kind = MESSAGES.get(low | high << 16)
    if kind is not None:
        crc = x25(bytes([layout(kind).crc_extra]), x25(data[at + 1 : end]))
        if CRC.unpack_from(data, end)[0] != crc:
            return None
    whole = end + CRC.size + (SIGNATURE if flags & SIGNED else 0)
    return whole if whole <= len(data) else None


def _packet(data: bytes) -> Packet | None:
    """Return the packet in its bytes, None if its message is not known."""
    _, length, _, _, _, system, component, low, high = HEADER.unpack_from(data)
    kind = MESSAGES.get(low | high << 16)
    if kind is None:
        return None
    message = unpack(kind, data[HEADER.size : HEADER.size + length])
    return Packet(message, Member(system, component))
