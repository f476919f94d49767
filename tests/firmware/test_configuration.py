"""The firmware reads a pilot's configuration, and the sticks follow from it."""

from random import Random

import numpy as np
import pytest

from quadsim.files.strict_yaml import FileError
from quadsim.firmware.configuration import (
    AXES,
    MIDDLE,
    STANDING,
    THROTTLE,
    Bench,
    ConfigurationError,
    configured,
)
from quadsim.firmware.text import Text, read_text
from quadsim.vehicle import VEHICLES

ARM = "aux 0 0 0 1700 2100 0 0"


def text(*lines):
    """Return a configuration."""
    return Text("mine.txt", (ARM, *lines))


def rates(kind, *numbers):
    """Return the lines of a rates type with rate, super rate and expo for all axes."""
    names = ("rc_rate", "srate", "expo")
    return [f"set rates_type = {kind}"] + [
        f"set {axis}_{name} = {number}"
        for axis in ("roll", "pitch", "yaw")
        for name, number in zip(names, numbers, strict=True)
    ]


@pytest.mark.parametrize(
    ("kind", "numbers"),
    [
        ("ACTUAL", (7, 67, 54)),
        ("ACTUAL", (60, 60, 0)),
        ("BETAFLIGHT", (110, 70, 20)),
        ("KISS", (100, 70, 30)),
        ("QUICK", (100, 67, 20)),
        ("RACEFLIGHT", (37, 80, 40)),
    ],
)
def test_sticks_give_the_rates_that_are_asked_for(built, kind, numbers):
    found = configured(built.program, text(*rates(kind, *numbers)), False)
    bench = Bench(built.program, found.eeprom, found.switches)
    largest = np.abs(found.rates).max(axis=1)
    for share in (-1.0, -0.613, -0.047, 0.0, 0.021, 0.377, 0.9):
        asked = share * largest
        for axis, channel in enumerate(AXES):
            bench._channels[channel] = found.pulse_for_rate(axis, asked[axis])
        bench._channels[THROTTLE] = MIDDLE
        reply = bench._hold(100)
        np.testing.assert_allclose(np.deg2rad(reply.setpoint), asked, atol=2e-3)
    bench.close()


def test_a_rate_beyond_the_largest_is_the_largest(built):
    found = configured(built.program, text(), False)
    assert found.pulse_for_rate(0, 1e3) == 2000.0
    assert found.pulse_for_rate(0, -1e3) == 1000.0


@pytest.mark.parametrize(
    "lines",
    [
        (),
        ("set thr_mid = 30", "set thr_expo = 60"),
        ("set throttle_limit_type = SCALE", "set throttle_limit_percent = 70"),
        ("set motor_idle = 800",),
    ],
)
def test_the_throttle_gives_the_motors_command_that_is_asked_for(built, lines):
    found = configured(built.program, text(*lines), False)
    bench = Bench(built.program, found.eeprom, found.switches)
    bench.arm()
    low, high = found.motors[0], found.motors[-1]
    for share in (0.01, 0.3, 0.55, 0.98):
        asked = low + share * (high - low)
        bench._channels[THROTTLE] = found.pulse_for_motors(asked)
        reply = bench._hold(200)
        np.testing.assert_allclose(reply.motors, asked, atol=4e-3)
    bench.close()


def test_the_limit_of_the_throttle_is_that_of_the_text(built):
    limited = text("set throttle_limit_type = SCALE", "set throttle_limit_percent = 70")
    found = configured(built.program, limited, False)
    assert found.motors[-1] == pytest.approx(0.715, abs=0.02)
    assert configured(built.program, text(), False).motors[-1] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(
    ("lines", "problem"),
    [
        (("set foo = 1",), r"mine\.txt:2: .*'set foo = 1': IN set: INVALID NAME"),
        (("set roll_expo = 1000",), r"mine\.txt:2: .*Allowed range: 0 - 100"),
        (("", "warp 9"), r"mine\.txt:3: .*'warp 9': Betaflight 4\.6\.0 has no such command"),
    ],
)
def test_a_line_that_the_firmware_does_not_take_is_named(built, lines, problem):
    with pytest.raises(FileError, match=problem) as caught:
        configured(built.program, text(*lines), False)
    assert "\n" not in str(caught.value)


def test_all_lines_that_the_firmware_does_not_take_are_named_at_once(built):
    lines = ("set gyro_sync_denom = 1", "set p_roll = 40", "set rates_type = NEVER", "mixer BI")
    with pytest.raises(ConfigurationError) as caught:
        configured(built.program, text(*lines), False)
    airframe, first, second = str(caught.value).splitlines()
    assert airframe.startswith("mine.txt:5: expected the mixer QUADX")
    assert first.startswith("mine.txt:2: expected a line of Betaflight's CLI")
    assert second.startswith("mine.txt:4: expected a line of Betaflight's CLI")
    # Not the hundred values that are allowed
    assert len(second) < 300


def test_a_configuration_needs_a_switch_that_arms(built):
    with pytest.raises(FileError, match=r"mine\.txt: expected a switch for ARM"):
        configured(built.program, Text("mine.txt", ("set roll_expo = 0",)), False)


def test_lines_of_the_board_are_left_out(built):
    lines = (
        "# comment",
        "batch start",
        "feature RX_SERIAL",
        "resource MOTOR 1 B01",
        "set osd_units = METRIC",
        "set dyn_notch_count = 1",
        "save",
    )
    found = configured(built.program, text(*lines), False)
    assert found.eeprom == configured(built.program, text(), False).eeprom


def test_a_feature_of_flight_is_that_of_the_text(built):
    found = [
        configured(built.program, text(*lines), False).eeprom
        for lines in ((), ("feature AIRMODE",), ("feature -AIRMODE",))
    ]
    assert found[0] == found[1] != found[2]


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("aux 1 1 1 900 2100 0 0", r"ARM on and ANGLE off, .*'aux 1 1 1 900 2100 0 0'"),
        ("aux 1 49 0 1300 2100 0 0", "ARM on and LAUNCH CONTROL off"),
    ],
)
def test_a_mode_that_would_take_the_sticks_in_flight_is_refused(built, line, problem):
    """In ANGLE a stick is an angle, so the vehicle would crash."""
    with pytest.raises(ConfigurationError, match=problem):
        configured(built.program, text(line), False)


def test_a_mode_that_is_off_in_flight_is_taken(built):
    found = configured(built.program, text("aux 1 1 1 1300 2100 0 0"), False)
    plain = configured(built.program, text(), False)
    assert found.eeprom != plain.eeprom
    assert found.switches == plain.switches


def test_the_channel_of_the_switch_is_that_of_the_text(built):
    found = configured(built.program, Text("x", ("aux 0 0 2 1300 1500 0 0",)), False)
    assert found.switches.channels(armed=True)[6] == 1400.0


@pytest.mark.parametrize("path", sorted(VEHICLES.glob("*.betaflight.txt")), ids=lambda p: p.stem)
def test_the_configuration_of_each_vehicle_is_read_and_arms(built, path):
    found = configured(built.program, read_text(path), False)
    bench = Bench(built.program, found.eeprom, found.switches)
    bench.arm()
    assert bench._firmware.step(*STANDING, bench._channels, 100, 10).armed
    bench.close()


def test_a_file_that_is_no_text_is_one_line(tmp_path):
    with pytest.raises(FileError, match="expected a text of Betaflight's CLI"):
        read_text(tmp_path / "none.txt")
    (tmp_path / "picture.txt").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileError, match="expected a text in UTF-8"):
        read_text(tmp_path / "picture.txt")


@pytest.mark.parametrize("value", ["many", "3O", ""])
def test_a_text_in_place_of_a_number_is_refused(built, value):
    """The firmware itself would take it as 0 or 3."""
    text = Text("mine.txt", (f"set p_roll = {value}", "aux 0 0 0 1700 2100 0 0"))
    with pytest.raises(ConfigurationError, match=r"^mine\.txt:1: expected a line"):
        configured(built.program, text, motors_reversed=True)


def switch_of(line):
    """Return where a bench arms with the switch of a line alone."""
    return Text("mine.txt", (line,))


@pytest.mark.parametrize(
    "text_",
    [
        text("aux 1 36 1 1700 2100 0 0"),  # PREARM
        text("aux 1 36 0 1300 2100 0 0"),  # in the middle of the same switch
        text("set min_check = 1000"),
        text("rxrange 0 1100 1900"),
        text("set rx_min_usec = 1050"),
        text("set mid_rc = 1550"),
        text("set max_throttle = 1500", "set min_command = 1100"),
        text("set gyro_cal_on_first_arm = ON"),
        text("aux 1 1 1 900 1300 0 0", "aux 2 2 1 1300 1700 0 0"),  # ANGLE, HORIZON
        switch_of("aux 0 0 0 900 1300 0 0"),
        switch_of("aux 0 0 6 1700 2100 0 0"),
        switch_of("aux 0 0 11 1700 2100 0 0"),
    ],
    ids=lambda t: t.lines[-1],
)
def test_a_pilots_switches_and_sticks_arm(built, text_):
    """Full sticks are the full rates; the curves have been measured."""
    found = configured(built.program, text_, False)
    assert np.rad2deg(found.rates[0]).max() == pytest.approx(670.0, abs=1.0)
    assert found.motors[-1] == pytest.approx(1.0, abs=1e-3)


def test_positions_that_are_found_arm(built):
    """The firmware joins conditions of modes as quadsim.firmware.switches does."""
    random = Random(4)
    ends = range(900, 2101, 25)
    armed = 0
    for _ in range(30):
        lines = ["aux 7 0 0 1700 2100 0 0"]
        for index in range(random.randrange(1, 7)):
            mode = random.choice((0, 1, 2, 36, 28, 35, 45, 49))
            low, high = sorted(random.sample(ends, 2))
            linked = random.choice((0, 0, 0, 1, 28)) if mode in (2, 35, 36) else 0
            logic = random.choice((0, 0, 1))
            lines.append(f"aux {index} {mode} {random.randrange(3)} {low} {high} {logic} {linked}")
        try:
            configured(built.program, Text("x", tuple(lines)), False)
            armed += 1
        except ConfigurationError:  # there is no such position
            pass
    assert armed > 10


def test_propellers_that_turn_the_other_way_are_one_line(built):
    line = "set yaw_motors_reversed = ON"
    configured(built.program, text(line), True)
    with pytest.raises(ConfigurationError, match=r"^mine\.txt:2: expected yaw_motors_reversed"):
        configured(built.program, text(line), False)


def test_the_default_direction_says_nothing_of_the_vehicle(built):
    one, other = (
        configured(built.program, each, True)
        for each in (text("set yaw_motors_reversed = OFF"), text())
    )
    assert one.eeprom == other.eeprom


@pytest.mark.parametrize("line", ["aux 0 0 0 1700 2100", "aux 0 0 0 1700 2100 0"])
def test_a_switch_of_fewer_numbers_arms(built, line):
    whole = configured(built.program, Text("x", ("aux 0 0 0 1700 2100 0 0",)), False)
    assert configured(built.program, Text("x", (line,)), False).eeprom == whole.eeprom


def test_idle_is_that_of_the_version_that_wrote_the_text(built):
    old = Text("x", ("# Betaflight / STM32F405 (S405) 4.5.1", ARM, "set dshot_idle_value = 2000"))
    new = Text("x", (ARM, "set motor_idle = 2000"))
    one, other = (configured(built.program, t, False) for t in (old, new))
    assert one.eeprom == other.eeprom
    assert one.motors[0] == pytest.approx(0.2, abs=2e-3)


def test_a_mixer_that_is_written_out_is_the_same_as_its_name(built):
    mixes = ("mmix 0 1 -1 1 -1", "mmix 1 1 -1 -1 1", "mmix 2 1 1 1 1", "mmix 3 1 1 -1 -1")
    found = configured(built.program, text("mixer CUSTOM", "mmix reset", *mixes), False)
    np.testing.assert_array_equal(found.motors, configured(built.program, text(), False).motors)


@pytest.mark.parametrize("version", ["4.2.0", "4.3.2", "4.4.2", "4.5.0"])
def test_the_defaults_of_each_version_are_settings_of_this_one(built, version):
    header = f"# Betaflight / STM32F405 (S405) {version} Apr 28 2024"
    found = configured(built.program, Text("x", (header, "defaults nosave", ARM)), False)
    largest = np.rad2deg(found.rates[0]).max()
    # 4.2 has Betaflight's rates of 1.00 and 0.70, later versions actual rates up to 670 deg/s.
    assert largest == pytest.approx(666.7 if version == "4.2.0" else 670.0, abs=1.0)
