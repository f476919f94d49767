"""A process of the firmware, stepped in lock step over pipes; see lockstep.c for the messages."""

from __future__ import annotations

import os
import struct
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from math import nan
from pathlib import Path
from shutil import rmtree
from stat import S_ISDIR
from tempfile import TemporaryDirectory, gettempdir
from time import time
from typing import NamedTuple

from quadsim.files.locks import lock_folder
from quadsim.rotation import Quaternion, Vec3

CHANNELS = 16
MAIN_LOOP = 50e-6  # simulated time of a pass of the firmware's main loop [s]
# Positions of a stick or switch, as pulses [us]
LOW = 1000.0
MIDDLE = 1500.0
HIGH = 2000.0

STEP = struct.Struct(f"<I 3d 3d 4d 2d {CHANNELS}d")
COMMAND_LINE = struct.Struct("<I I")
REPLY = struct.Struct("<4d 3d d d")
SIZE = struct.Struct("<I")
STEP_KIND = 1
COMMAND_LINE_KIND = 2

# Number of characters of the firmware's last messages in an error
SHOWN = 200

PREFIX = "quadsim-betaflight-"  # of the folders of processes
YOUNG = 60.0  # age of a folder that its process may not hold yet [s]


def _held(folder: Path) -> int | None:
    """Return a handle that holds a folder until this process ends, None if that is impossible."""
    try:
        return lock_folder(folder)
    except OSError:
        return None


@cache
def _remove_left_folders() -> None:
    """Remove the folders of processes that were killed, once in each process of this project."""
    for folder in Path(gettempdir()).glob(f"{PREFIX}*"):
        # Another user's folder, or one that vanishes now
        with suppress(OSError):
            about = folder.lstat()
            old = time() - about.st_mtime > YOUNG
            if not old or about.st_uid != os.getuid() or not S_ISDIR(about.st_mode):
                continue
            handle = lock_folder(folder)
            rmtree(folder, ignore_errors=True)
            os.close(handle)


class FirmwareError(ValueError):
    """The firmware does not run, or fails a requirement of a flight; one line."""


class Reply(NamedTuple):
    """The firmware's reply to a step."""

    motors: tuple[float, float, float, float]  # commands of motors 1 to 4, 0..1
    setpoint: Vec3  # body-rate setpoints of the sticks, with the firmware's signs [deg/s]
    armed: bool
    arming_flags: int  # bits of the reasons that prevent arming


class Firmware:
    """One process of the firmware.

    The process has its own folder with its configuration (eeprom.bin) and its log; `close` removes
    the folder.
    """

    def __init__(self, program: Path, period: float, eeprom: bytes | None = None):
        """Start the firmware; its time begins with the first step.

        Args:
            program: the program that `race firmware build` has built.
            period: time between two steps [s], a multiple of 50 us.
            eeprom: configuration; None: the firmware's defaults.

        Raises:
            FirmwareError: the program does not start.
        """
        _remove_left_folders()
        self._folder = TemporaryDirectory(prefix=PREFIX)
        self.folder = Path(self._folder.name)
        self._lock = _held(self.folder)
        self._period = period
        self._steps = 0
        if eeprom is not None:
            (self.folder / "eeprom.bin").write_bytes(eeprom)
        replies, replies_of_firmware = os.pipe()
        self._replies = os.fdopen(replies, "rb")
        environment = os.environ | {
            "QUADSIM_PERIOD_US": str(round(1e6 * period)),
            "QUADSIM_REPLIES": str(replies_of_firmware),
        }
        try:
            with (self.folder / "messages.txt").open("wb") as messages:
                self._process = subprocess.Popen(
                    [str(program)],
                    cwd=self.folder,
                    stdin=subprocess.PIPE,
                    stdout=messages,
                    stderr=subprocess.STDOUT,
                    pass_fds=(replies_of_firmware,),
                    env=environment,
                )
        except OSError as error:
            self._replies.close()
            self._remove_folder()
            raise FirmwareError(f"{program}: expected the firmware's program: {error}") from None
        finally:
            os.close(replies_of_firmware)
        self._start_messages = 0
        self.reply = self._read_reply()
        # Start-up messages do not explain a later exit.
        self._start_messages = (self.folder / "messages.txt").stat().st_size

    @property
    def time(self) -> float:
        """The time since the firmware started [s]."""
        return self._steps * self._period

    def step(
        self,
        gyro: Vec3,
        acceleration: Vec3,
        attitude: Quaternion,
        channels: Sequence[float],
        periods: int = 1,
        frame_every: int = 1,
    ) -> Reply:
        """Advance by one period, or by several with constant inputs.

        Args:
            gyro: body rates, x forward, y left, z up [rad/s].
            acceleration: specific force in the same frame [m/s^2].
            attitude: wxyz.
            channels: pulses of the radio link in the order roll, pitch, throttle, yaw, AUX1 and
                following [us]  (16,).
            periods: number of periods.
            frame_every: number of periods between frames of the radio link; 0: no frame arrives,
                and the firmware does not receive the channels.

        Raises:
            FirmwareError: the firmware has ended.
        """
        numbers = (*gyro, *acceleration, *attitude, float(periods), float(frame_every), *channels)
        self._send(STEP.pack(STEP_KIND, *numbers))
        self.reply = self._read_reply()
        self._steps += periods
        return self.reply

    def command(self, line: str) -> str:
        """Execute a line in the firmware's command line, and return the output.

        Raises:
            FirmwareError: the firmware has ended.
        """
        data = line.encode() + b"\n"
        self._send(COMMAND_LINE.pack(COMMAND_LINE_KIND, len(data)) + data)
        (size,) = SIZE.unpack(self._read(SIZE.size))
        return self._read(size).decode(errors="replace")

    def save(self) -> bytes:
        """Save the configuration, which ends the firmware, and return it.

        Raises:
            FirmwareError: no configuration was saved.
        """
        data = b"save\n"
        self._send(COMMAND_LINE.pack(COMMAND_LINE_KIND, len(data)) + data)
        try:
            self._process.wait(timeout=10)
            return (self.folder / "eeprom.bin").read_bytes()
        except (OSError, subprocess.TimeoutExpired):
            raise FirmwareError(f"firmware: nothing was saved: {self._messages()}") from None

    def close(self) -> None:
        """End the process and remove its folder."""
        with suppress(OSError):
            assert self._process.stdin
            self._process.stdin.close()
        self._replies.close()
        try:
            self._process.wait(timeout=1)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._remove_folder()

    def _remove_folder(self) -> None:
        self._folder.cleanup()
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def _send(self, data: bytes) -> None:
        assert self._process.stdin
        try:
            self._process.stdin.write(data)
            self._process.stdin.flush()
        except OSError:
            raise self._ended() from None

    def _read(self, size: int) -> bytes:
        data = self._replies.read(size)
        if len(data) < size:
            raise self._ended()
        return data

    def _read_reply(self) -> Reply:
        numbers = REPLY.unpack(self._read(REPLY.size))
        m1, m2, m3, m4, roll, pitch, yaw, armed, flags = numbers
        return Reply((m1, m2, m3, m4), (roll, pitch, yaw), bool(armed), int(flags))

    def _ended(self) -> FirmwareError:
        """Return the error for a process that has ended."""
        try:
            status = self._process.wait(timeout=1)
        except subprocess.TimeoutExpired:
            status = nan
        how = f"signal {-status}" if status < 0 else f"exit code {status}"
        when = f"after {self.time:.3f} s of its own time"
        return FirmwareError(f"firmware: its process ended {when} ({how}): {self._messages()}")

    def _messages(self) -> str:
        """Return the last messages of the firmware on one line."""
        try:
            data = (self.folder / "messages.txt").read_bytes()[self._start_messages :]
        except OSError:
            return "no message"
        return " ".join(data.decode(errors="replace").split())[-SHOWN:] or "no message"
