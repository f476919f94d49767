"""MAVLink packets against pymavlink, and what a damaged one does."""

import os
from dataclasses import asdict
from math import inf, isfinite, nan

import numpy as np
import pytest

from quadsim.course import Start
from quadsim.dynamics.quadrotor import State
from quadsim.mavlink.messages import (
    MESSAGES,
    Heartbeat,
    SetAttitudeTarget,
    layout,
)
from quadsim.mavlink.packets import MOST_BAD, Packer, parse
from quadsim.mavlink.setpoints import (
    SetpointError,
    attitude_setpoint,
    control_of,
    path_setpoint,
)
from quadsim.physics.plant_state import start_state
from quadsim.vehicle import load_vehicle

os.environ["MAVLINK20"] = "1"  # before pymavlink is imported
common = pytest.importorskip("pymavlink.dialects.v20.common")

# pymavlink 2.4.50 has TIMESYNC without its two extensions, and so has quadsim.
KINDS = list(MESSAGES.values())


def drawn(kind, rng):
    """Return a message with random numbers that its fields can hold."""
    values = {}
    shape = layout(kind)
    for name, field in zip(shape.names, shape.types, strict=True):
        if field.name == "float":
            numbers = rng.normal(size=field.count).astype(np.float32).tolist()
        else:
            limit = min(2 ** (8 * field.size - 1), 2**40)
            numbers = rng.integers(0, limit, field.count).tolist()
        if field.length and field.name != "float":
            # texts end at a zero
            values[name] = bytes(1 + n % 126 for n in numbers)
        else:
            values[name] = tuple(numbers) if field.length else numbers[0]
    return kind(**values)


def as_bytes(value):
    """Return the value of a field, with pymavlink's texts and lists of bytes as bytes."""
    if isinstance(value, str):
        return value.encode()
    return bytes(value) if isinstance(value, list) and isinstance(value[0], int) else value


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.NAME)
def test_pymavlink_reads_what_is_sent_and_the_reverse(kind):
    """pymavlink refuses a packet whose checksum, with that of the definition, is wrong."""
    sent = drawn(kind, np.random.default_rng(0))
    reader = common.MAVLink(None, srcSystem=255)
    (read,) = reader.parse_buffer(Packer().packet(sent))
    assert read.get_type() == kind.NAME
    for name, value in asdict(sent).items():
        found = as_bytes(getattr(read, name))
        assert found == pytest.approx(value) if isinstance(value, tuple) else found == value

    parsed = parse(read.pack(reader))
    assert (parsed.messages, parsed.unknown, parsed.bad) == ([sent], 0, 0)


def test_zeros_at_the_end_are_cut_off_and_come_back():
    message = Heartbeat(2, 0, 0, custom_mode=0, system_status=0, mavlink_version=0)
    packet = Packer().packet(message)
    # custom_mode, type and what follows: the last byte that is not zero is the type
    assert len(packet) == 10 + 5 + 2
    assert parse(packet).messages == [message]


def test_a_damaged_packet_is_counted_and_the_next_one_is_read():
    packer = Packer()
    good = Heartbeat(2, 0, 128)
    damaged = bytearray(packer.packet(good))
    damaged[-1] ^= 1
    parsed = parse(bytes(damaged) + b"noise" + packer.packet(good))
    assert parsed.messages == [good]
    assert parsed.bad >= 1


def test_no_packet_raises_or_gives_a_control_that_is_none():
    """500 packets: whole, damaged, cut off, and with numbers that are no numbers."""
    rng = np.random.default_rng(1)
    vehicle = load_vehicle("archer")
    x: State = start_state(Start((0.0, 0.0, 1.0), 0.3), vehicle.radius)
    client = common.MAVLink(None, srcSystem=255)
    strange = (nan, inf, -inf, 1e38, -1e38, 0.0, 1.0, -1.0)
    used = 0
    bad = 0
    for k in range(500):
        a, b, c, d, *rest = rng.choice(strange, 14) if k % 3 else rng.normal(size=14)
        # half of the masks ignore only whole vectors
        mask = int(rng.choice([rng.integers(0, 2**12), 0b111000111, 0b111111000]))
        if k % 2:
            q = rng.choice(strange, 4) if k % 3 else rng.normal(size=4)
            target = (0, 1, 1, mask % 256, list(q), a, b, c, d)
            packet = client.set_attitude_target_encode(*target).pack(client)
        else:
            target = (0, 1, 1, 1, mask, a, b, c, d, *rest[:7])
            packet = client.set_position_target_local_ned_encode(*target).pack(client)
        data = bytearray(packet)
        if k % 5 == 0:
            data[rng.integers(0, len(data))] ^= 1 << rng.integers(0, 8)
        if k % 7 == 0:
            del data[rng.integers(0, len(data)) :]
        parsed = parse(bytes(data))
        bad += parsed.bad
        for message in parsed.messages:
            try:
                if isinstance(message, SetAttitudeTarget):
                    setpoint = attitude_setpoint(message, vehicle)
                else:
                    setpoint = path_setpoint(message)
            except SetpointError:
                continue
            control = control_of(setpoint, x, vehicle)
            assert all(map(isfinite, control))
            assert 0.0 <= control.thrust <= vehicle.thrust_max
            used += 1
    assert bad > 80
    assert used > 10


def test_a_flood_of_false_beginnings_is_left_out_after_a_few():
    """Each of 6500 headers asks for a checksum of 255 bytes."""
    assert parse(bytes([0xFD, 255, 0, 0, 0, 1, 1, 0, 0, 0]) * 6500).bad == MOST_BAD
