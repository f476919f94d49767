"""Answer what ground stations and libraries ask at connection: version, parameters, missions."""

from __future__ import annotations

from collections.abc import Iterator

from quadsim.mavlink.clock import SimulatorClock
from quadsim.mavlink.messages import (
    AutopilotVersion,
    Message,
    MissionCount,
    MissionRequestList,
    ParamRequestList,
    ParamValue,
    Timesync,
)
from quadsim.mavlink.packets import SYSTEM

# MAV_PROTOCOL_CAPABILITY: attitude targets, local position targets, MAVLink 2
CAPABILITIES = 64 | 128 | 8192
VERSION = AutopilotVersion(CAPABILITIES)
# MAV_PARAM_TYPE_REAL32
REAL32 = 9
# The only parameter, PX4's for the number of the system: MAVSDK refuses an answer without one
PARAMETERS = ParamValue(b"MAV_SYS_ID", float(SYSTEM), REAL32, param_count=1, param_index=0)


def answers(message: Message, clock: SimulatorClock) -> Iterator[Message]:
    """Yield the answers to a message that is neither a command nor a setpoint.

    Args:
        message: the message.
        clock: time since the simulator's start.
    """
    match message:
        case Timesync(tc1=theirs, ts1=ours):
            # A client that asks leaves one of the two at 0.
            now = round(1e9 * clock.boot)
            if not ours:
                yield Timesync(theirs, now)
            elif not theirs:
                yield Timesync(now, ours)
        case ParamRequestList():
            yield PARAMETERS
        case MissionRequestList(mission_type=kind):
            yield MissionCount(0, 0, 0, mission_type=kind)
        case _:
            pass
