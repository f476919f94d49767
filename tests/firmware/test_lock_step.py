"""The firmware in lock step: equal requests give equal replies, and its end is one line."""

import os
import signal
import subprocess
import sys
import time
from itertools import pairwise
from math import sin

import pytest

from quadsim.files.locks import lock_folder
from quadsim.firmware import process
from quadsim.firmware.configuration import BOOT, expect_armed
from quadsim.firmware.process import MAIN_LOOP, Firmware, FirmwareError

PERIOD = 1e-3
STANDING = ((0.0, 0.0, 0.0), (0.0, 0.0, 9.81), (1.0, 0.0, 0.0, 0.0))


def idle_channels():
    """Return the pulses of sticks in the middle, throttle down and switches off [us]."""
    return [1500.0, 1500.0, 1000.0, 1500.0] + [1000.0] * 12


@pytest.fixture
def firmware(built):
    """A firmware with its default configuration."""
    process = Firmware(built.program, PERIOD)
    yield process
    process.close()


@pytest.fixture
def eeprom(built):
    """The firmware's configuration with a switch that arms."""
    process = Firmware(built.program, PERIOD)
    process.command("aux 0 0 0 1700 2100 0 0")
    yield process.save()
    process.close()


def replies(built, eeprom, gyro):
    """Return the replies of a second with a stick to the side, after arming."""
    process = Firmware(built.program, PERIOD, eeprom)
    channels = idle_channels()
    process.step(*STANDING, channels, round(BOOT / PERIOD))
    channels[4] = 1900.0
    process.step(*STANDING, channels, 500)
    channels[2] = 1400.0
    channels[0] = 1700.0
    found = [
        process.step((gyro, 0.0, 0.0), *STANDING[1:], channels, frame_every=k % 10 == 0)
        for k in range(1000)
    ]
    process.close()
    return found


def test_equal_requests_give_equal_replies_to_the_last_bit(built, eeprom):
    first = replies(built, eeprom, 0.1)
    assert replies(built, eeprom, 0.1) == first
    assert replies(built, eeprom, 0.2) != first
    assert first[-1].armed


def test_several_periods_in_one_request_are_the_same_as_one_by_one(built):
    ends = []
    for periods in (1, 50):
        process = Firmware(built.program, PERIOD)
        channels = idle_channels()
        channels[0] = 1700.0
        for _ in range(200 // periods):
            reply = process.step(*STANDING, channels, periods, frame_every=1)
        ends.append(reply)
        assert process.time == pytest.approx(0.2)
        process.close()
    assert ends[0] == ends[1]


@pytest.mark.parametrize(("denominator", "rate"), [(1, 8000), (4, 2000)])
def test_gyro_and_rate_loop_run_at_the_rates_of_the_configuration(built, denominator, rate):
    """With a body rate that is another one in each pass, the motors change as often as they run."""
    process = Firmware(built.program, PERIOD)
    process.command("aux 0 0 0 1700 2100 0 0")
    process.command(f"set pid_process_denom = {denominator}")
    stored = process.save()
    process.close()

    process = Firmware(built.program, MAIN_LOOP, stored)
    channels = idle_channels()
    process.step(*STANDING, channels, round(BOOT / MAIN_LOOP), 200)
    channels[4] = 1900.0
    process.step(*STANDING, channels, round(0.5 / MAIN_LOOP), 200)
    channels[2] = 1500.0
    process.step(*STANDING, channels, round(0.1 / MAIN_LOOP), 200)
    motors = [
        process.step((20.0 * sin(k), 0.0, 0.0), *STANDING[1:], channels).motors
        for k in range(round(0.1 / MAIN_LOOP))
    ]
    process.close()
    changes = sum(now != before for before, now in pairwise(motors))
    assert changes == pytest.approx(0.1 * rate, rel=0.03)


def test_a_stick_to_the_right_asks_for_a_roll_to_the_right(firmware):
    channels = idle_channels()
    channels[0] = 1700.0
    reply = firmware.step(*STANDING, channels, 500, 10)
    roll, pitch, yaw = reply.setpoint
    assert roll > 50.0  # [deg/s]
    assert (pitch, yaw) == (0.0, 0.0)


def test_without_frames_of_the_link_the_sticks_are_not_seen(firmware):
    channels = idle_channels()
    channels[0] = 1700.0
    reply = firmware.step(*STANDING, channels, 500, frame_every=0)
    assert reply.setpoint == (0.0, 0.0, 0.0)


def test_a_refusal_to_arm_names_its_reason(built, eeprom):
    process = Firmware(built.program, PERIOD, eeprom)
    channels = idle_channels()
    channels[4] = 1900.0
    # the switch has been on since before the start
    reply = process.step(*STANDING, channels, round(BOOT / PERIOD))
    process.close()
    with pytest.raises(FirmwareError, match=r"^firmware: expected it to arm, but it refuses: \w+"):
        expect_armed(reply)


def test_a_firmware_that_is_killed_is_one_line(built, eeprom):
    """The line leaves out the text that the firmware printed while it started."""
    firmware = Firmware(built.program, PERIOD, eeprom)
    channels = idle_channels()
    firmware.step(*STANDING, channels, 100)
    os.kill(firmware._process.pid, signal.SIGKILL)
    firmware._process.wait()
    ended = r"^firmware: its process ended after 0\.100 s of its own time \(signal 9\): no message$"
    with pytest.raises(FirmwareError, match=ended):
        firmware.step(*STANDING, channels)
    firmware.close()


@pytest.mark.process
def test_a_program_that_is_none_is_one_line(tmp_path):
    with pytest.raises(FirmwareError) as caught:
        Firmware(tmp_path / "none", PERIOD)
    assert "\n" not in str(caught.value)


def test_the_folder_of_a_process_is_removed(built):
    process = Firmware(built.program, PERIOD)
    folder = process.folder
    assert folder.is_dir()
    process.close()
    assert not folder.exists()


@pytest.mark.process
def test_the_folder_of_a_killed_process_is_removed_by_the_next_one(tmp_path, monkeypatch):
    """A folder that is held, young or of something else stays."""
    monkeypatch.setattr(process, "gettempdir", lambda: str(tmp_path))
    folders = [tmp_path / f"{process.PREFIX}{name}" for name in ("left", "held", "young")]
    other = tmp_path / "something else"
    for folder in (*folders, other):
        folder.mkdir()
        (folder / "eeprom.bin").write_bytes(b"x")
        os.utime(folder, (0.0, 0.0))
    left, held, young = folders
    os.utime(young)
    handle = lock_folder(held)
    process._remove_left_folders.__wrapped__()
    os.close(handle)
    assert [folder.exists() for folder in (left, held, young, other)] == [False, True, True, True]


def test_a_process_holds_its_folder(built):
    firmware = Firmware(built.program, PERIOD)
    with pytest.raises(BlockingIOError):
        lock_folder(firmware.folder)
    firmware.close()
    assert not firmware.folder.exists()


def test_a_command_whose_terminal_is_closed_removes_the_folder(built, tmp_path):
    command = "from quadsim.cli.cli import main; main()"
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    child = subprocess.Popen(
        [sys.executable, "-c", command, "firmware", "tune", "--vehicle", "swift"],
        stderr=subprocess.PIPE,
        env=environment,
        start_new_session=True,
        text=True,
    )
    while child.poll() is None and not list(tmp_path.glob(f"{process.PREFIX}*/eeprom.bin")):
        time.sleep(0.05)
    child.send_signal(signal.SIGHUP)
    _, err = child.communicate(timeout=20)
    assert err == "race firmware: interrupted\n"
    assert not list(tmp_path.glob(f"{process.PREFIX}*"))
