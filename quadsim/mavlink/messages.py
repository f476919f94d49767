"""The MAVLink messages that the simulator sends and understands, with their layout on the wire.

A message is a dataclass whose fields stand in the order of MAVLink's common.xml, each annotated
with its type there. The layout follows from the fields (MAVLink, "Packet serialization"): on the
wire they are sorted by the size of their type, the largest first, and extensions follow unsorted.
So does CRC_EXTRA, the checksum of the definition, by which two programs with different definitions
refuse each other's messages.
"""

from __future__ import annotations

from binascii import crc_hqx
from dataclasses import dataclass, fields
from functools import cache
from struct import Struct
from typing import Annotated, Any, ClassVar, NamedTuple, get_type_hints

# MAVLink's name of a type -> its letter in `struct`
LETTERS = {
    "uint8_t": "B",
    "int8_t": "b",
    "uint16_t": "H",
    "int16_t": "h",
    "uint32_t": "I",
    "int32_t": "i",
    "uint64_t": "Q",
    "int64_t": "q",
    "float": "f",
    "char": "c",
}


class WireType(NamedTuple):
    """The type of a field on the wire."""

    name: str  # of LETTERS
    length: int = 0  # numbers of an array; 0: no array
    extension: bool = False  # whether MAVLink 2 has added the field

    @property
    def size(self) -> int:
        """The size of one number [bytes]."""
        return Struct("<" + LETTERS[self.name]).size

    @property
    def count(self) -> int:
        """How many numbers the field has, 1 if it is no array."""
        return self.length or 1


U8 = Annotated[int, WireType("uint8_t")]
U8X = Annotated[int, WireType("uint8_t", extension=True)]
I8X = Annotated[int, WireType("int8_t", extension=True)]
I32X = Annotated[int, WireType("int32_t", extension=True)]
I8 = Annotated[int, WireType("int8_t")]
U16 = Annotated[int, WireType("uint16_t")]
I16 = Annotated[int, WireType("int16_t")]
U32 = Annotated[int, WireType("uint32_t")]
I32 = Annotated[int, WireType("int32_t")]
U64 = Annotated[int, WireType("uint64_t")]
I64 = Annotated[int, WireType("int64_t")]
F32 = Annotated[float, WireType("float")]
Floats = tuple[float, ...]
F4 = Annotated[Floats, WireType("float", 4)]
F21 = Annotated[Floats, WireType("float", 21)]
F32S = Annotated[Floats, WireType("float", 32)]
Data8 = Annotated[bytes, WireType("uint8_t", 8)]
Data251 = Annotated[bytes, WireType("uint8_t", 251)]
Data253 = Annotated[bytes, WireType("uint8_t", 253)]
Text16 = Annotated[bytes, WireType("char", 16)]
Text50 = Annotated[bytes, WireType("char", 50)]

UNKNOWN_COVARIANCE = (float("nan"), *20 * (0.0,))


@dataclass(frozen=True)
class Message:
    """A message of MAVLink."""

    ID: ClassVar[int]
    NAME: ClassVar[str]


@dataclass(frozen=True)
class Heartbeat(Message):
    """The sender is there; `base_mode` says whether it is armed."""

    ID = 0
    NAME = "HEARTBEAT"
    type: U8
    autopilot: U8
    base_mode: U8
    custom_mode: U32 = 0
    system_status: U8 = 4  # MAV_STATE_ACTIVE
    mavlink_version: U8 = 3


@dataclass(frozen=True)
class SysStatus(Message):
    """The sensors that are present, enabled and healthy, as bits of MAV_SYS_STATUS_SENSOR."""

    ID = 1
    NAME = "SYS_STATUS"
    onboard_control_sensors_present: U32
    onboard_control_sensors_enabled: U32
    onboard_control_sensors_health: U32
    load: U16 = 0
    voltage_battery: U16 = 65535  # unknown
    current_battery: I16 = -1
    battery_remaining: I8 = -1
    drop_rate_comm: U16 = 0
    errors_comm: U16 = 0
    errors_count1: U16 = 0
    errors_count2: U16 = 0
    errors_count3: U16 = 0
    errors_count4: U16 = 0


@dataclass(frozen=True)
class SetMode(Message):
    """The mode that the vehicle is to have."""

    ID = 11
    NAME = "SET_MODE"
    target_system: U8
    base_mode: U8
    custom_mode: U32


@dataclass(frozen=True)
class ParamRequestRead(Message):
    """Asks for one parameter, by its index, or by its name if the index is -1."""

    ID = 20
    NAME = "PARAM_REQUEST_READ"
    target_system: U8
    target_component: U8
    param_id: Text16
    param_index: I16


@dataclass(frozen=True)
class ParamRequestList(Message):
    """Asks for all parameters."""

    ID = 21
    NAME = "PARAM_REQUEST_LIST"
    target_system: U8
    target_component: U8


@dataclass(frozen=True)
class ParamValue(Message):
    """A parameter, one of `param_count`."""

    ID = 22
    NAME = "PARAM_VALUE"
    param_id: Text16
    param_value: F32
    param_type: U8
    param_count: U16
    param_index: U16


@dataclass(frozen=True)
class ParamSet(Message):
    """The value that a parameter is to have."""

    ID = 23
    NAME = "PARAM_SET"
    target_system: U8
    target_component: U8
    param_id: Text16
    param_value: F32
    param_type: U8


@dataclass(frozen=True)
class Attitude(Message):
    """Euler angles [rad] and body rates [rad/s], forward right down."""

    ID = 30
    NAME = "ATTITUDE"
    time_boot_ms: U32
    roll: F32
    pitch: F32
    yaw: F32
    rollspeed: F32
    pitchspeed: F32
    yawspeed: F32


@dataclass(frozen=True)
class LocalPositionNed(Message):
    """Position [m] and velocity [m/s], north east down."""

    ID = 32
    NAME = "LOCAL_POSITION_NED"
    time_boot_ms: U32
    x: F32
    y: F32
    z: F32
    vx: F32
    vy: F32
    vz: F32


@dataclass(frozen=True)
class GlobalPositionInt(Message):
    """Latitude and longitude [1e-7 deg], heights [mm], velocity [cm/s] and heading [0.01 deg]."""

    ID = 33
    NAME = "GLOBAL_POSITION_INT"
    time_boot_ms: U32
    lat: I32
    lon: I32
    alt: I32
    relative_alt: I32
    vx: I16
    vy: I16
    vz: I16
    hdg: U16


@dataclass(frozen=True)
class MissionRequest(Message):
    """Asks for a waypoint; clients ask by MISSION_REQUEST_INT first."""

    ID = 40
    NAME = "MISSION_REQUEST"
    target_system: U8
    target_component: U8
    seq: U16
    mission_type: U8X = 0


@dataclass(frozen=True)
class MissionRequestList(Message):
    """Asks for the count of waypoints."""

    ID = 43
    NAME = "MISSION_REQUEST_LIST"
    target_system: U8
    target_component: U8
    mission_type: U8X = 0


@dataclass(frozen=True)
class MissionCount(Message):
    """The count of waypoints."""

    ID = 44
    NAME = "MISSION_COUNT"
    target_system: U8
    target_component: U8
    count: U16
    mission_type: U8X = 0


@dataclass(frozen=True)
class MissionClearAll(Message):
    """Asks the vehicle to forget its waypoints."""

    ID = 45
    NAME = "MISSION_CLEAR_ALL"
    target_system: U8
    target_component: U8
    mission_type: U8X = 0


@dataclass(frozen=True)
class MissionAck(Message):
    """The answer to a message about waypoints, a MAV_MISSION_RESULT."""

    ID = 47
    NAME = "MISSION_ACK"
    target_system: U8
    target_component: U8
    type: U8
    mission_type: U8X = 0


@dataclass(frozen=True)
class MissionRequestInt(Message):
    """Asks for a waypoint."""

    ID = 51
    NAME = "MISSION_REQUEST_INT"
    target_system: U8
    target_component: U8
    seq: U16
    mission_type: U8X = 0


@dataclass(frozen=True)
class CommandInt(Message):
    """A command with a place: latitude and longitude [1e-7 deg], or x and y [0.1 mm]."""

    ID = 75
    NAME = "COMMAND_INT"
    target_system: U8
    target_component: U8
    frame: U8
    command: U16
    current: U8
    autocontinue: U8
    param1: F32
    param2: F32
    param3: F32
    param4: F32
    x: I32
    y: I32
    z: F32


@dataclass(frozen=True)
class CommandLong(Message):
    """A command with up to seven numbers."""

    ID = 76
    NAME = "COMMAND_LONG"
    target_system: U8
    target_component: U8
    command: U16
    confirmation: U8
    param1: F32
    param2: F32
    param3: F32
    param4: F32
    param5: F32
    param6: F32
    param7: F32


@dataclass(frozen=True)
class CommandAck(Message):
    """The answer to a command."""

    ID = 77
    NAME = "COMMAND_ACK"
    command: U16
    result: U8
    progress: U8X = 0
    result_param2: I32X = 0
    target_system: U8X = 0
    target_component: U8X = 0


@dataclass(frozen=True)
class SetAttitudeTarget(Message):
    """Body rates [rad/s] or an attitude (wxyz), and the thrust from 0 to 1."""

    ID = 82
    NAME = "SET_ATTITUDE_TARGET"
    time_boot_ms: U32
    target_system: U8
    target_component: U8
    type_mask: U8
    q: F4
    body_roll_rate: F32
    body_pitch_rate: F32
    body_yaw_rate: F32
    thrust: F32


@dataclass(frozen=True)
class SetPositionTargetLocalNed(Message):
    """Position [m], velocity [m/s] and yaw [rad] that the vehicle is to have."""

    ID = 84
    NAME = "SET_POSITION_TARGET_LOCAL_NED"
    time_boot_ms: U32
    target_system: U8
    target_component: U8
    coordinate_frame: U8
    type_mask: U16
    x: F32
    y: F32
    z: F32
    vx: F32
    vy: F32
    vz: F32
    afx: F32
    afy: F32
    afz: F32
    yaw: F32
    yaw_rate: F32


@dataclass(frozen=True)
class HighresImu(Message):
    """Specific force [m/s^2] and body rates [rad/s], forward right down; height by pressure [m]."""

    ID = 105
    NAME = "HIGHRES_IMU"
    time_usec: U64
    xacc: F32
    yacc: F32
    zacc: F32
    xgyro: F32
    ygyro: F32
    zgyro: F32
    xmag: F32 = 0.0
    ymag: F32 = 0.0
    zmag: F32 = 0.0
    abs_pressure: F32 = 0.0
    diff_pressure: F32 = 0.0
    pressure_alt: F32 = 0.0
    temperature: F32 = 0.0
    fields_updated: U16 = 0
    id: U8X = 0


@dataclass(frozen=True)
class FileTransferProtocol(Message):
    """Asks for a file or a folder, or answers; see quadsim.mavlink.file_transfer."""

    ID = 110
    NAME = "FILE_TRANSFER_PROTOCOL"
    target_network: U8
    target_system: U8
    target_component: U8
    payload: Data251


@dataclass(frozen=True)
class Timesync(Message):
    """Times of two clocks [ns]."""

    ID = 111
    NAME = "TIMESYNC"
    tc1: I64
    ts1: I64


@dataclass(frozen=True)
class DataTransmissionHandshake(Message):
    """Announces a transfer in several packets of ENCAPSULATED_DATA."""

    ID = 130
    NAME = "DATA_TRANSMISSION_HANDSHAKE"
    type: U8
    size: U32
    width: U16
    height: U16
    packets: U16
    payload: U8
    jpg_quality: U8


@dataclass(frozen=True)
class EncapsulatedData(Message):
    """A packet of a transfer, or the state of the race."""

    ID = 131
    NAME = "ENCAPSULATED_DATA"
    seqnr: U16
    data: Data253


@dataclass(frozen=True)
class AutopilotVersion(Message):
    """The capabilities and versions of the autopilot; 0 stands for an unknown version."""

    ID = 148
    NAME = "AUTOPILOT_VERSION"
    capabilities: U64
    flight_sw_version: U32 = 0
    middleware_sw_version: U32 = 0
    os_sw_version: U32 = 0
    board_version: U32 = 0
    flight_custom_version: Data8 = bytes(8)
    middleware_custom_version: Data8 = bytes(8)
    os_custom_version: Data8 = bytes(8)
    vendor_id: U16 = 0
    product_id: U16 = 0
    uid: U64 = 0


@dataclass(frozen=True)
class HomePosition(Message):
    """The vehicle's start: latitude and longitude [1e-7 deg], height [mm], local position [m]."""

    ID = 242
    NAME = "HOME_POSITION"
    latitude: I32
    longitude: I32
    altitude: I32
    x: F32
    y: F32
    z: F32
    q: F4
    approach_x: F32 = 0.0
    approach_y: F32 = 0.0
    approach_z: F32 = 0.0


@dataclass(frozen=True)
class Collision(Message):
    """The vehicle has touched something."""

    ID = 247
    NAME = "COLLISION"
    src: U8
    id: U32
    action: U8
    threat_level: U8
    time_to_minimum_delta: F32
    altitude_minimum_delta: F32
    horizontal_minimum_delta: F32


@dataclass(frozen=True)
class Statustext(Message):
    """A line of text for people."""

    ID = 253
    NAME = "STATUSTEXT"
    severity: U8
    text: Text50
    id: Annotated[int, WireType("uint16_t", extension=True)] = 0
    chunk_seq: U8X = 0


@dataclass(frozen=True)
class Odometry(Message):
    """Pose, velocity and body rates, see quadsim.mavlink.telemetry for the frames."""

    ID = 331
    NAME = "ODOMETRY"
    time_usec: U64
    frame_id: U8
    child_frame_id: U8
    x: F32
    y: F32
    z: F32
    q: F4
    vx: F32
    vy: F32
    vz: F32
    rollspeed: F32
    pitchspeed: F32
    yawspeed: F32
    pose_covariance: F21 = UNKNOWN_COVARIANCE
    velocity_covariance: F21 = UNKNOWN_COVARIANCE
    reset_counter: U8X = 0
    estimator_type: U8X = 0
    quality: I8X = 0


@dataclass(frozen=True)
class ActuatorOutputStatus(Message):
    """The outputs to the motors, from 0 to 1."""

    ID = 375
    NAME = "ACTUATOR_OUTPUT_STATUS"
    time_usec: U64
    active: U32
    actuator: F32S


MESSAGES: dict[int, type[Message]] = {
    kind.ID: kind
    for kind in (
        Heartbeat,
        SysStatus,
        SetMode,
        ParamRequestRead,
        ParamRequestList,
        ParamValue,
        ParamSet,
        Attitude,
        LocalPositionNed,
        GlobalPositionInt,
        MissionRequest,
        MissionRequestList,
        MissionCount,
        MissionClearAll,
        MissionAck,
        MissionRequestInt,
        CommandInt,
        CommandLong,
        CommandAck,
        SetAttitudeTarget,
        SetPositionTargetLocalNed,
        HighresImu,
        FileTransferProtocol,
        Timesync,
        DataTransmissionHandshake,
        EncapsulatedData,
        AutopilotVersion,
        HomePosition,
        Collision,
        Statustext,
        Odometry,
        ActuatorOutputStatus,
    )
}


class Layout(NamedTuple):
    """The layout of a message on the wire."""

    names: tuple[str, ...]  # fields in the order of the wire
    types: tuple[WireType, ...]  # their types
    struct: Struct
    crc_extra: int


@cache
def layout(kind: type[Message]) -> Layout:
    """Return the layout of a message."""
    hints = get_type_hints(kind, include_extras=True)
    found: list[tuple[str, WireType]] = [
        (field.name, hints[field.name].__metadata__[0]) for field in fields(kind)
    ]
    # Sorting is stable: fields of one size keep their order.
    base = sorted((f for f in found if not f[1].extension), key=lambda f: -f[1].size)
    ordered = base + [f for f in found if f[1].extension]
    names, types = zip(*ordered, strict=True)
    return Layout(names, types, Struct("<" + "".join(map(_letters, types))), _crc_extra(kind, base))


def _letters(field: WireType) -> str:
    """Return a field in the language of `struct`; texts and data are bytes."""
    if field.length and field.name in ("char", "uint8_t"):
        return f"{field.length}s"
    return f"{field.count}{LETTERS[field.name]}"


def _crc_extra(kind: type[Message], base: list[tuple[str, WireType]]) -> int:
    """Return CRC_EXTRA of a message.

    Args:
        kind: the message.
        base: its fields that are no extensions, in the order of the wire.
    """
    crc = x25(kind.NAME.encode() + b" ")
    for name, field in base:
        crc = x25(f"{field.name} {name} ".encode(), crc)
        if field.length:
            crc = x25(bytes([field.length]), crc)
    return (crc & 0xFF) ^ (crc >> 8)


def _reversed(byte: int) -> int:
    """Return a byte with its bits in reverse order."""
    return int(f"{byte:08b}"[::-1], 2)


REVERSED = bytes(map(_reversed, range(256)))


def x25(data: bytes, crc: int = 0xFFFF) -> int:
    """Return MAVLink's checksum of bytes, CRC-16/MCRF4XX: X.25 without the final inversion.

    It is the checksum of `crc_hqx` with all bits in reverse order.

    Args:
        data: the bytes.
        crc: checksum of the bytes before them.

    Examples:
        >>> from quadsim.mavlink.messages import x25
        >>> hex(x25(b"123456789"))
        '0x6f91'
    """
    found = crc_hqx(data.translate(REVERSED), _reversed_word(crc))
    return _reversed_word(found)


def _reversed_word(word: int) -> int:
    """Return 16 bits in reverse order."""
    return REVERSED[word & 0xFF] << 8 | REVERSED[word >> 8]


def pack(message: Message) -> bytes:
    """Return the payload of a message, without the zeros at its end but one byte or more."""
    numbers: list[Any] = []
    shape = layout(type(message))
    for name, field in zip(shape.names, shape.types, strict=True):
        value = getattr(message, name)
        if field.length and not isinstance(value, bytes):
            numbers += value
        else:
            numbers.append(value)
    return shape.struct.pack(*numbers).rstrip(b"\0") or b"\0"


def unpack(kind: type[Message], payload: bytes) -> Message:
    """Return the message in a payload, whose missing end is zeros and whose excess is ignored."""
    shape = layout(kind)
    size = shape.struct.size
    numbers = iter(shape.struct.unpack(payload[:size].ljust(size, b"\0")))
    values: dict[str, Any] = {}
    for name, field in zip(shape.names, shape.types, strict=True):
        if field.length and not _letters(field).endswith("s"):
            values[name] = tuple(next(numbers) for _ in range(field.length))
        else:
            values[name] = next(numbers)
    return kind(**values)
