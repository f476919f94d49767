"""Texts of Betaflight's command line, damaged and mixed, as pilots might paste them.

Without the firmware the lines are sorted and translated only; where it is built, it reads them and
its throttle is measured. Whatever comes, the text is refused with one line a problem, or it is
read, and then no setting is dropped that no version knows.
"""

from __future__ import annotations

import random
import re
from functools import cache
from pathlib import Path

from quadsim.files.strict_yaml import FileError
from quadsim.firmware.configuration import configured
from quadsim.firmware.package import find_built
from quadsim.firmware.process import FirmwareError
from quadsim.firmware.text import read_text
from quadsim.firmware.translation import (
    NOT_EXACT,
    RENAMED,
    WITHOUT_SIMULATION,
    Treatment,
    board_settings,
    in_this_version,
    translated,
)
from quadsim.vehicle import VEHICLES
from tests.fuzz.damage import damaged_bytes, damaged_text
from tests.fuzz.harness import Case

ARM = "aux 0 0 0 1700 2100 0 0"
VERSIONS = ("4.1.7", "4.2.0", "4.3.2", "4.4.2", "4.5.0", "4.5.2", "4.6.0", "2025.12.1", "")
OLD = """defaults nosave
board_name SOMEBOARD
feature TELEMETRY
serial 0 64 115200 57600 0 115200
aux 0 0 0 1700 2100 0 0
aux 1 1 1 900 1300 0 0
aux 2 36 2 1300 2100 0 0
aux 3 26 3 1900 2100 0 0
set gyro_lpf2_static_hz = 0
set dyn_notch_count = 1
set dshot_idle_value = 509
set yaw_motors_reversed = ON
set vbat_warning_cell_voltage = 355
profile 0
set p_roll = 59
set d_roll = 50
set d_min_roll = 48
set tpa_rate = 60
profile 1
set d_pitch = 30
profile 0
rateprofile 0
set roll_expo = 30
rateprofile 5
set roll_srate = 80
rateprofile 0
save
"""
# Lines that are pasted into a text
STRAY = (
    "mixer QUADX",
    "mixer HEX6",
    "mixer CUSTOM",
    "mmix 0 1 -1 1 -1",
    "mmix nan inf",
    "smix reset",
    "feature 3D",
    "feature -AIRMODE",
    "aux 19 35 11 900 2100 1 0",
    "aux 1 2 3",
    "aux 5 1 4 900 2100 0 1",
    "aux -1 0 0 0 0 0 0",
    "set motor_output_limit = 80",
    "set motor_output_limit = 1",
    "set min_check = 885",
    "set max_aux_channels = 0",
    "set throttle_limit_type = CLIP",
    "set d_min_roll = 0",
    "set d_min_yaw = 250",
    "set dshot_idle_valu = 1",
    "set =",
    "set",
    "profile",
    "profile 9",
    "rateprofile 3",
    "rateprofile 99999",
    "defaults nosave",
    "bl",
    "save",
    "exit",
    "#",
    "# Betaflight / X (Y) 4.2.9 z",
    "set yaw_motors_reversed = OFF",
    "aux 0 0 0 1700 2100",
    "aux 2 56 3 1900 2100 0 0",
    "mixer QUADX_1234",
    "#$ FIRMWARE_VERSION: 4.3",
    "set auto_profile_cell_count = 6",
    "get p",
    "dump all",
    "\t set p_roll\t= 30 # comment",
)
PLACE = re.compile(r"f\.txt(:\d+)?: |firmware: |the simulation: ")
MISSPELT = re.compile(r"set\s+(\w+)\s*=", re.IGNORECASE)


@cache
def originals() -> tuple[str, ...]:
    """Return the texts that are damaged."""
    return (OLD, *(path.read_text() for path in sorted(VEHICLES.glob("*.betaflight.txt"))))


def betaflight_texts(rng: random.Random) -> Case:
    """Return a case with one text."""
    lines = rng.choice(originals()).splitlines()
    version = rng.choice(VERSIONS)
    if version:
        lines.insert(0, f"# Betaflight / BOARD (BRD) {version} Jan  1 2025 / 00:00:00 (abc)")
    for _ in range(rng.choice((0, 0, 1, 1, 2, 4))):
        lines.insert(rng.randrange(len(lines) + 1), rng.choice((*STRAY, _setting(rng))))
    if rng.random() < 0.2:
        rng.shuffle(lines)
    data = rng.choice(("\n", "\n", "\r\n", "\r")).join(lines).encode()
    damage = rng.random()
    if damage < 0.35:
        data = damaged_text(rng, data.decode()).encode(errors="replace")
    elif damage < 0.5:
        data = damaged_bytes(rng, data)
    elif damage < 0.6:
        data = data.decode().encode(rng.choice(("utf-16", "utf-8-sig", "latin-1")))

    def prepare(folder: Path) -> None:
        (folder / "f.txt").write_bytes(data)

    return Case("betaflight_texts", repr(data[:300]), (), prepare=prepare, call=_read)


def _setting(rng: random.Random) -> str:
    """Return a line that sets something known to some version, or a misspelt name."""
    names = rng.choice((board_settings(), RENAMED, NOT_EXACT, WITHOUT_SIMULATION))
    name = rng.choice(sorted(names))
    if rng.random() < 0.4:
        at = rng.randrange(len(name))
        name = name[:at] + name[at + 1 :]
    return f"set {name} = {rng.choice(('0', '1', '50', '-3', '1e9', 'ON', 'x', ''))}"


def _read() -> int:
    """Read the text. Return 0 if it flies, 1 if it is refused as it should be."""
    try:
        text = read_text(Path("f.txt"))
        found = translated(text)
        dropped = {
            name[1].lower()
            for entry in found.entries
            if entry.kind in (Treatment.BOARD, Treatment.NOT_SIMULATED, Treatment.NOT_EXACT)
            and (name := MISSPELT.match(entry.line.text))
        }
        known = {*board_settings(), *NOT_EXACT, *WITHOUT_SIMULATION}
        known |= {"anti_gravity_gain", "iterm_windup", "failsafe_procedure"}
        known.add("auto_profile_cell_count")
        assert dropped <= known, dropped - known
        again = translated(in_this_version(text))
        assert [line.text for line in again.lines] == [line.text for line in found.lines]
        assert len(found.summary().splitlines()) == 1
        built = find_built()
        if built is None:
            return 0
        curves = configured(built.program, text, motors_reversed=True)
        assert 0.0 <= curves.motors[0] <= curves.motors[-1] <= 1.0
    except (FileError, FirmwareError) as error:
        lines = str(error).splitlines()
        assert lines, "an error without a text"
        assert all(line.isprintable() for line in lines), lines
        assert all(
            re.match(r"f\.txt(:\d+)?: |firmware: |the simulation: ", line) for line in lines
        ), lines
        return 1
    return 0
