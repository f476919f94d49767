"""Fly a lap of `race serve` over MAVLink: through each gate of the track at a constant speed.

    pip install pymavlink
    race serve --competition aigp_physical --sensing perfect --laps 1 --camera none &
    python examples/mavlink_client.py

It knows nothing of quadsim: it reads the track, the odometry and the state of the race, and answers
each odometry with a velocity towards the next gate.
"""

import os
import struct
import sys

os.environ["MAVLINK20"] = "1"  # before pymavlink is imported
import numpy as np
from pymavlink import mavutil

SPEED = 5.0  # [m/s]
BEFORE = 3.0  # [m] distance from the gate at which the vehicle is to be in line with it
ASIDE = 4.0  # [m] distance at which it flies round a gate that it comes to from behind


def track(chunks):
    """Return the positions of the gates and their passages, each (gates, 3)."""
    data = b"".join(chunks[k] for k in sorted(chunks))
    (count,) = struct.unpack_from("<H", data)
    rows = np.array([struct.unpack_from("<Hfffffffff", data, 2 + 38 * k) for k in range(count)])
    w, x, y, z = rows[:, 4:8].T
    ahead = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1)
    return rows[:, 1:4], ahead


def velocity_to(place, centre, ahead):
    """Return the velocity through a gate: round it, to a point before it, then along its axis."""
    away = place - centre
    along = away @ ahead
    aside = away - along * ahead
    if np.linalg.norm(aside) < max(0.5, -0.3 * along) and along < 2.0:
        return SPEED * ahead - 2.0 * aside
    way = centre - BEFORE * ahead - place
    if along > -1.0:
        way = way + ASIDE * aside / np.linalg.norm(aside)
    return SPEED * way / max(np.linalg.norm(way), 1.0)


link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{sys.argv[1] if sys.argv[1:] else 14550}")
link.wait_heartbeat()
chunks, gates, active, armed = {}, None, 0, False
while True:
    message = link.recv_match(blocking=True, timeout=30.0)
    if message is None:
        sys.exit("the simulator is silent")
    kind = message.get_type()
    if kind == "DATA_TRANSMISSION_HANDSHAKE":
        chunks, packets = {}, message.packets
    elif kind == "ENCAPSULATED_DATA" and message.data[0] == 2:
        chunks[message.seqnr] = bytes(message.data[3:])
        gates = track(chunks) if len(chunks) == packets else gates
    elif kind == "ENCAPSULATED_DATA" and message.data[0] == 1:
        _, _, started, finished, active, _ = struct.unpack_from("<BQqqIq", bytes(message.data))
        if finished >= 0:
            sys.exit(print(f"finished in {finished / 1e9:.2f} s"))
    elif kind == "STATUSTEXT" and message.text.startswith("race "):
        sys.exit(message.text)
    elif kind == "ODOMETRY" and gates is not None:
        if not armed:
            link.mav.command_long_send(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
            armed = True
        place = np.array([message.x, message.y, message.z])
        velocity = velocity_to(place, gates[0][active], gates[1][active])
        yaw = np.arctan2(velocity[1], velocity[0])
        # velocity and yaw; position, acceleration and yaw rate are ignored
        link.mav.set_position_target_local_ned_send(
            0, 1, 1, 1, 0b100111000111, 0, 0, 0, *velocity, 0, 0, 0, yaw, 0
        )
