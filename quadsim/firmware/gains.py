"""The gains of Betaflight's rate loop, and their lines in a configuration."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from quadsim.firmware.configuration import PERIOD, Configuration, setting_of
from quadsim.firmware.process import Firmware
from quadsim.firmware.text import Text

# Lines that save a configuration at its end, and empty lines
LAST_LINES = re.compile(r"(save|exit|batch end)\b.*|", re.IGNORECASE)
PROFILE = re.compile(r"\s*profile\s+\d+\s*", re.IGNORECASE)


class Gains(NamedTuple):
    """The gains of one axis, in the units of Betaflight's CLI."""

    p: int
    i: int
    d: int


class AxisGains(NamedTuple):
    """The gains of the three axes."""

    roll: Gains
    pitch: Gains
    yaw: Gains


AXIS_NAMES = AxisGains._fields


def with_gains(text: Text, gains: AxisGains) -> Text:
    """Return the configuration with changed gains.

    Lines that set a gain are replaced; missing lines are added after the last setting. A text with
    several profiles also gets all gains at its end, for the profile that it selects last.
    """
    settings = dict(_settings(gains))
    missing = dict(settings)
    lines = []
    for line in text.lines:
        name = _name(line)
        if name in settings:
            line = settings[name]
            missing.pop(name, None)
        lines.append(line)
    if any(PROFILE.fullmatch(line) for line in text.lines):
        missing = settings

    # In `diff all` the last lines save the configuration.
    end = len(lines)
    while end > 0 and LAST_LINES.fullmatch(lines[end - 1].strip()):
        end -= 1
    return Text(text.name, (*lines[:end], *missing.values(), *lines[end:]))


def gains_of(program: Path, configuration: Configuration) -> AxisGains:
    """Return the gains that the firmware reads from a configuration. Raises FirmwareError."""
    firmware = Firmware(program, PERIOD, configuration.eeprom)
    try:
        found = [
            Gains(*(setting_of(firmware, f"{letter}_{axis}") for letter in Gains._fields))
            for axis in AXIS_NAMES
        ]
    finally:
        firmware.close()
    return AxisGains(*found)


def _settings(gains: AxisGains) -> list[tuple[str, str]]:
    """Return names and lines of the settings.

    d_max is switched off, as it would replace D in fast turns.
    """
    numbers = [
        (f"{letter}_{axis}", number)
        for axis, of_axis in zip(AXIS_NAMES, gains, strict=True)
        for letter, number in of_axis._asdict().items()
    ]
    numbers += [(f"d_max_{axis}", 0) for axis in AXIS_NAMES]
    return [(name, f"set {name} = {number}") for name, number in numbers]


def _name(line: str) -> str | None:
    """Return the name of the setting that a line sets."""
    found = re.fullmatch(r"\s*set\s+(\w+)\s*=.*", line, re.IGNORECASE)
    return found[1].lower() if found else None
