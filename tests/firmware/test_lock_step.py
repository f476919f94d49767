"""The firmware in lock step: equal requests give equal replies, and its end is one line."""

import os
import signal
from itertools import pairwise
from math import sin

import pytest

from quadsim.firmware.configuration import BOOT, expect_armed, idle_channels
from quadsim.firmware.process import MAIN_LOOP, Firmware, FirmwareError

PERIOD = 1e-3
STANDING = ((0.0, 0.0, 0.0), (0.0, 0.0, 9.81), (1.0, 0.0, 0.0, 0.0))


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
