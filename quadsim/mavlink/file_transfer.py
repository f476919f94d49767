"""Answers to requests for files by MAVLink's file transfer: the simulator has no files.

Ground stations ask an autopilot for a file of its parameters, and wait for seconds if nobody
answers. The fields of a payload, little endian: number of the message, session, opcode, length of
the data, opcode that is answered, end of a burst, padding, offset in the file, data.
"""

from __future__ import annotations

from struct import Struct

from quadsim.mavlink.messages import FileTransferProtocol
from quadsim.mavlink.packets import Member

HEADER = Struct("<HBBBBBBI")
PAYLOAD = 251  # length of a payload [bytes]
# Opcodes
TERMINATE_SESSION = 1
RESET_SESSIONS = 2
ACKNOWLEDGED = 128
REFUSED = 129
# Reason of a refusal
FILE_NOT_FOUND = bytes([10])


def answer_of_no_files(asked: FileTransferProtocol, asker: Member) -> FileTransferProtocol | None:
    """Return the answer of an autopilot without files; None if the message is an answer itself.

    Args:
        asked: the request.
        asker: the member of the network that sent it. It reads only answers to itself.
    """
    number, session, opcode, *_ = HEADER.unpack_from(asked.payload)
    if opcode >= ACKNOWLEDGED:
        return None
    # The end of a session is always granted; everything else needs a file.
    is_end = opcode in (TERMINATE_SESSION, RESET_SESSIONS)
    result = ACKNOWLEDGED if is_end else REFUSED
    data = b"" if is_end else FILE_NOT_FOUND
    next_number = (number + 1) % 2**16
    header = HEADER.pack(next_number, session, result, len(data), opcode, 0, 0, 0)
    payload = (header + data).ljust(PAYLOAD, b"\0")
    return FileTransferProtocol(0, asker.system, asker.component, payload)
