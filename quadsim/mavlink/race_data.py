"""The state of the race and the track, as ENCAPSULATED_DATA carries them.

The formats are those of the AI Grand Prix's sample client, as teams' public code has them
(BStandage/AI-GrandPrix). What it does not say is ours: `width` and `height` of a gate are those of
its opening, and a gate's axes are forward along the passage, right and down.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from struct import Struct
from typing import NamedTuple

from quadsim.course import Course
from quadsim.mavlink.axes import ned, ned_attitude
from quadsim.mavlink.messages import DataTransmissionHandshake, EncapsulatedData, Message
from quadsim.rotation import from_euler

RACE_STATUS = 1  # the first byte of ENCAPSULATED_DATA
TRACK = 2
STATUS = Struct("<BQqqIq")
SLICE = Struct("<BH")
COUNT = Struct("<H")
GATE = Struct("<Hfffffffff")
# Bytes of the track in one packet
LONGEST = 253 - SLICE.size


class RaceStatus(NamedTuple):
    """The state of the race."""

    boot_ms: int  # time since the simulator's start
    start_boot_ms: int  # when the race began; -1: it has not
    finish_ns: int  # race time at the last gate; -1: the race is on
    active_gate: int  # index of the next gate, from 0
    last_gate_ns: int  # race time at the last gate passed; -1: none yet


NO_RACE = RaceStatus(boot_ms=0, start_boot_ms=-1, finish_ns=-1, active_gate=0, last_gate_ns=-1)


def status_message(status: RaceStatus) -> EncapsulatedData:
    """Return the message of a state of the race."""
    return EncapsulatedData(0, STATUS.pack(RACE_STATUS, *status))


def track_messages(course: Course, transfer: int, has_poses: bool = True) -> Sequence[Message]:
    """Return the messages of a track: its announcement, then its packets.

    Args:
        course: the course, whose gates are numbered from 0.
        transfer: number of the transfer.
        has_poses: whether the gates' poses are sent; otherwise they are zeros.
    """
    data = COUNT.pack(len(course.gates))
    for k, gate in enumerate(course.gates):
        pose = 7 * (0.0,)
        if has_poses:
            attitude = ned_attitude(from_euler(gate.yaw, gate.pitch, gate.roll))
            pose = (*ned(gate.position), *attitude)
        data += GATE.pack(k, *pose, *gate.opening)
    packets = ceil(len(data) / LONGEST)
    begins = DataTransmissionHandshake(
        type=TRACK,
        size=len(data),
        width=transfer,
        height=0,
        packets=packets,
        payload=LONGEST,
        jpg_quality=0,
    )
    slices = [data[k * LONGEST : (k + 1) * LONGEST] for k in range(packets)]
    return [
        begins,
        *(EncapsulatedData(k, SLICE.pack(TRACK, transfer) + s) for k, s in enumerate(slices)),
    ]
