"""A text of any version from 4.2 on says the same in the words of the version that is simulated."""

import os
from itertools import combinations
from pathlib import Path

import pytest

from quadsim.files.strict_yaml import FileError
from quadsim.firmware.text import Text, read_text
from quadsim.firmware.translation import (
    NOT_EXACT,
    RENAMED,
    WITHOUT_SIMULATION,
    ConfigurationError,
    Treatment,
    board_settings,
    in_this_version,
    translated,
    version_of,
)
from quadsim.vehicle import VEHICLES

ARM = "aux 0 0 0 1700 2100 0 0"
HEADER = "# Betaflight / STM32F7X2 (S7X2) {} Apr 28 2024 / 06:56:11 (c155f5830) MSP API: 1.46"


def text(*lines, version=None):
    """Return a text, with the header of a version."""
    header = (HEADER.format(version),) if version else ()
    return Text("mine.txt", (*header, ARM, *lines))


def carried_out(*lines, version=None):
    """Return the lines that the firmware gets, without the switch."""
    found = [line.text for line in translated(text(*lines, version=version)).lines]
    return [line for line in found if line != ARM]


@pytest.mark.parametrize(
    ("line", "version"),
    [
        (HEADER.format("4.5.0"), (4, 5)),
        ("# Betaflight / SPEEDYBEEF405V3 (SBF4) 4.3.2 Apr  7 2023 / 03:15:27 (f156481e9)", (4, 3)),
        ("# # Betaflight / STM32F405 (S405) 4.5.1", (4, 5)),
        ("# Betaflight 4.6.0, for the vehicle swift. This text can be pasted", (4, 6)),
        ("# Betaflight / STM32F405 (S405) 2025.12.1 Nov  1 2025", (2025, 12)),
        ("# my best Betaflight tune, 1.2", None),
        ("set name = Betaflight 4.5.0", None),
    ],
)
def test_the_version_is_that_of_the_header(line, version):
    found = translated(Text("x", (line, ARM)))
    assert (found.version, found.is_in_header) == (version, version is not None)


@pytest.mark.parametrize(("old", "new"), list(RENAMED.items()))
def test_a_setting_with_another_name_is_translated_whatever_the_header_says(old, new):
    for version in (None, "4.2.0", "4.5.0"):
        assert carried_out(f"set {old} = 7", version=version) == [f"set {new} = 7"]


@pytest.mark.parametrize(
    ("version", "lines", "expected"),
    [
        # d is the greatest D up to 4.5, d_min the one at rest
        ("4.5.0", ["set d_roll = 60"], ["set d_roll = 30", "set d_max_roll = 60"]),
        ("4.3.2", ["set d_min_pitch = 40"], ["set d_pitch = 40", "set d_max_pitch = 46"]),
        ("4.2.0", ["set d_min_pitch = 20"], ["set d_pitch = 20", "set d_max_pitch = 38"]),
        # d_min counts only between 0 and d
        ("4.5.0", ["set d_roll = 25"], ["set d_roll = 25", "set d_max_roll = 0"]),
        ("4.5.0", ["set d_min_roll = 0"], ["set d_roll = 40", "set d_max_roll = 0"]),
        ("4.5.0", ["set D_Yaw=5"], ["set d_yaw = 5", "set d_max_yaw = 0"]),
        # 4.6, and a text that names no version
        ("4.6.0", ["set d_roll = 60"], ["set d_roll = 60"]),
        (None, ["set d_roll = 60"], ["set d_roll = 60"]),
        # d_min is in no later version
        (None, ["set d_min_roll = 0"], ["set d_roll = 40", "set d_max_roll = 0"]),
    ],
)
def test_the_greatest_d_of_a_text_stays_the_greatest(version, lines, expected):
    assert carried_out(*lines, version=version) == expected


def test_a_text_without_a_header_is_of_the_version_of_its_settings():
    """Pilots post parts of a text."""
    lines = ("set dyn_lpf_gyro_min_hz = 240", "set d_roll = 54", "set anti_gravity_gain = 3900")
    found = translated(text(*lines))
    assert "which names no version, by its settings of Betaflight 4.2" in found.summary()
    flown = [line.text for line in found.lines][1:]
    assert flown == ["set gyro_lpf1_dyn_min_hz = 240", "set d_roll = 23", "set d_max_roll = 54"]


def test_each_profile_has_its_own_d():
    lines = ("set d_roll = 50", "profile 1", "set d_roll = 60", "set d_min_roll = 0", "profile 0")
    found = carried_out(*lines, version="4.4.0")
    second = found.index("profile 1")
    assert found[:second] == ["set d_roll = 30", "set d_max_roll = 50"]
    assert set(found[second + 1 : -1]) == {"set d_roll = 60", "set d_max_roll = 0"}


def test_the_profile_of_rates_that_is_selected_last_flies():
    """Up to 4.3 there are six, with tpa in them; now there are four, without."""
    old = ("rateprofile 3", "set roll_srate = 1", "set tpa_rate = 11")
    chosen = ("rateprofile 5", "set roll_srate = 2", "set tpa_rate = 12")
    found = carried_out(
        *old, *chosen, "rateprofile 4", "set roll_srate = 3", "rateprofile 5", version="4.3.2"
    )
    assert "set roll_srate = 2" in found
    assert not {"set roll_srate = 1", "set roll_srate = 3", "set tpa_rate = 11"} & set(found)
    assert found[-1] == "set tpa_rate = 12"
    assert "rateprofile 5" not in found


def test_defaults_are_those_of_the_version_of_the_text():
    """A `diff all` counts from them."""
    found = carried_out("defaults nosave", "set p_roll = 50", version="4.2.0")
    assert found.index("set p_roll = 42") < found.index("set p_roll = 50")
    assert "set rates_type = BETAFLIGHT" in found
    newer = carried_out("defaults nosave", version="4.5.0")
    assert newer == [
        "profile 0",
        "rateprofile 0",
        "set feedforward_yaw_hold_gain = 0",
        "profile 0",
        "rateprofile 0",
    ]
    assert carried_out("defaults nosave", version="4.6.0") == []
    # Two lines of an older version are no `diff all`.
    assert carried_out("set p_roll = 50", version="4.2.0") == ["set p_roll = 50"]


def test_rates_of_a_part_of_a_text_are_meant_as_its_version_means_them():
    line = "set roll_srate = 72"
    assert "set rates_type = BETAFLIGHT" in carried_out(line, version="4.2.0")
    assert carried_out(line, "set rates_type = ACTUAL", version="4.2.0") == [
        line,
        "set rates_type = ACTUAL",
    ]
    assert carried_out(line, version="4.3.0") == [line]


def test_what_a_later_defaults_takes_back_does_not_fly():
    found = translated(Text("x", ("set p_roll = 99", "defaults nosave", ARM)))
    assert [line.text for line in found.lines] == [ARM]
    assert [entry.line.number for entry in found.of_kind(Treatment.TAKEN_BACK)] == [1]


@pytest.mark.parametrize("name", [*NOT_EXACT, *WITHOUT_SIMULATION])
def test_a_setting_without_an_equal_is_named(name):
    found = translated(text(f"set {name} = 1", version="4.2.0"))
    assert [line.text for line in found.lines] == [ARM]
    assert any(f"2: set {name} = 1" in line for line in found.report()) or any(
        f"3: set {name} = 1" in line for line in found.report()
    )


def test_a_number_that_means_something_else_is_left_out_in_that_version_only():
    line = "set anti_gravity_gain = 3500"
    assert carried_out(line, version="4.3.2") == []
    assert carried_out("set anti_gravity_gain = 90", version="4.5.0") == [
        "set anti_gravity_gain = 90"
    ]


@pytest.mark.parametrize(
    "line",
    [
        "set dshot_idle_valu = nonsense",
        "set vbat_x = 3",
        "set motor_pwm_rubbish = 1",
        "set osd_rubbish = 1",
        "set gps_ = 1",
        "set P_Rol = 45",
        "warp 9",
    ],
)
def test_what_no_version_knows_is_left_to_the_firmware_which_refuses_it(line):
    assert carried_out(line, version="4.3.2") == [line]


def test_kinds_of_settings_do_not_overlap():
    kinds = (set(RENAMED), set(NOT_EXACT), set(WITHOUT_SIMULATION), set(board_settings()))
    for one, other in combinations(kinds, 2):
        assert not one & other


@pytest.mark.parametrize(
    "line",
    [
        "batch start",
        "resource MOTOR 1 B01",
        "set osd_units = METRIC",
        "set dshot_bidir = ON",
        "set motor_output_reordering = 2,3,0,1,4,5,6,7",  # how the board is wired
        "set debug_mode = GYRO_SCALED",
        "set name = Pilöt 1",
        "feature TELEMETRY",
        "feature -RX_SERIAL",
        "servo 0 1000 2000 1500 100 -1",
        "smix reset",
        "mmix 0 1.000 -1.000 1.000 -1.000",
        "aux 4 26 3 1900 2100 0 0",  # of the log, which is written from arming on
        "rxrange 0 1100 1900",
        "bl",
        "diff all",
        "save",
    ],
)
def test_lines_of_the_board_are_left_out_and_counted(line):
    found = translated(text(line))
    assert [entry.line.text for entry in found.of_kind(Treatment.BOARD)] == [line]
    assert not found.changes_something
    assert found.report() == ["1 line of the board, the transmitter or another mode: left out"]


@pytest.mark.parametrize(
    ("line", "became"),
    [
        ("aux 0 0 0 1700 2100", "aux 0 0 0 1700 2100 0 0"),
        ("aux 0 0 0 1700 2100 1", "aux 0 0 0 1700 2100 1 0"),
        ("mixer QUADX_1234", "mixer QUADX"),
    ],
)
def test_a_line_that_a_board_forgives_is_completed(line, became):
    found = translated(text(line))
    assert became in [each.text for each in found.lines]
    assert [entry.line.text for entry in found.of_kind(Treatment.TRANSLATED)] == [line]


@pytest.mark.parametrize(
    ("line", "note"),
    [
        ("aux 2 56 3 1900 2100 0 0", "the mode is one of a later version"),
        ("set auto_profile_cell_count = 6", "the profile that is selected last flies"),
    ],
)
def test_what_only_a_board_decides_is_named(line, note):
    (entry,) = translated(text(line)).of_kind(Treatment.NOT_SIMULATED)
    assert entry.line.text == line
    assert entry.note.startswith(note)


def test_a_preset_is_of_the_latest_version_that_it_names():
    lines = ("#$ TITLE: Karate", "#$ FIRMWARE_VERSION: 4.2", "#$ FIRMWARE_VERSION: 4.3")
    assert version_of(Text("preset.txt", lines)) == (4, 3)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("mixer AIRPLANE", "expected the mixer QUADX, got 'mixer AIRPLANE'"),
        ("mixer HEX6X", "four rotors in an X"),
        ("mixer CUSTOM", "expected four mmix lines"),
        ("feature 3D", "expected no feature 3D"),
        ("feature AIRMOD", "expected a feature of Betaflight"),
        ("set motor_output_reordering = 1,1,2,3", "expected an order of the motors 0, 1, 2 and 3"),
        ("set motor_output_reordering = 4,5,6,7,0,1,2,3", "the vehicle has four motors"),
        ("set p_roll 45", "expected 'set NAME = VALUE'"),
        ("set p_ro\x0bll = 45", r"got 'set p_ro\x0bll = 45'"),
        ("set p_roll = " + "4" * 300, "at most 255 characters"),
        ("aux 0 0 12 1700 2100 0 0", "expected AUX1 to AUX12"),
        ("aux 1 14 5 1700 2100 0 0", "there is no such mode"),
        ("aux 20 1 5 1700 2100 0 0", "an index from 0 to 19"),
        ("aux 1 1 1 900", "5 to 7 numbers"),
        ("aux 1 1 one 900 1300", "numbers only"),
        ("aux 1 1 1 900 1300 2 0", "0 (or) or 1 (and)"),
    ],
)
def test_a_line_for_another_airframe_or_link_is_one_line(line, said):
    with pytest.raises(ConfigurationError) as caught:
        translated(text(line))
    assert str(caught.value).startswith("mine.txt:2: expected ")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("line", ["mixer QUADX_1234", "aux 1 1 0 900 1300", "set d_min_roll = 30"])
def test_a_text_that_was_translated_is_translated_no_further(line):
    once = in_this_version(text(line, version="4.5.0"))
    assert [each.text for each in translated(once).lines] == [
        each.text for each in translated(text(line, version="4.5.0")).lines
    ]


@pytest.mark.parametrize(
    "lines",
    [
        ("mixer QUADX",),
        ("feature -3D", "set 3d_neutral = 1500"),
        (
            *("mixer CUSTOM", "mmix reset", "mmix 0 1.0 -0.6 1.0 -1.0", "mmix 1 1.0 -1 -1.0 1.0"),
            *("mmix 2 1 0.6 1 1", "mmix 3 1 1 -1 -1"),
        ),
    ],
)
def test_a_line_for_the_same_airframe_is_taken(lines):
    found = translated(text(*lines))
    assert {entry.kind for entry in found.entries} == {Treatment.TAKEN}


def test_all_problems_are_named_at_once():
    with pytest.raises(ConfigurationError) as caught:
        translated(text("mixer BI", "feature 3D", "aux 1 1 1"))
    assert sorted(line.split(":")[1] for line in str(caught.value).splitlines()) == ["2", "3", "4"]


def test_a_text_of_this_version_stays_and_another_one_is_written_anew():
    for path in VEHICLES.glob("*.betaflight.txt"):
        shipped = read_text(path)
        assert in_this_version(shipped) == shipped
    old = in_this_version(text("set d_roll = 60", "set dshot_idle_value = 600", version="4.5.0"))
    again = translated(old)
    assert again.version == (4, 6)
    assert [line.text for line in again.lines] == list(old.lines[1:])
    assert "set motor_idle = 600" in old.lines


@pytest.mark.parametrize(
    "data",
    [
        b"\xef\xbb\xbfset p_roll = 1\r\n# Pil\xc3\xb6t\r\n",
        "set p_roll = 1\n# Pilöt\n".encode("utf-16"),
        b"set p_roll = 1\r# Pil\xf6t\r",
    ],
)
def test_a_text_is_read_in_the_encodings_and_line_ends_that_are_posted(tmp_path, data):
    (tmp_path / "x.txt").write_bytes(data)
    assert read_text(tmp_path / "x.txt").lines == ("set p_roll = 1", "# Pilöt")


def test_a_comment_hides_no_command():
    """Python's own splitlines would end the line at a vertical tab."""
    assert carried_out("# a\x0bset p_roll = 99", "# b\u2028set p_roll = 98") == []


@pytest.mark.parametrize("kind", ["folder", "pipe", "device", "picture"])
def test_what_is_no_file_of_text_is_one_line(tmp_path, kind):
    path = tmp_path / "x.txt"
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path = Path("/dev/zero")
    else:
        path.write_bytes(b"\x89PNG\r\n\x1a\n\x00\x00")
    with pytest.raises(FileError, match=r"expected a text (of Betaflight's CLI|in UTF-8)"):
        read_text(path)
