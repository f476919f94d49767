"""Translate a text of Betaflight's command line from the version that wrote it.

A pilot's `diff all` has the names and numbers of the version on the drone, and many lines that a
simulation has no use for. Each line is sorted into one of the kinds below: it is taken as it is,
translated into the names and values of the version that is simulated, or left out. A setting that
no version knows is not left out: the firmware's own command line reads it and refuses it.

The table of changed names was made from the settings of the versions 4.2 to 4.6.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from enum import Enum
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from quadsim.files.strict_yaml import FileError
from quadsim.firmware.package import FIRMWARE_VERSION
from quadsim.firmware.text import Text

BOARD_SETTINGS = Path(__file__).with_name("board_settings.txt")
LONGEST_LINE = 255  # characters; the firmware cuts longer lines
# What the firmware's command line drops from a line
UNREADABLE = re.compile(r"[^ -~]")
SHOWN = 80  # characters of a line in a message
# Such as "# Betaflight / STM32F7X2 (S7X2) 4.5.0 Apr 28 2024 / 06:56:11 ..."
SAID = re.compile(r"#[#\s]*Betaflight\s*(?:/.*?\s)?v?(\d+)\.(\d+)\.\d+", re.IGNORECASE)
# Presets name the versions that they are for, such as "#$ FIRMWARE_VERSION: 4.3".
FOR_VERSION = re.compile(r"#\$\s*FIRMWARE_VERSION\s*:\s*v?(\d+)\.(\d+)", re.IGNORECASE)
SET = re.compile(r"set\s+(\w+)\s*=\s*(.*)", re.IGNORECASE)

AXES = ("roll", "pitch", "yaw")
PROFILES = 4  # of the version that is simulated; of gains and of rates
MODES = 20  # conditions of modes
AUX_CHANNELS = 12  # of the simulated link
# Numbers of the modes of 4.6; those that are missing were removed before 4.2
MODE_NUMBERS = {*range(9), 11, 12, 13, 15, 17, 19, 20, *range(23, 38), *range(39, 56)}
# Modes of the firmware's log, which is written from arming on
LOG_MODES = {26, 31}

Version = tuple[int, int]
THIS: Version = (4, 6)
OLDEST: Version = (4, 2)


class Treatment(Enum):
    """The ways in which a line is treated."""

    TAKEN = "taken"
    TRANSLATED = "translated"
    NOT_EXACT = "without an equal in this version"
    NOT_SIMULATED = "not simulated"
    PROFILE = "of a profile that is not flown"
    TAKEN_BACK = "taken back by a later 'defaults'"
    BOARD = "of the board, the transmitter or another mode"


class FirmwareLine(NamedTuple):
    """A line for the firmware's command line."""

    text: str
    number: int | None = None  # in the file; None: the line is added


class TranslatedLine(NamedTuple):
    """A line of the file, and the lines that the firmware reads in its place."""

    kind: Treatment
    line: FirmwareLine
    became: tuple[str, ...] = ()
    note: str = ""


class Translation(NamedTuple):
    """A text with the names of the version that is simulated, and the treatment of its lines."""

    name: str  # of the file
    version: Version | None  # None: neither header nor settings name one
    is_in_header: bool  # whether a header names the version; False: it follows from settings
    lines: tuple[FirmwareLine, ...]
    entries: tuple[TranslatedLine, ...]
    reversed: FirmwareLine | None = None  # the line that says whether the propellers are reversed
    defaults: tuple[str, ...] = ()  # settings that the text's version has by default, not this one
    problems: tuple[str, ...] = ()  # one line each

    def of_kind(self, kind: Treatment) -> list[TranslatedLine]:
        """Return the entries of a kind."""
        return [entry for entry in self.entries if entry.kind is kind]

    @property
    def changes_something(self) -> bool:
        """Whether a line that decides a flight is not taken as it is."""
        return any(entry.kind not in (Treatment.TAKEN, Treatment.BOARD) for entry in self.entries)

    def summary(self) -> str:
        """Return one line: the version, and the number of lines of each kind."""
        counts = Counter(entry.kind for entry in self.entries)
        taken = counts[Treatment.TAKEN]
        parts = [f"{taken} line{'s' * (taken != 1)} taken"]
        parts += [f"{counts[kind]} {kind.value}" for kind in list(Treatment)[1:] if counts[kind]]
        return f"{Path(self.name).name}, {self.written_by}: " + ", ".join(parts)

    @property
    def written_by(self) -> str:
        """The version of the text in words."""
        if self.version is None:
            return f"which names no version, read as Betaflight {FIRMWARE_VERSION}"
        if not self.is_in_header:
            return f"which names no version, by its settings of Betaflight {_dotted(self.version)}"
        return f"of Betaflight {_dotted(self.version)}"

    def report(self) -> list[str]:
        """Return one line for each line of the file that is not taken as it is.

        Lines of the board and of profiles that are not flown are counted at the end.
        """
        shown = []
        if self.defaults:
            shown.append(f"defaults of its version: {', '.join(self.defaults)}")
        for entry in self.entries:
            if entry.kind in (Treatment.TAKEN, Treatment.BOARD, Treatment.PROFILE):
                continue
            became = f" -> {', '.join(entry.became)}" if entry.became else ""
            note = f" ({entry.note})" if entry.note else ""
            words = "" if entry.kind is Treatment.TRANSLATED else f": {entry.kind.value}"
            shown.append(f"{entry.line.number}: {_short(entry.line.text)}{became}{words}{note}")
        for kind in (Treatment.PROFILE, Treatment.BOARD):
            count = len(self.of_kind(kind))
            if count:
                shown.append(f"{count} line{'s' * (count > 1)} {kind.value}: left out")
        return shown

    def as_json(self) -> dict[str, Any]:
        """Return the version, and the kind, number, text and replacement of each line."""
        lines = [
            {
                "line": entry.line.number,
                "text": entry.line.text,
                "kind": entry.kind.name.lower(),
                "became": list(entry.became),
                "note": entry.note,
            }
            for entry in self.entries
        ]
        version = _dotted(self.version) if self.version else None
        defaults = list(self.defaults)
        return {"name": self.name, "version": version, "defaults": defaults, "lines": lines}


class ConfigurationError(FileError):
    """A configuration cannot be flown; the message has one line for each problem."""


def in_this_version(text: Text) -> Text:
    """Return the text with the names and values of the version that is simulated.

    A text of this version is returned unchanged. Of another text, the lines that affect a flight
    are returned, under a header.

    Raises ConfigurationError.
    """
    found = translated(text)
    if found.version in (None, THIS) and not found.of_kind(Treatment.TRANSLATED):
        return text
    header = f"# Betaflight {FIRMWARE_VERSION}, translated from a text {found.written_by}"
    return Text(text.name, (header, *(line.text for line in found.lines)))


def version_of(text: Text) -> Version | None:
    """Return the version that a comment of the text names, None if none does.

    A preset for several versions means the same in each: the latest of them counts.
    """
    for line in text.lines:
        said = SAID.match(line.strip())
        if said:
            return int(said[1]), int(said[2])
    preset = [FOR_VERSION.match(line.strip()) for line in text.lines]
    return max([(int(each[1]), int(each[2])) for each in preset if each], default=None)


def translated(text: Text) -> Translation:
    """Return a text with the names and values of the version that is simulated.

    Raises:
        ConfigurationError: lines that decide the airframe or the switches do not fit, or a line
            cannot be read.
    """
    found = sorted_lines(text)
    if found.problems:
        raise ConfigurationError("\n".join(found.problems))
    return found


@lru_cache(maxsize=64)
def sorted_lines(text: Text) -> Translation:
    """Return a text as `translated` does, with its problems in place of an error."""
    return _Reader(text).read()


# ---- names and numbers that changed ----


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


# Old name -> name of 4.6, where the number has the same meaning
RENAMED = {
    "dshot_idle_value": "motor_idle",  # to 4.5
    "simplified_dmax_gain": "simplified_d_max_gain",
    # to 4.2
    "gyro_lowpass_type": "gyro_lpf1_type",
    "gyro_lowpass_hz": "gyro_lpf1_static_hz",
    "gyro_lowpass2_type": "gyro_lpf2_type",
    "gyro_lowpass2_hz": "gyro_lpf2_static_hz",
    "dyn_lpf_gyro_min_hz": "gyro_lpf1_dyn_min_hz",
    "dyn_lpf_gyro_max_hz": "gyro_lpf1_dyn_max_hz",
    "dterm_lowpass_type": "dterm_lpf1_type",
    "dterm_lowpass_hz": "dterm_lpf1_static_hz",
    "dterm_lowpass2_type": "dterm_lpf2_type",
    "dterm_lowpass2_hz": "dterm_lpf2_static_hz",
    "dyn_lpf_dterm_min_hz": "dterm_lpf1_dyn_min_hz",
    "dyn_lpf_dterm_max_hz": "dterm_lpf1_dyn_max_hz",
    "dyn_lpf_dterm_curve_expo": "dterm_lpf1_dyn_expo",
    "d_min_boost_gain": "d_max_gain",
    "d_min_advance": "d_max_advance",
    "ff_boost": "feedforward_boost",
    "ff_max_rate_limit": "feedforward_max_rate_limit",
}
# Settings of flight in older versions without an equal in 4.6, and why
NOT_EXACT = {
    "anti_gravity_mode": "anti-gravity is another one since 4.4",
    "anti_gravity_threshold": "anti-gravity is another one since 4.4",
    "iterm_limit": "iterm_windup, a share of pidsum_limit, limits the integral since 4.5",
    "ff_interpolate_sp": "feed-forward is another one since 4.3",
    "ff_spike_limit": "feed-forward is another one since 4.3",
    "ff_smooth_factor": "feed-forward is another one since 4.3",
    "rc_interp": "smoothing of the sticks is another one since 4.3",
    "rc_interp_ch": "smoothing of the sticks is another one since 4.3",
    "rc_interp_int": "smoothing of the sticks is another one since 4.3",
    "rc_smoothing_type": "smoothing of the sticks is another one since 4.3",
    "rc_smoothing_input_hz": "smoothing of the sticks is another one since 4.3",
    "rc_smoothing_input_type": "smoothing of the sticks is another one since 4.3",
    "rc_smoothing_derivative_hz": "smoothing of the sticks is another one since 4.3",
    "rc_smoothing_derivative_type": "smoothing of the sticks is another one since 4.3",
    "rc_smoothing_auto_smoothness": "smoothing of the sticks is another one since 4.3",
}
# Settings of both, whose number means something else up to this version
OTHER_MEANING: dict[str, tuple[Version, str]] = {
    "anti_gravity_gain": ((4, 3), "anti-gravity is another one since 4.4"),
    "iterm_windup": ((4, 4), "it is a share of another limit since 4.5"),
}
# Filters that follow motors and their noise, and what follows the battery
NOT_SIMULATED = {
    "dyn_idle_min_rpm dyn_idle_p_gain dyn_idle_i_gain dyn_idle_d_gain dyn_idle_max_increase"
    " dyn_idle_start_increase idle_min_rpm idle_adjustment_speed idle_p idle_pid_limit"
    " idle_max_increase": "dynamic idle needs rotor speeds",
    "rpm_filter_harmonics rpm_filter_weights rpm_filter_q rpm_filter_min_hz"
    " rpm_filter_fade_range_hz rpm_filter_lpf_hz gyro_rpm_notch_harmonics gyro_rpm_notch_q"
    " gyro_rpm_notch_min dterm_rpm_notch_harmonics dterm_rpm_notch_q dterm_rpm_notch_min"
    " rpm_notch_lpf": "the motors do not vibrate",
    "dyn_notch_count dyn_notch_q dyn_notch_min_hz dyn_notch_max_hz dyn_notch_range"
    " dyn_notch_width_percent": "the motors do not vibrate",
    "rpm_limit rpm_limit_p rpm_limit_i rpm_limit_d rpm_limit_value": "it needs rotor speeds",
    "vbat_sag_compensation vbat_pid_gain": "the battery does not sag",
    "min_throttle max_throttle min_command": "they are ends of an analog protocol",
    "gyro_hardware_lpf": "the simulated gyro has no filter of its own",
}
WITHOUT_SIMULATION = {name: why for names, why in NOT_SIMULATED.items() for name in names.split()}
# Settings by which a text without a header is of an older version
ONLY_TO_4_5 = _words("dshot_idle_value simplified_dmax_gain min_throttle") | {
    f"d_min_{axis}" for axis in AXES
}
LATER_THAN_4_2 = {"anti_gravity_mode", "anti_gravity_threshold", "iterm_limit"}
ONLY_TO_4_2 = {*RENAMED, *NOT_EXACT} - ONLY_TO_4_5 - LATER_THAN_4_2
# Up to 4.3 a profile of rates has these, since then a profile of gains
MOVED = ("tpa_rate", "tpa_breakpoint", "tpa_mode")
MOVED_AFTER: Version = (4, 3)
# The settings of a profile of rates
RATES = _words(
    "thr_mid thr_expo thr_hover rates_type quickrates_rc_expo throttle_limit_type"
    " throttle_limit_percent"
) | {f"{axis}_{of}" for axis in AXES for of in ("rc_rate", "srate", "expo", "rate_limit")}
# Up to 4.5 d is the greatest D, and d_min the one at rest; since then d and d_max
GREATEST_D_TO: Version = (4, 5)


class D(NamedTuple):
    """The D of an axis up to 4.5."""

    greatest: int
    least: int  # at rest; 0: always the greatest


# {axis: D} by default
D_OF_4_3: dict[str, D] = dict(zip(AXES, (D(40, 30), D(46, 34), D(0, 0)), strict=True))
D_OF_4_2: dict[str, D] = dict(zip(AXES, (D(35, 23), D(38, 25), D(0, 0)), strict=True))
RATES_OF_4_2 = "rates_type = BETAFLIGHT"
# Defaults that differ from those of 4.6, up to a version
DEFAULTS: tuple[tuple[Version, tuple[str, ...]], ...] = (
    ((4, 5), ("feedforward_yaw_hold_gain = 0",)),
    ((4, 4), ("tpa_low_rate = 0",)),
    (
        (4, 2),
        (
            *("p_roll = 42", "i_roll = 85", "f_roll = 90"),
            *("p_pitch = 46", "i_pitch = 90", "f_pitch = 95"),
            *("p_yaw = 45", "i_yaw = 90", "f_yaw = 90"),
            *("d_roll = 23", "d_max_roll = 35", "d_pitch = 25", "d_max_pitch = 38"),
            *("gyro_lpf1_static_hz = 200", "gyro_lpf2_static_hz = 250"),
            *("gyro_lpf1_dyn_min_hz = 200", "gyro_lpf1_dyn_max_hz = 500"),
            *("dterm_lpf1_static_hz = 150", "dterm_lpf2_static_hz = 150"),
            *("dterm_lpf1_dyn_min_hz = 70", "dterm_lpf1_dyn_max_hz = 170"),
            *("yaw_lowpass_hz = 0", "feedforward_max_rate_limit = 100"),
            RATES_OF_4_2,
            *(f"{axis}_rc_rate = 100" for axis in AXES),
            *(f"{axis}_srate = 70" for axis in AXES),
        ),
    ),
)

# ---- commands ----

# Lines that have no meaning without the board: pins, ports, screens and transmitters
COMMANDS_OF_BOARDS = _words(
    "resource timer dma serial serialpassthrough gpspassthrough beeper beacon led color mode_color"
    " vtx vtx_info vtxtable osd board_name manufacturer_id mcu_id signature rxfail rxrange map"
    " batch save exit defaults servo smix transponder name"
    # They ask or do something, and set nothing
    " bl bind_rx msc motor dshotprog dshot_telemetry_info escprog flash_erase flash_info flash_read"
    " flash_scan flash_write sd_info gyroregisters play_sound rc_smoothing_info status tasks"
    " version dump diff get help"
)
FLIGHT_FEATURES = ("AIRMODE", "ANTI_GRAVITY", "MOTOR_STOP")
FEATURES_OF_BOARDS = _words(
    "RX_PPM INFLIGHT_ACC_CAL RX_SERIAL SERVO_TILT SOFTSERIAL GPS OPTICALFLOW RANGEFINDER SONAR"
    " TELEMETRY RX_PARALLEL_PWM RX_MSP RSSI_ADC LED_STRIP DISPLAY OSD CHANNEL_FORWARDING"
    " TRANSPONDER RX_SPI ESC_SENSOR DYNAMIC_FILTER"
)
# Signs of roll, pitch and yaw in the mixer of the motors 1 to 4 of an X
X_MIXER = ((-1, 1, -1), (-1, -1, 1), (1, 1, 1), (1, -1, -1))


@cache
def board_settings() -> frozenset[str]:
    """Return the settings of boards and transmitters, and of modes without a part in flights."""
    return frozenset(BOARD_SETTINGS.read_text().split())


class Profiles(NamedTuple):
    """Numbers of the selected profiles."""

    gains: int = 0
    rates: int = 0


class _Reader:
    """Sorts the lines of a text."""

    def __init__(self, text: Text):
        self._text = text
        self._is_said = version_of(text) is not None
        self._lines: list[FirmwareLine] = []
        self._entries: list[TranslatedLine] = []
        self._problems: list[str] = []
        self._numbered = list(_commands(text))
        self._version = version_of(text) or _latest_version(self._numbered)
        self._old_d = self._version is not None and self._version <= GREATEST_D_TO
        self._at = Profiles()
        self._flown = self._selected()
        self._d = self._d_of_profiles()
        self._moved: list[FirmwareLine] = []
        self._mixer: FirmwareLine | None = None
        self._mixes: list[FirmwareLine] = []
        self._reversed: FirmwareLine | None = None
        self._defaults: tuple[str, ...] = ()

    def read(self) -> Translation:
        """Return the translation."""
        start = self._start()
        for line in self._numbered[:start]:
            of_board = line.text.lower().split()[0] in COMMANDS_OF_BOARDS
            self._leave(line, Treatment.BOARD if of_board else Treatment.TAKEN_BACK)
        self._add_defaults(whole=start > 0)
        for line in self._numbered[start:]:
            if self._is_readable(line):
                self._sort(line)
        self._lines += self._moved
        self._check_mixer()
        return Translation(
            self._text.name,
            self._version,
            self._is_said,
            lines=tuple(self._lines),
            entries=tuple(self._entries),
            reversed=self._reversed,
            defaults=self._defaults,
            problems=tuple(self._problems),
        )

    # ---- the text as a whole ----

    def _start(self) -> int:
        """Return the number of lines up to the last that sets everything to its default."""
        words = [line.text.lower().split()[0] for line in self._numbered]
        return len(words) - words[::-1].index("defaults") if "defaults" in words else 0

    def _selected(self) -> Profiles:
        """Return the profiles that the text selects last."""
        at = Profiles()
        for line in self._numbered[self._start() :]:
            at = _next_profiles(at, line.text)
        return at

    def _d_of_profiles(self) -> dict[tuple[int, str], D]:
        """Return {(profile, axis): D} of a text with the meaning of D up to 4.5."""
        defaults = D_OF_4_2 if self._version and self._version <= OLDEST else D_OF_4_3
        found: dict[tuple[int, str], D] = {}
        at = Profiles()
        for line in self._numbered[self._start() :]:
            at = _next_profiles(at, line.text)
            setting = re.fullmatch(
                r"set\s+d_(min_)?(roll|pitch|yaw)\s*=\s*(\d{1,3})", line.text, re.IGNORECASE
            )
            if self._old_d and setting:
                axis, number = setting[2].lower(), int(setting[3])
                before = found.get((at.gains, axis), defaults[axis])
                changed = {"least" if setting[1] else "greatest": number}
                found[at.gains, axis] = before._replace(**changed)
        return found

    def _add_defaults(self, whole: bool) -> None:
        """Set the defaults of the text's version, from which a `diff all` counts.

        whole: whether the text sets everything to its default. One that does not only needs the
        default by which its own rates are meant.
        """
        version = self._version
        if whole:
            self._defaults = tuple(
                setting
                for last, settings in DEFAULTS
                if version and version <= last
                for setting in settings
            )
        elif version and version <= OLDEST:
            names = {name for line in self._numbered if (name := _name(line.text))}
            rates = {name for name in names if name.endswith(("_rc_rate", "_srate"))}
            if rates and "rates_type" not in names:
                self._defaults = (RATES_OF_4_2,)
        if self._defaults:
            gains, rates = self._flown.gains, self._kept_rates(self._flown.rates)
            chosen = (f"profile {gains}", f"rateprofile {rates}")
            lines = [f"set {setting}" for setting in self._defaults]
            self._lines += map(FirmwareLine, (*chosen, *lines, "profile 0", "rateprofile 0"))

    def _kept_rates(self, profile: int) -> int:
        """Return where a profile of rates is kept: older versions have more of them."""
        return min(profile, PROFILES - 1)

    # ---- one line ----

    def _is_readable(self, line: FirmwareLine) -> bool:
        """Check the characters of a line that the firmware would read."""
        word = line.text.lower().split()[0]
        if word in COMMANDS_OF_BOARDS or (_name(line.text) or "") in board_settings():
            return True
        if UNREADABLE.search(line.text):
            return self._refuse(line, "letters, digits and signs", "the firmware drops others")
        if len(line.text) > LONGEST_LINE:
            return self._refuse(line, f"at most {LONGEST_LINE} characters", "it is longer")
        return True

    def _sort(self, line: FirmwareLine) -> None:
        """Take, translate or leave out a line."""
        word = line.text.lower().split()[0]
        commands: dict[str, Callable[[FirmwareLine], object]] = {
            "set": self._setting,
            "aux": self._switch,
            "mixer": self._mixer_line,
            "mmix": self._mixes.append,
            "feature": self._feature,
            "profile": self._profile,
            "rateprofile": self._profile,
        }
        if word in commands:
            commands[word](line)
        elif word in COMMANDS_OF_BOARDS:
            self._leave(line, Treatment.BOARD)
        elif word == "adjrange":
            self._leave(line, Treatment.NOT_SIMULATED, "the profiles that are selected last fly")
        elif self._is_flown(line):
            self._take(line)

    def _setting(self, line: FirmwareLine) -> None:
        setting = SET.fullmatch(line.text)
        if setting is None:
            self._refuse(line, "'set NAME = VALUE'", "without it nothing is set")
            return
        name, value = setting[1].lower(), setting[2]
        if name == "yaw_motors_reversed":
            self._reversed = line
            self._entries.append(TranslatedLine(Treatment.TAKEN, line))
        elif name == "auto_profile_cell_count" and value.strip() not in ("0", "-1"):
            note = "the profile that is selected last flies, whatever the cells of the battery"
            self._leave(line, Treatment.NOT_SIMULATED, note)
        elif name == "motor_output_reordering":
            self._motor_order(line, value)
        elif name in board_settings():
            self._leave(line, Treatment.BOARD)
        elif name in WITHOUT_SIMULATION:
            self._leave(line, Treatment.NOT_SIMULATED, WITHOUT_SIMULATION[name])
        elif name == "failsafe_procedure" and value.upper() == "GPS-RESCUE":
            self._leave(line, Treatment.NOT_SIMULATED, "there is no GPS")
        elif self._has_other_meaning(name):
            note = NOT_EXACT.get(name) or OTHER_MEANING[name][1]
            self._leave(line, Treatment.NOT_EXACT, note)
        elif self._is_flown(line):
            self._flight_setting(line, name, value)

    def _flight_setting(self, line: FirmwareLine, name: str, value: str) -> None:
        """Take or translate a setting of a profile that is flown, or of no profile."""
        of_d = re.fullmatch(r"d_(min_)?(roll|pitch|yaw)", name)
        if name in RENAMED:
            self._translate(line, (f"set {RENAMED[name]} = {value}",))
        elif self._old_d and of_d and re.fullmatch(r"\d{1,3}", value):
            axis = of_d[2]
            self._translate(line, _lines_of_d(axis, self._d[self._at.gains, axis]))
        elif name in MOVED and self._version and self._version <= MOVED_AFTER:
            if self._at.rates == self._flown.rates:
                self._moved.append(line)
                note = "it belongs to the profile of gains since 4.4"
                self._entries.append(TranslatedLine(Treatment.TRANSLATED, line, (line.text,), note))
            else:
                self._leave(line, Treatment.PROFILE)
        else:
            self._take(line)

    def _has_other_meaning(self, name: str) -> bool:
        """Return whether a setting of flight has no equal in the version that is simulated."""
        if name in OTHER_MEANING:
            return self._version is not None and self._version <= OTHER_MEANING[name][0]
        return name in NOT_EXACT

    def _profile(self, line: FirmwareLine) -> None:
        """Select a profile; older versions have more profiles of rates."""
        at = _next_profiles(self._at, line.text)
        self._at = at
        if line.text.lower().startswith("rateprofile") and at.rates >= PROFILES:
            kept = self._kept_rates(at.rates)
            if at.rates == self._flown.rates and at.rates < 6:
                self._translate(line, (f"rateprofile {kept}",))
            elif at.rates < 6:
                self._leave(line, Treatment.PROFILE)
            else:
                self._take(line)  # the firmware refuses it
        else:
            self._take(line)

    def _is_flown(self, line: FirmwareLine) -> bool:
        """Return whether the profile of a setting of rates exists here; leave it out if not."""
        if (_name(line.text) or "") not in RATES:
            return True
        hidden = self._flown.rates >= PROFILES and self._at.rates == PROFILES - 1
        missing = PROFILES <= self._at.rates < 6 and self._at.rates != self._flown.rates
        if hidden or missing:
            self._leave(line, Treatment.PROFILE)
            return False
        return True

    # ---- the airframe ----

    def _motor_order(self, line: FirmwareLine, value: str) -> None:
        """Leave out the order in which a board's outputs are wired to the motors."""
        order = [word.strip() for word in value.split(",")][:4]
        if sorted(order) == ["0", "1", "2", "3"]:
            self._leave(line, Treatment.BOARD)
        else:
            why = "the vehicle has four motors"
            self._refuse(line, "an order of the motors 0, 1, 2 and 3", why)

    def _mixer_line(self, line: FirmwareLine) -> None:
        name = line.text.lower().split()[1:]
        if name and name[0] != "list":
            self._mixer = line
        else:
            self._leave(line, Treatment.BOARD)

    def _check_mixer(self) -> None:
        """Check that the mixer fits the vehicle, four rotors in an X."""
        why = "the vehicle has four rotors in an X"
        kind = self._mixer.text.split()[1].upper() if self._mixer else "QUADX"
        if self._mixer and kind == "QUADX":
            self._take(self._mixer)
        elif self._mixer and kind == "QUADX_1234":
            note = "the same X, whose motors have other numbers on the board"
            self._translate(self._mixer, ("mixer QUADX",), note)
        elif self._mixer and kind not in ("QUADX", "CUSTOM"):
            self._refuse(self._mixer, "the mixer QUADX", why)
        if kind != "CUSTOM":
            for line in self._mixes:
                self._leave(line, Treatment.BOARD)
            return
        assert self._mixer
        self._take(self._mixer)
        for line in self._mixes:
            self._take(line)
        found = _motor_mixes(self._mixes)
        if found is None or not _is_x(found):
            signs = "four mmix lines with the signs of QUADX"
            self._refuse(self._mixer, signs, why)

    def _feature(self, line: FirmwareLine) -> None:
        words = line.text.upper().split()[1:]
        name = words[0].removeprefix("-") if words else ""
        if name == "3D":
            if words[0] == "3D":
                why = "the vehicle's rotors turn one way"
                self._refuse(line, "no feature 3D", why)
            else:
                self._take(line)
        elif not words or name in FEATURES_OF_BOARDS:
            self._leave(line, Treatment.BOARD)
        elif name in FLIGHT_FEATURES:
            self._take(line)
        else:
            known = ", ".join((*FLIGHT_FEATURES, "3D"))
            self._refuse(line, f"a feature of Betaflight ({known} or one of the board)", "no such")

    # ---- switches ----

    def _switch(self, line: FirmwareLine) -> None:
        numbers = line.text.split()[1:]
        if not numbers:
            self._leave(line, Treatment.BOARD)
            return
        are_numbers = all(re.fullmatch(r"\d{1,4}", number) for number in numbers)
        if not are_numbers or not 5 <= len(numbers) <= 7:
            why = "5 to 7 numbers" if are_numbers else "numbers only"
            self._refuse(line, "'aux INDEX MODE CHANNEL LOW HIGH LOGIC LINKED'", why)
            return
        whole = (*numbers, "0", "0")[:7]
        index, mode, channel, low, high, logic, linked = map(int, whole)
        if index >= MODES:
            self._refuse(line, f"an index from 0 to {MODES - 1}", f"it is {index}")
        elif mode > max(MODE_NUMBERS) and not linked:
            self._leave(line, Treatment.NOT_SIMULATED, "the mode is one of a later version")
        elif mode not in MODE_NUMBERS or linked not in MODE_NUMBERS:
            wanted = f"numbers of modes of Betaflight {_dotted(OLDEST)} to {_dotted(THIS)}"
            self._refuse(line, wanted, "there is no such mode")
        elif logic > 1:
            self._refuse(line, "0 (or) or 1 (and) as the logic", f"it is {logic}")
        elif mode in LOG_MODES:
            self._leave(line, Treatment.BOARD)
        elif channel >= AUX_CHANNELS and low < high:
            wanted = f"AUX1 to AUX{AUX_CHANNELS} (0 to {AUX_CHANNELS - 1}), as the link has"
            self._refuse(line, wanted, f"it is AUX{channel + 1}")
        elif channel >= AUX_CHANNELS:
            self._leave(line, Treatment.BOARD)
        elif len(numbers) < len(whole):
            # The firmware expects all seven.
            note = "without LOGIC and LINKED, which are 0"
            self._translate(line, (f"aux {' '.join(whole)}",), note)
        else:
            self._take(line)

    # ---- results ----

    def _take(self, line: FirmwareLine) -> None:
        self._lines.append(line)
        self._entries.append(TranslatedLine(Treatment.TAKEN, line))

    def _translate(self, line: FirmwareLine, became: tuple[str, ...], note: str = "") -> None:
        self._lines += [FirmwareLine(text, line.number) for text in became]
        self._entries.append(TranslatedLine(Treatment.TRANSLATED, line, became, note))

    def _leave(self, line: FirmwareLine, kind: Treatment, note: str = "") -> None:
        self._entries.append(TranslatedLine(kind, line, note=note))

    def _refuse(self, line: FirmwareLine, wanted: str, why: str) -> bool:
        """Note a problem; return False."""
        place = f"{self._text.name}:{line.number}"
        got = f"got '{_short(line.text)}': {why}: correct or remove it"
        self._problems.append(f"{place}: expected {wanted}, {got}")
        return False


def _commands(text: Text) -> Iterator[FirmwareLine]:
    """Yield the lines of a text that are neither empty nor comments."""
    for number, line in enumerate(text.lines, 1):
        # The firmware, too, takes the rest of a line after # as a comment.
        command = line.partition("#")[0].replace("\t", " ").strip().strip("\ufeff").strip()
        if command:
            yield FirmwareLine(command, number)


def _name(line: str) -> str | None:
    """Return the setting that a line sets, None if it is no such line."""
    setting = SET.fullmatch(line)
    return setting[1].lower() if setting else None


def _latest_version(lines: Sequence[FirmwareLine]) -> Version | None:
    """Return the latest older version that has all settings of a text, None if this one has."""
    names = {name for line in lines if (name := _name(line.text))}
    if names & ONLY_TO_4_2:
        return (4, 2)
    return (4, 5) if names & ONLY_TO_4_5 else None


def _next_profiles(at: Profiles, line: str) -> Profiles:
    """Return the selected profiles after a line."""
    chosen = re.fullmatch(r"(rate)?profile\s+(\d{1,3})\b.*", line, re.IGNORECASE)
    if chosen is None:
        return at
    number = int(chosen[2])
    return at._replace(rates=number) if chosen[1] else at._replace(gains=number)


def _lines_of_d(axis: str, d: D) -> tuple[str, str]:
    """Return the lines of 4.6 for the D of an axis up to 4.5."""
    # d_min counts only between 0 and d.
    moves = 0 < d.least < d.greatest
    rest, greatest = (d.least, d.greatest) if moves else (d.greatest, 0)
    return f"set d_{axis} = {rest}", f"set d_max_{axis} = {greatest}"


def _motor_mixes(lines: Sequence[FirmwareLine]) -> dict[int, list[float]] | None:
    """Return {motor: throttle, roll, pitch, yaw} of the lines mmix, None if one cannot be read."""
    found: dict[int, list[float]] = {}
    for line in lines:
        words = line.text.split()[1:]
        if not words:
            continue
        if words[0].lower() == "reset":
            found.clear()
            continue
        try:
            motor, numbers = int(words[0]), [float(word) for word in words[1:]]
        except ValueError:
            return None
        if len(numbers) != 4:
            return None
        found[motor] = numbers
    return found


def _is_x(mixes: dict[int, list[float]]) -> bool:
    """Return whether four motors turn the vehicle as the motors of an X do."""
    if sorted(mixes) != [0, 1, 2, 3]:
        return False
    return all(
        mixes[motor][0] == 1.0
        and all(
            0.1 <= sign * number <= 1.5
            for sign, number in zip(X_MIXER[motor], mixes[motor][1:], strict=True)
        )
        for motor in range(4)
    )


def _short(line: str) -> str:
    """Return a line for a message: what cannot be printed is escaped."""
    shown = line.encode("unicode_escape").decode() if UNREADABLE.search(line) else line
    return shown if len(shown) <= SHOWN else shown[: SHOWN - 4] + " ..."


def _dotted(version: Version) -> str:
    return ".".join(map(str, version))
