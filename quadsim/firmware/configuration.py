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

from quadsim.firmware.package import FIRMWARE_VERSION
from quadsim.firmware.process import HIGH, LOW, MIDDLE, Firmware, FirmwareError, Reply
from quadsim.firmware.switches import FIRST_AUX, Condition, Switches, conditions_of, switches_of
from quadsim.firmware.text import Text
from quadsim.firmware.translation import ConfigurationError, FirmwareLine, Translation, sorted_lines
from quadsim.rotation import Quaternion, Vec3
from quadsim.vehicle import GRAVITY

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
SET = re.compile(r"set\s+\w+\s*=\s*(.*?)\s*", re.IGNORECASE)
TAKEN = re.compile(r"\w+ set to (.*?)\s*$", re.MULTILINE)
NUMBER = re.compile(r"[-+]?\d+(\.\d+)?")
ERROR = "###ERROR"
NOT_AVAILABLE = "ERR_CMD_NA"
LONGEST_PROBLEM = 160  # characters of the firmware's own message that an error shows

THROTTLE = 2  # number of the channel
LEAST_PULSE = 890.0  # of the throttle; the firmware takes a shorter one as a lost signal [us]
BELOW_CHECK = 10.0  # of the low throttle below min_check [us]
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


@dataclass(frozen=True)
class Configuration:
    """A configuration that the firmware has read, and the measured stick curves.

    The curves are linear between the measured positions.
    """

    eeprom: bytes  # the configuration as the firmware stores it
    switches: Switches
    positions: np.ndarray  # pulses of a stick [us], rising  (n,)
    rates: np.ndarray  # setpoints at these positions of roll, pitch, yaw [rad/s]  (3, n)
    throttles: np.ndarray  # pulses of the throttle [us], rising  (m,)
    motors: np.ndarray  # motor commands at these pulses, 0..1  (m,)
    # share of their range that the motors use, above the throttle's where that is limited alone
    output_limit: float = 1.0

    def pulse_for_rate(self, axis: int, rate: float) -> float:
        """Return the pulse of a stick [us] for a body rate [rad/s]; at most the largest one."""
        curve = self.rates[axis]
        if curve[0] < curve[-1]:
            return float(np.interp(rate, curve, self.positions))
        return float(np.interp(-rate, -curve, self.positions))

    def pulse_for_motors(self, motor: float) -> float:
        """Return the pulse of the throttle [us] for a command of all motors, 0..1."""
        return float(np.interp(motor, self.motors, self.throttles))


@lru_cache(maxsize=16)
def configured(program: Path, text: Text, motors_reversed: bool) -> Configuration:
    """Return the configuration after the firmware has read a text.

    Args:
        program: the built firmware.
        text: the configuration, without the lines for pins and other parts of the board.
        motors_reversed: whether the propellers turn opposite to Betaflight's default.

    Raises:
        ConfigurationError: the firmware does not know a line, or rejects its value; or the text is
            for another airframe, or has no positions of the switches to fly with.
        FirmwareError: the firmware does not arm.
    """
    read = _read_by_firmware(program, text, motors_reversed)
    bench = Bench(program, read.eeprom, read.switches)
    try:
        positions, rates = bench.rates()
        bench.arm()
        throttles, motors = bench.throttle()
    except FirmwareError as error:
        raise FirmwareError(f"{text.name}: {error}") from None
    finally:
        bench.close()
    return Configuration(
        read.eeprom, read.switches, positions, rates, throttles, motors, read.output_limit
    )


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
    read = _read_by_firmware(program, text, motors_reversed)
    return replace(configuration, eeprom=read.eeprom)


@lru_cache(maxsize=16)
def eeprom_with_log(program: Path, text: Text, motors_reversed: bool) -> bytes:
    """Return the configuration as the firmware stores it, with its log switched on.

    For arguments and errors see `configured`.
    """
    return _read_by_firmware(program, text, motors_reversed, LOG).eeprom


class ReadText(NamedTuple):
    """A text that the firmware has read."""

    eeprom: bytes  # the configuration as the firmware stores it
    switches: Switches
    output_limit: float  # share of their range that the motors use


def _read_by_firmware(
    program: Path, text: Text, motors_reversed: bool, more: Sequence[str] = ()
) -> ReadText:
    """Return a text as the firmware has read it.

    more: lines that follow the text.
    """
    translation = sorted_lines(text)
    problems = [*translation.problems, _problem_with_direction(translation, motors_reversed)]
    firmware = Firmware(program, PERIOD)
    try:
        firmware.command("defaults nosave")
        for line in translation.lines:
            place = f"{text.name}:{line.number}" if line.number else text.name
            problems.append(_carry_out(firmware, line.text, place))
        direction = "ON" if motors_reversed else "OFF"
        for line in (*FIXED, f"set yaw_motors_reversed = {direction}", *more):
            problems.append(_carry_out(firmware, line, "the simulation"))
        if any(problems):
            raise ConfigurationError("\n".join(filter(None, problems)))
        conditions = conditions_of(firmware.command("aux"))
        switches = switches_of(conditions, text.name)
        switches = switches._replace(throttle=_low_throttle(firmware))
        _read_enough_channels(firmware, conditions)
        output_limit = setting_of(firmware, "motor_output_limit") / 100.0
        return ReadText(firmware.save(), switches, output_limit)
    finally:
        firmware.close()


def _problem_with_direction(translation: Translation, motors_reversed: bool) -> str | None:
    """Return the problem with a line that turns the propellers otherwise than the vehicle's.

    OFF, the default, is in every dump, and says nothing of them: the vehicle decides.
    """
    line: FirmwareLine | None = translation.reversed
    if line is None:
        return None
    wanted = "ON" if motors_reversed else "OFF"
    given = line.text.partition("=")[2].strip().upper()
    if given in (wanted, "OFF"):
        return None
    expected = f"expected yaw_motors_reversed = {wanted}, as the vehicle's propellers turn"
    return f"{translation.name}:{line.number}: {expected}, got {given!r}: correct or remove it"


def _low_throttle(firmware: Firmware) -> float:
    """Return a pulse of the throttle at which the firmware arms [us]."""
    low = setting_of(firmware, "min_check") - BELOW_CHECK
    return max(min(LOW, low), LEAST_PULSE)


def _read_enough_channels(firmware: Firmware, conditions: Sequence[Condition]) -> None:
    """Have the firmware read the channels of all switches, as it does on a board."""
    channels = 1 + max(condition.channel for condition in conditions)
    if channels > setting_of(firmware, "max_aux_channels"):
        _carry_out(firmware, f"set max_aux_channels = {channels}", "the simulation")


def setting_of(firmware: Firmware, name: str) -> int:
    """Return an integer setting of the firmware."""
    found = re.search(rf"\b{name} = (-?\d+)", firmware.command(f"get {name}"))
    assert found, f"Betaflight has the setting {name}"
    return int(found[1])


def _carry_out(firmware: Firmware, line: str, place: str) -> str | None:
    """Have the firmware read a line; return the problem with it, None if it is accepted.

    Raises:
        ConfigurationError: the firmware ends at this line.
    """
    wanted = "expected a line of Betaflight's CLI"
    try:
        printed = firmware.command(line)
    except FirmwareError as error:
        raise ConfigurationError(f"{place}: {wanted}, got {line!r}: {error}: remove it") from None
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


class Bench:
    """A firmware at rest, for the measurement of its stick curves."""

    def __init__(self, program: Path, eeprom: bytes, switches: Switches):
        self._firmware = Firmware(program, PERIOD, eeprom)
        self._switches = switches
        self._channels = switches.channels()

    def arm(self) -> None:
        """Wait until the firmware permits arming, and arm it. Raises FirmwareError."""
        self._channels[THROTTLE] = self._switches.throttle
        self._hold(max(round((BOOT - self._firmware.time) / PERIOD), SETTLING))
        self._channels[FIRST_AUX:] = self._switches.flight
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
