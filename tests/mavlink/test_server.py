"""`race serve` over loopback: the example's lap, questions of a client, resets, bad packets."""

import json
import os
import struct
import subprocess
import sys
import threading

import pytest

from quadsim.cli.cli import race
from quadsim.record.archive import list_runs, read_run
from tests.docs.pages import ROOT

os.environ["MAVLINK20"] = "1"  # before pymavlink is imported
mavutil = pytest.importorskip("pymavlink.mavutil")

EXAMPLE = ROOT / "examples" / "mavlink_client.py"


class Client(threading.Thread):
    """A client that does as its function says, in a thread; `link` is pymavlink's."""

    def __init__(self, port, does):
        super().__init__(daemon=True)
        self._port = port
        self._does = does
        self.found = None

    def run(self):
        link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{self._port}")
        link.wait_heartbeat(timeout=60)
        self.found = self._does(link)
        link.close()


@pytest.mark.socket
@pytest.mark.process
@pytest.mark.slow
def test_the_example_flies_a_race_which_is_recorded(serve, port, tmp_path, capsys):
    client = subprocess.Popen(
        [sys.executable, EXAMPLE, str(port)], stdout=subprocess.PIPE, text=True
    )
    assert serve("--lock-step", "--json") == 0
    said, _ = client.communicate()
    assert said.startswith("finished in ")
    result = json.loads(capsys.readouterr().out)
    assert result["received"].get("bad", 0) == 0
    assert result["unanswered"] == 0

    (folder,) = list_runs(tmp_path / "runs")
    run = read_run(folder)
    assert run.outcome == "finished"
    assert [event.kind for event in run.events] == ["pass"]
    assert run.spec["own"]["controller"]["class"].endswith("MavlinkClient")
    # each odometry of the race was answered by a command
    assert result["received"]["SET_POSITION_TARGET_LOCAL_NED"] >= int(73.0 * run.duration)
    # a message of a finished race has the time of the run
    assert float(said.split()[2]) == pytest.approx(run.duration, abs=0.01)


def questions(link):
    """Ask for the track, a time and an unknown command; return the answers; reset, then end."""
    found = {}
    link.mav.command_long_send(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
    link.mav.timesync_send(12345, 0)
    link.mav.command_long_send(1, 1, 512, 0, 130, 0, 0, 0, 0, 0, 0)
    link.mav.command_long_send(1, 1, 999, 0, 0, 0, 0, 0, 0, 0, 0)
    link.write(b"\xfd\x05no packet")
    transfers = set()
    resets = 0
    while True:
        message = link.recv_match(blocking=True, timeout=10.0)
        if message is None:
            return found
        kind = message.get_type()
        found[kind] = found.get(kind, 0) + 1
        if kind == "COMMAND_ACK":
            found[f"command {message.command}"] = message.result
        elif kind == "TIMESYNC":
            found["time"] = (message.tc1, message.ts1 > 0)
        elif kind == "DATA_TRANSMISSION_HANDSHAKE":
            transfers.add(message.width)
            found["transfers"] = len(transfers)
        elif kind == "HEARTBEAT" and resets and not message.base_mode & 128:
            # back at the start: arm again
            link.mav.command_long_send(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
        elif kind == "STATUSTEXT":
            found["said"] = message.text
            return found
        elif kind == "HIGHRES_IMU":
            found["force"] = found.get("force", message.zacc)
            # no thrust: it falls to the ground, after a reset at the first try
            link.mav.set_attitude_target_send(0, 1, 1, 128, [1, 0, 0, 0], 0, 0, 0, 0)
            if message.time_usec and found[kind] == 40 and not resets:
                resets = 1
                link.mav.command_long_send(1, 1, 31000, 0, 0, 0, 0, 0, 0, 0, 0)


@pytest.mark.socket
@pytest.mark.slow
def test_questions_are_answered_a_reset_starts_anew_and_bad_packets_are_counted(
    serve, port, tmp_path, capsys
):
    """In the second round, so that neither pose nor track is told."""
    client = Client(port, questions)
    client.start()
    assert serve("--lock-step", "--round", "second", "--json") == 1
    client.join()
    found = client.found
    assert found["command 400"] == 0
    assert found["command 512"] == 0
    assert found["command 31000"] == 0
    assert found["command 999"] == 3  # MAV_RESULT_UNSUPPORTED
    assert found["time"] == (12345, True)
    assert found["transfers"] >= 2
    assert found["force"] == pytest.approx(-9.81, abs=1e-3)
    assert found["COLLISION"] == 1
    assert found["said"].startswith("race crashed after ")
    assert not {"ATTITUDE", "LOCAL_POSITION_NED", "ODOMETRY"} & set(found)
    result = json.loads(capsys.readouterr().out)
    assert result["received"]["bad"] >= 1
    assert len(result["races"]) == 1
    # the race that was reset is kept, too
    outcomes = sorted(read_run(folder).outcome for folder in list_runs(tmp_path / "runs"))
    assert outcomes == ["crashed", "interrupted"]


def flies_beside_another(link):
    """Fly through the gate, answering each ODOMETRY, while another program tries to disarm."""
    other = mavutil.mavlink_connection("udpout:{}:{}".format(*next(iter(link.clients))))
    link.mav.command_long_send(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
    heard = 0
    while True:
        message = link.recv_match(type=["ODOMETRY", "STATUSTEXT"], blocking=True, timeout=10.0)
        if message is None or message.get_type() == "STATUSTEXT":
            other.close()
            return message and message.text, heard
        other.mav.heartbeat_send(6, 8, 0, 0, 0)
        other.mav.command_long_send(1, 1, 400, 0, 0, 0, 0, 0, 0, 0, 0)
        while other.recv_match(type="ODOMETRY") is not None:
            heard += 1
        link.mav.set_position_target_local_ned_send(
            0, 1, 1, 1, 0b110111000111, 0, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0
        )


@pytest.mark.socket
def test_another_program_hears_the_race_in_lock_step_and_changes_nothing(serve, port, capsys):
    client = Client(port, flies_beside_another)
    client.start()
    assert serve("--lock-step", "--json") == 0
    client.join()
    said, heard = client.found
    assert said.startswith("race finished after 1.8")
    assert heard > 100
    result = json.loads(capsys.readouterr().out)
    assert result["unanswered"] == 0


def resets_and_waits(link):
    """Reset, wait for a start in the future, arm before it, and let the vehicle fall."""
    link.mav.command_long_send(1, 1, 31000, 0, 0, 0, 0, 0, 0, 0, 0)
    told = []
    while True:
        message = link.recv_match(
            type=["ENCAPSULATED_DATA", "STATUSTEXT", "ODOMETRY"], blocking=True, timeout=10.0
        )
        if message is None or message.get_type() == "STATUSTEXT":
            return told, message and message.text
        if message.get_type() == "ODOMETRY" and told:
            link.mav.set_attitude_target_send(0, 1, 1, 128, [1, 0, 0, 0], 0, 0, 0, 0)
        elif message.get_type() == "ENCAPSULATED_DATA" and message.data[0] == 1:
            _, boot, start = struct.unpack_from("<BQq", bytes(message.data))
            if start >= 0 and not told:
                link.mav.command_long_send(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
            if start >= 0:
                told.append((start - boot, start))


@pytest.mark.socket
@pytest.mark.slow
def test_a_start_in_the_future_is_told_to_a_client_that_resets_first(serve, port):
    client = Client(port, resets_and_waits)
    client.start()
    assert serve("--countdown", "0.6") == 1
    client.join()
    told, said = client.found
    ahead = [wait for wait, _ in told]
    assert 0 < ahead[0] <= 600
    assert min(ahead) <= 0
    # The race begins when it was told.
    starts = {start for _, start in told}
    assert max(starts) - min(starts) <= 30
    assert said.startswith("race crashed after ")


@pytest.mark.socket
def test_nobody_comes_and_the_wait_ends(serve, capsys):
    assert serve(timeout="0.05") == 1
    assert "no client has armed the vehicle within 0.05 s" in capsys.readouterr().err


def test_settings_of_a_planner_are_refused(capsys):
    assert race(["serve", "--samples", "100"]) == 2
    assert capsys.readouterr().err.startswith("race serve: --samples: expected none")
