"""Clients that know nothing of quadsim: MAVSDK-Python and a monitor by pymavlink."""

import os
import subprocess
import sys
from contextlib import suppress
from importlib.util import find_spec

import pytest

from quadsim.record.archive import list_runs, read_run
from tests.docs.pages import ROOT

EXAMPLE = ROOT / "examples" / "mavsdk_client.py"
# Gate 1 is to the north of the start, as the client flies.
NORTH = """
loop: false
opening: [1.5, 1.5]
frame_width: 0.6
bounds: [[-5, 5], [-5, 15], [0, 6]]
start: {position: [1, 2, 0], yaw_deg: 90}
gates:
  - {position: [1, 6, 1.35], yaw_deg: 90}
"""
# What pymavlink's users write, without an environment variable for the version of MAVLink
MONITOR = """
import sys
from pymavlink import mavutil
link = mavutil.mavlink_connection("udpin:127.0.0.1:" + sys.argv[1])
link.wait_heartbeat(timeout=60)
print(link.target_system, link.target_component, link.flightmode)
link.param_fetch_all()
print(link.recv_match(type="PARAM_VALUE", blocking=True, timeout=10).param_id)
link.set_mode("GUIDED")
link.arducopter_arm()
link.motors_armed_wait()
link.wait_heartbeat()
print(link.flightmode)
for _ in range(200):
    link.recv_match(type="LOCAL_POSITION_NED", blocking=True, timeout=10)
    link.mav.set_position_target_local_ned_send(
        0, link.target_system, link.target_component, 1, 0b110111000111,
        0, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0)
"""


@pytest.mark.socket
@pytest.mark.process
@pytest.mark.slow
@pytest.mark.skipif(
    find_spec("mavsdk_grpc") is None, reason="needs MAVSDK: pip install mavsdk-grpc"
)
def test_mavsdk_connects_is_healthy_arms_and_flies_offboard(serve, port, tmp_path):
    client = subprocess.Popen(
        [sys.executable, "-u", EXAMPLE, str(port)], stdout=subprocess.PIPE, text=True
    )
    code = serve(course=NORTH, timeout="90")
    # The race has ended in the gate; the rest of the client's flight goes to nobody.
    with suppress(subprocess.TimeoutExpired):
        client.wait(timeout=0.1)
    client.terminate()
    said, _ = client.communicate()
    assert code == 0
    assert said.splitlines()[:3] == ["armed", "offboard OFFBOARD", "at a height of 1.35 m"]
    (folder,) = list_runs(tmp_path / "runs")
    assert [event.kind for event in read_run(folder).events] == ["pass"]


@pytest.mark.socket
@pytest.mark.process
@pytest.mark.slow
def test_pymavlink_as_it_comes_fetches_sets_a_mode_arms_and_flies(serve, port):
    pytest.importorskip("pymavlink")
    environment = {key: value for key, value in os.environ.items() if key != "MAVLINK20"}
    client = subprocess.Popen(
        [sys.executable, "-u", "-c", MONITOR, str(port)],
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    )
    code = serve(timeout="90")
    client.terminate()
    said, _ = client.communicate()
    assert code == 0
    assert said.split() == ["1", "0", "STABILIZE", "MAV_SYS_ID", "GUIDED"]
