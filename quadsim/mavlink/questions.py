"""Answer what ground stations and libraries ask at connection: version, parameters, missions."""

from __future__ import annotations

from collections.abc import Iterator

from quadsim.mavlink.clock import SimulatorClock
from quadsim.mavlink.messages import (
    AutopilotVersion,
    Message,
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionRequest,
    MissionRequestInt,
    MissionRequestList,
    ParamRequestList,
    ParamRequestRead,
    ParamSet,
    ParamValue,
    Statustext,
    Timesync,
)
from quadsim.mavlink.packets import SYSTEM

# MAV_PROTOCOL_CAPABILITY: attitude targets, local position targets, MAVLink 2
CAPABILITIES = 64 | 128 | 8192
VERSION = AutopilotVersion(CAPABILITIES)
# MAV_PARAM_TYPE_REAL32
REAL32 = 9
# The only parameter, PX4's for the number of the system: MAVSDK refuses an answer without one
PARAMETER = ParamValue(b"MAV_SYS_ID", float(SYSTEM), REAL32, param_count=1, param_index=0)
WARNING = 4  # MAV_SEVERITY_WARNING
NO_PARAMETER = Statustext(WARNING, b"no such parameter: there is MAV_SYS_ID alone")
# MAV_MISSION_RESULT
EMPTIED = 0
UNSUPPORTED = 3
NO_SUCH_WAYPOINT = 13


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
            yield PARAMETER
        case ParamRequestRead() | ParamSet():
            yield PARAMETER if _is_known(message) else NO_PARAMETER
        case MissionRequestList(mission_type=kind):
            yield MissionCount(0, 0, 0, mission_type=kind)
        case MissionRequest() | MissionRequestInt() | MissionClearAll() | MissionCount():
            yield MissionAck(0, 0, _mission_result(message), mission_type=message.mission_type)
        case _:
            pass


def _is_known(message: ParamRequestRead | ParamSet) -> bool:
    """Return whether a message is about the only parameter, which keeps its value if it is set."""
    if isinstance(message, ParamRequestRead) and message.param_index >= 0:
        return message.param_index == PARAMETER.param_index
    return message.param_id.rstrip(b"\0") == PARAMETER.param_id


def _mission_result(
    message: MissionRequest | MissionRequestInt | MissionClearAll | MissionCount,
) -> int:
    """Return the MAV_MISSION_RESULT of a message about waypoints, of which there are none."""
    match message:
        case MissionClearAll() | MissionCount(count=0):
            return EMPTIED
        case MissionCount():
            return UNSUPPORTED
        case _:
            return NO_SUCH_WAYPOINT
