"""North-east-down and forward-right-down against east-north-up and forward-left-up."""

from math import pi
from struct import unpack_from

import numpy as np
import pytest

from quadsim.course import load_course
from quadsim.mavlink.axes import frd, ned, ned_attitude
from quadsim.mavlink.messages import EncapsulatedData
from quadsim.mavlink.race_data import track_messages
from quadsim.mavlink.telemetry import Motion, global_position_message, home_message
from quadsim.rotation import from_euler, to_world


def test_an_attitude_turns_the_same_vector_in_both_worlds():
    rng = np.random.default_rng(0)
    for _ in range(10):
        q = from_euler(*rng.uniform(-3.0, 3.0, 3))
        forward = rng.normal(size=3)
        assert to_world(ned_attitude(q), frd(forward)) == pytest.approx(ned(to_world(q, forward)))


def test_each_change_of_axes_is_its_own_inverse():
    q = from_euler(0.3, -0.4, 0.5)
    assert ned_attitude(ned_attitude(q)) == pytest.approx(q)
    assert ned(ned((1.0, 2.0, 3.0))) == (1.0, 2.0, 3.0)
    assert frd(frd((1.0, 2.0, 3.0))) == (1.0, 2.0, 3.0)


def test_the_track_has_each_gate_north_east_down():
    """Gate 1 of the qualifier is flown through to the north, gate 3 to the east."""
    course = load_course("aigp_physical")
    begins, *packets = track_messages(course, transfer=7)
    assert begins.width == 7
    assert begins.packets == len(packets)
    assert all(isinstance(packet, EncapsulatedData) for packet in packets)
    data = b"".join(packet.data[3:] for packet in packets)
    (count,) = unpack_from("<H", data)
    assert count == len(course.gates)
    rows = [unpack_from("<Hfffffffff", data, 2 + 38 * k) for k in range(count)]
    number, *north = rows[0]
    assert number == 0
    assert north == pytest.approx([28.65, 3.66, -1.35, 1, 0, 0, 0, 1.5, 1.5], abs=1e-5)
    east = from_euler(pi / 2, 0.0, 0.0)
    assert rows[2][4:8] == pytest.approx(east, abs=1e-6)


def test_the_track_of_the_second_round_has_no_poses():
    course = load_course("aigp_physical")
    _, first, *_ = track_messages(course, transfer=1, has_poses=False)
    assert unpack_from("<fffffff", first.data, 3 + 2 + 2) == (0.0,) * 7


def test_positions_on_the_globe_are_metres_from_the_origin_and_headings_from_north():
    east = from_euler(0.0, 0.0, 0.0)
    found = global_position_message(
        Motion((75.4, 111.32, 3.0), (1.0, 2.0, -0.5), east, (0.0, 0.0, 0.0)), boot=1.5
    )
    # a thousandth of a degree of latitude, and one of longitude at 47.4 degrees
    assert found.lat == pytest.approx(473_977_420 + 10_000, abs=2)
    assert found.lon == pytest.approx(85_455_940 + 10_006, abs=5)
    assert (found.relative_alt, found.alt) == (3_000, 491_000)
    assert (found.vx, found.vy, found.vz) == (200, 100, 50)  # north, east, down [cm/s]
    assert (found.hdg, found.time_boot_ms) == (9_000, 1_500)
    home = home_message((0.0, 0.0, 0.0))
    assert (home.latitude, home.longitude, home.altitude) == (473_977_420, 85_455_940, 488_000)
