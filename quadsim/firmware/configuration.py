"""The firmware's configuration: a text of its command line, and the resulting stick curves.

A pilot pastes such a text into Betaflight's Configurator, or gets it from `diff all`. The
firmware's own command line reads the text, so every setting has the same meaning as on a drone.

The stick positions for desired body rates and a desired motor command depend on rates type, expo,
limits and throttle curve. They are measured on the firmware: at rest, it receives a series of stick
positions, and reports its body-rate setpoints and motor commands.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from textwrap import shorten
from typing import NamedTuple

import numpy as np

from quadsim.files.strict_yaml import FileError
from quadsim.firmware.package import FIRMWARE_VERSION
from quadsim.firmware.process import HIGH, LOW, MIDDLE, Firmware, FirmwareError, Reply
from quadsim.rotation import Quaternion, Vec3
from quadsim.vehicle import GRAVITY, VEHICLES, Vehicle

LARGEST = 200_000  # characters of a configuration
SHIPPED = ".betaflight.txt"  # ends the name of the file that comes with a vehicle
# Lines that have no meaning without the board: pins, ports, screens and transmitters
COMMANDS_OF_BOARDS = [
    "resource",
    "timer",
    "dma",
    "serial",
    "serialpassthrough",
    "beeper",
    "beacon",
    "led",
    "color",
    "mode_color",
    "vtx",
    "vtxtable",
    "osd",
    "board_name",
    "manufacturer_id",
    "mcu_id",
    "signature",
    "adjrange",
    "rxfail",
    "batch",
    "save",
    "exit",
    "defaults",
    r"feature(?!\s+-?(airmode|anti_gravity|motor_stop|3d)\b)",
]
# Settings that exist only on a board: pins and ports as above, telemetry, and filters that follow
# the noise of motors, which the firmware's simulation target lacks
SETTINGS_OF_BOARDS = [
    "osd",
    "vtx",
    "vbat",
    "ibat",
    "cms",
    "displayport",
    "serialrx",
    "telemetry",
    "frsky",
    "crsf",
    "srxl",
    "sbus",
    "hott",
    "smartport",
    "beeper",
    "gps",
    "mag",
    "baro",
    "acc_cal",
    "craft",
    "pilot",
    "name",
    "ledstrip",
    "dshot",
    "use_unsynced",
    "motor_pwm",
    "motor_poles",
    "rpm_filter",
    "dyn_idle",
    "rssi",
    "camera",
    "rcdevice",
    "usb",
    "flash",
    "sdcard",
    "pinio",
    "enable_stick",
    "stats",
    "cpu",
    "vcd",
    "max7456",
    "i2c",
    "esc_sensor",
    "gyro_1",
    "gyro_2",
    "gyro_to",
    "blackbox",
    "tri_",
    "servo",
    "battery",
    "current",
    "force_bat",
    "task",
    "timezone",
    "pwr_on",
    "transponder",
    "opticalflow",
    "rangefinder",
    "box_user",
    "scheduler",
    "adc",
    "cc2500",
    "channel_forwarding",
    "dashboard",
    "dyn_notch",
    "expresslrs",
    "flysky",
    "gimbal",
    "ibus",
    "input_filtering",
    "led_inversion",
    "mavlink",
    "mco",
    "pid_in_tlm",
    "report_cell",
    "rpm_limit",
    "rx_spi",
    "sdio",
    "spektrum",
    "system_hse",
    "tlm",
]
OF_THE_BOARD = re.compile(
    rf"#.*|({'|'.join(COMMANDS_OF_BOARDS)})\b.*|set ({'|'.join(SETTINGS_OF_BOARDS)})\w*\b.*",
    re.IGNORECASE,
)
# Settings that the simulation overrides: orientation of the virtual board, order of motors and
# channels, and the log
FIXED = (
    "set align_board_roll = 0",
    "set align_board_pitch = 0",
    "set align_board_yaw = 0",
    "set motor_output_reordering = 0,1,2,3,4,5,6,7",
    "map AETR1234",
)
# Settings that make the firmware write its log from arming on
LOG = ("set blackbox_device = VIRTUAL", "set blackbox_mode = NORMAL")
# The firmware's list of modes: channel, lowest and highest pulse of a mode
MODE = re.compile(r"aux \d+ (?P<mode>\d+) (?P<channel>\d+) (?P<low>\d+) (?P<high>\d+)\b.*")
ARM_MODE = 0
# Modes in which the sticks do not command body rates and thrust, by number
OTHER_STICKS = {
    1: "ANGLE",
    2: "HORIZON",
    3: "ALTHOLD",
    6: "HEADFREE",
    11: "POS HOLD",
    12: "PASSTHRU",
    27: "FAILSAFE",
    35: "FLIP OVER AFTER CRASH",
    46: "GPS RESCUE",
    47: "ACRO TRAINER",
    49: "LAUNCH CONTROL",
}
SET = re.compile(r"set\s+\w+\s*=\s*(.*?)\s*", re.IGNORECASE)
TAKEN = re.compile(r"\w+ set to (.*?)\s*$", re.MULTILINE)
NUMBER = re.compile(r"[-+]?\d+(\.\d+)?")
ERROR = "###ERROR"
NOT_AVAILABLE = "ERR_CMD_NA"
LONGEST_PROBLEM = 160  # characters of the firmware's own message that an error shows

THROTTLE = 2  # number of the channel
FIRST_AUX = 4
AXES = (0, 1, 3)  # channels of roll, pitch and yaw
STANDING: tuple[Vec3, Vec3, Quaternion] = ((0, 0, 0), (0, 0, GRAVITY), (1, 0, 0, 0))
PERIOD = 1e-3  # period of the measurement [s]
FRAME_STEPS = 10  # steps between two frames of the link during the measurement
BOOT = 5.6  # time after the start in which Betaflight does not arm [s]
ARMING = 0.5  # time that arming may take [s]
SETTLING = 60  # steps from a change of the sticks to the reading
POSITIONS = 251  # number of positions of a stick from the middle to its end

# Reasons that prevent arming, by the bit of the flag
ARMING_FLAGS = [
    "NO_GYRO",
    "FAILSAFE",
    "RX_FAILSAFE",
    "NOT_DISARMED",
    "BOXFAILSAFE",
    "RUNAWAY",
    "CRASH",
    "THROTTLE",
    "ANGLE",
    "BOOTGRACE",
    "NOPREARM",
    "LOAD",
    "CALIB",
    "CLI",
    "CMS",
    "BST",
    "MSP",
    "PARALYZE",
    "GPS",
    "RESC",
    "DSHOT_TELEM",
    "REBOOT_REQD",
    "DSHOT_BITBANG",
    "ACC_CALIB",
    "MOTOR_PROTO",
    "FLIP_SWITCH",
    "ALT_HOLD_SW",
    "POS_HOLD_SW",
    "ARM_SWITCH",
]


class ConfigurationError(FileError):
    """The firmware rejects lines of a configuration; the message has one line for each."""


@dataclass(frozen=True)
class Configuration:
    """A configuration that the firmware has read, and the measured stick curves.

    The curves are linear between the measured positions.
    """

    eeprom: bytes  # the configuration as the firmware stores it
    arm_channel: int
    arm_pulse: float  # pulse of the arming switch when on [us]
    positions: np.ndarray  # pulses of a stick [us], rising  (n,)
    rates: np.ndarray  # setpoints at these positions of roll, pitch, yaw [rad/s]  (3, n)
    throttles: np.ndarray  # pulses of the throttle [us], rising  (m,)
    motors: np.ndarray  # motor commands at these pulses, 0..1  (m,)

    def pulse_for_rate(self, axis: int, rate: float) -> float:
        """Return the pulse of a stick [us] for a body rate [rad/s]; at most the largest one."""
        curve = self.rates[axis]
        if curve[0] < curve[-1]:
            return float(np.interp(rate, curve, self.positions))
        return float(np.interp(-rate, -curve, self.positions))

    def pulse_for_motors(self, motor: float) -> float:
        """Return the pulse of the throttle [us] for a command of all motors, 0..1."""
        return float(np.interp(motor, self.motors, self.throttles))


class Text(NamedTuple):
    """The text of a configuration."""

    name: str  # of the file
    lines: tuple[str, ...]


def read_text(path: Path) -> Text:
    """Return the lines of a configuration's file. Raises FileError."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise FileError(f"{path}: expected a text of Betaflight's CLI: {error.strerror}") from None
    if len(data) > LARGEST:
        raise FileError(f"{path}: expected at most {LARGEST} bytes, got {len(data)}")
    try:
        text = data.decode()
    except UnicodeDecodeError:
        raise FileError(f"{path}: expected a text in UTF-8") from None
    return Text(str(path), tuple(text.splitlines()))


def shipped_configuration(vehicle: Vehicle) -> Text | None:
    """Return the firmware's configuration that comes with a vehicle, None if none does."""
    path = VEHICLES / f"{vehicle.name.partition('-twr')[0]}{SHIPPED}"
    return read_text(path) if path.exists() else None


@lru_cache(maxsize=16)
def configured(program: Path, text: Text, motors_reversed: bool) -> Configuration:
    """Return the configuration after the firmware has read a text.

    Args:
        program: the built firmware.
        text: the configuration, without the lines for pins and other parts of the board.
        motors_reversed: whether the propellers turn opposite to Betaflight's default.

    Raises:
        ConfigurationError: the firmware does not know a line, or rejects its value.
        FirmwareError: the firmware does not arm.
    """
    eeprom, (channel, pulse) = _read_by_firmware(program, text, motors_reversed)
    bench = Bench(program, eeprom, channel, pulse)
    try:
        positions, rates = bench.rates()
        bench.arm()
        throttles, motors = bench.throttle()
    finally:
        bench.close()
    return Configuration(eeprom, channel, pulse, positions, rates, throttles, motors)


def with_other_gains(
    configuration: Configuration, program: Path, text: Text, motors_reversed: bool
) -> Configuration:
    """Return the configuration of a text that differs from an earlier text only in its gains.

    The curves of sticks and throttle do not depend on the gains, so they are not measured again.

    Args:
        configuration: configuration of the earlier text.
        program, text, motors_reversed: as for `configured`.

    Raises:
        ConfigurationError, FirmwareError: as for `configured`.
    """
    eeprom, _ = _read_by_firmware(program, text, motors_reversed)
    return replace(configuration, eeprom=eeprom)


@lru_cache(maxsize=16)
def eeprom_with_log(program: Path, text: Text, motors_reversed: bool) -> bytes:
    """Return the configuration as the firmware stores it, with its log switched on.

    For arguments and errors see `configured`.
    """
    eeprom, _ = _read_by_firmware(program, text, motors_reversed, LOG)
    return eeprom


def _read_by_firmware(
    program: Path, text: Text, motors_reversed: bool, more: Sequence[str] = ()
) -> tuple[bytes, tuple[int, float]]:
    """Return the stored configuration, and channel and pulse of the arming switch.

    more: lines that follow the text.
    """
    firmware = Firmware(program, PERIOD)
    try:
        firmware.command("defaults nosave")
        problems = []
        for number, line in enumerate(text.lines, 1):
            if line.strip() and not OF_THE_BOARD.fullmatch(line.strip()):
                problems.append(_carry_out(firmware, line.strip(), f"{text.name}:{number}"))
        direction = "ON" if motors_reversed else "OFF"
        for line in (*FIXED, f"set yaw_motors_reversed = {direction}", *more):
            problems.append(_carry_out(firmware, line, "the simulation"))
        if any(problems):
            raise ConfigurationError("\n".join(filter(None, problems)))
        modes = list(_modes(firmware.command("aux")))
        arm = _arm_switch(modes, text.name)
        _check_other_switches(modes, arm, text.name)
        return firmware.save(), arm
    finally:
        firmware.close()


def _carry_out(firmware: Firmware, line: str, place: str) -> str | None:
    """Have the firmware read a line; return the problem with it, None if it is accepted."""
    printed = firmware.command(line)
    if ERROR in printed:
        problem = printed[printed.index(ERROR) :].strip().strip("#").removeprefix("ERROR ")
    elif NOT_AVAILABLE in printed:
        problem = f"Betaflight {FIRMWARE_VERSION} has no such command"
    elif _is_text_for_number(line, printed):
        problem = "its value is no number"
    else:
        return None
    # The allowed values of some settings are a hundred names.
    problem = shorten(problem, LONGEST_PROBLEM, placeholder=" ...")
    wanted = "expected a line of Betaflight's CLI"
    return f"{place}: {wanted}, got {line!r}: {problem}: correct or remove it"


def _is_text_for_number(line: str, printed: str) -> bool:
    """Return whether a numeric setting was given a text that is not a number.

    The firmware reads the number at the beginning of a text, or 0 if there is none.
    """
    given = SET.fullmatch(line)
    taken = TAKEN.search(printed)
    if not given or not taken:
        return False
    return bool(NUMBER.fullmatch(taken[1])) and not NUMBER.fullmatch(given[1])


class Mode(NamedTuple):
    """A mode of the firmware, and the pulses of the switch that turn it on."""

    number: int
    channel: int
    low: int  # least pulse [us]
    high: int  # [us]; the mode is off from here on
    line: str

    def is_on(self, pulse: float) -> bool:
        """Return whether the mode is on at a pulse of its switch [us]."""
        return self.low <= pulse < self.high


def _modes(printed: str) -> Iterator[Mode]:
    """Yield the modes that have a switch, from the firmware's printed list."""
    for found in MODE.finditer(printed):
        number, channel, low, high = map(int, found.groups())
        if low < high:
            yield Mode(number, FIRST_AUX + channel, low, high, found[0].strip())


def _arm_switch(modes: Sequence[Mode], name: str) -> tuple[int, float]:
    """Return the channel and the pulse [us] of the mode ARM. Raises ConfigurationError."""
    for mode in modes:
        if mode.number == ARM_MODE:
            return mode.channel, min(max((mode.low + mode.high) / 2, LOW), HIGH)
    raise ConfigurationError(
        f"{name}: expected a switch for ARM, such as 'aux 0 0 0 1700 2100 0 0', got none"
    )


def _check_other_switches(modes: Sequence[Mode], arm: tuple[int, float], name: str) -> None:
    """Check that in flight the sticks command body rates and thrust. Raises ConfigurationError.

    All switches but the one for ARM are at their lowest pulse in flight.
    """
    arm_channel, arm_pulse = arm
    for mode in modes:
        pulse = arm_pulse if mode.channel == arm_channel else LOW
        if mode.number in OTHER_STICKS and mode.is_on(pulse):
            wanted = f"expected {OTHER_STICKS[mode.number]} to be off at {pulse:g} us"
            raise ConfigurationError(
                f"{name}: {wanted}, where its switch is in flight, got {mode.line!r}: "
                "correct or remove it"
            )


class Bench:
    """A firmware at rest, for the measurement of its stick curves."""

    def __init__(self, program: Path, eeprom: bytes, arm_channel: int, arm_pulse: float):
        self._firmware = Firmware(program, PERIOD, eeprom)
        self._arm = (arm_channel, arm_pulse)
        self._channels = idle_channels()

    def arm(self) -> None:
        """Wait until the firmware permits arming, and arm it. Raises FirmwareError."""
        self._channels[THROTTLE] = LOW
        self._hold(max(round((BOOT - self._firmware.time) / PERIOD), SETTLING))
        channel, pulse = self._arm
        self._channels[channel] = pulse
        reply = self._hold(round(ARMING / PERIOD))
        expect_armed(reply)

    def rates(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the positions [us]  (n,) and the setpoints of the three axes [rad/s]  (3, n).

        The firmware is not armed, as it would detect a runaway if the sticks turn nothing.
        """
        self._channels[THROTTLE] = MIDDLE
        one_side = np.linspace(0.0, HIGH - MIDDLE, POSITIONS)
        offsets = np.concatenate((-one_side[:0:-1], one_side))
        setpoints = []
        for offset in offsets:
            for axis in AXES:
                self._channels[axis] = MIDDLE + offset
            setpoints.append(self._hold(SETTLING).setpoint)
        for axis in AXES:
            self._channels[axis] = MIDDLE
        self._hold(SETTLING)
        return MIDDLE + offsets, np.deg2rad(np.array(setpoints)).T

    def throttle(self) -> tuple[np.ndarray, np.ndarray]:
        """Return pulses [us] and motor commands, where the commands rise with the pulse."""
        pulses = np.linspace(LOW, HIGH, 2 * POSITIONS - 1)
        commands = []
        for pulse in pulses:
            self._channels[THROTTLE] = pulse
            commands.append(np.mean(self._hold(SETTLING).motors))
        found = np.array(commands)
        rises = np.concatenate(([True], found[1:] > np.maximum.accumulate(found)[:-1]))
        return pulses[rises], found[rises]

    def close(self) -> None:
        """End the firmware."""
        self._firmware.close()

    def _hold(self, steps: int) -> Reply:
        """Hold the sticks for some steps, and return the last reply."""
        return self._firmware.step(*STANDING, self._channels, steps, FRAME_STEPS)


def idle_channels() -> list[float]:
    """Return the pulses of sticks in the middle, throttle down and switches off [us]."""
    channels = [MIDDLE, MIDDLE, LOW, MIDDLE]
    return channels + [LOW] * 12


def expect_armed(reply: Reply) -> None:
    """Raise FirmwareError, which names the flags, if the firmware has not armed."""
    if reply.armed:
        return
    flags = ", ".join(_names(reply.arming_flags)) or "no reason"
    raise FirmwareError(f"firmware: expected it to arm, but it refuses: {flags}")


def _names(flags: int) -> Iterator[str]:
    for bit, name in enumerate(ARMING_FLAGS):
        # The flag of the switch itself is set with every other flag.
        if flags >> bit & 1 and (name != "ARM_SWITCH" or flags == 1 << bit):
            yield name
