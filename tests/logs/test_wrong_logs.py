"""Wrong logs: bad rows and readings are left out and counted, and what is no log is one line."""

import re

import numpy as np
import pytest

from quadsim.files.strict_yaml import FileError
from quadsim.logs import csv_log
from quadsim.logs.cleaning import cleaned
from quadsim.logs.raw_log import LogError, RawLog
from quadsim.logs.read import read_logs
from tests.logs.log_cases import (
    RATE,
    ROWS,
    blackbox_bytes,
    crazyflie_bytes,
    known_signals,
    nanobench_columns,
    ulog_bytes,
    write_csv,
)


def flight(**changes):
    """Return the known flight as a reader returns it, with changes of its columns."""
    t, signals = known_signals()
    return RawLog("flight", changes.pop("t", t), {**signals, **changes})


def changed(name, change):
    """Return the known flight with one signal changed in place."""
    readings = known_signals()[1][name].copy()
    change(readings)
    return flight(**{name: readings})


def test_a_whole_log_has_one_piece_and_nothing_left_out():
    log = cleaned(flight())
    assert log.pieces == (slice(0, ROWS),)
    assert log.remarks == (
        "not in this log: rotor speeds, rate setpoints, thrust setpoint, throttle",
    )


def read_or_refused(file):
    """Return the flights of a log, none if it is refused with one line."""
    try:
        return read_logs(file)
    except LogError as error:
        if "\n" in str(error):
            raise
        return []


# Time


def times(change):
    """Return the times of the known flight, changed."""
    t = known_signals()[0].copy()
    change(t)
    return t


def test_rows_out_of_order_and_repeated_ones_are_left_out():
    def swap(t):
        t[100:103] -= 0.05
        t[200] = t[199]
        t[300] = np.nan

    log = cleaned(flight(t=times(swap)))
    kept = [k for k in range(ROWS) if k not in (100, 101, 102, 200, 300)]
    np.testing.assert_array_equal(log.position, known_signals()[1]["position"][kept])
    assert "rows left out, whose time stood still or went back: 4" in log.remarks
    assert "rows left out, without a time: 1" in log.remarks


def test_one_time_far_ahead_is_left_out_alone():
    def far_ahead(t):
        t[150] = 1e9

    log = cleaned(flight(t=times(far_ahead)))
    assert len(log.t) == ROWS - 1
    assert log.duration == pytest.approx((ROWS - 1) / RATE)
    assert "rows left out, whose time stood still or went back: 1" in log.remarks


def test_a_clock_that_starts_anew_divides_the_log():
    def restart(t):
        t[250:] -= t[250]

    log = cleaned(flight(t=times(restart)))
    assert log.pieces == (slice(0, 250), slice(250, ROWS))
    assert (np.diff(log.t) > 0.0).all()
    assert "the clock started anew 1 times" in log.remarks


def test_gaps_divide_the_log_and_are_counted():
    def pause(t):
        t[100:] += 0.5
        t[300:] += 2.0
        # No gap: three readings are lost.
        t[350:] += 0.03

    log = cleaned(flight(t=times(pause)))
    assert log.pieces == (slice(0, 100), slice(100, 300), slice(300, ROWS))
    assert "gaps: 2, the longest 2.01 s, together 2.52 s" in log.remarks


def test_times_in_a_random_order_are_refused():
    t = np.random.default_rng(0).permutation(20 * ROWS) / RATE
    signals = {"body_rates": np.zeros((20 * ROWS, 3))}
    with pytest.raises(LogError, match=r"^flight: expected times that rise"):
        cleaned(RawLog("flight", t, signals))


def test_rows_that_are_sorted_backwards_are_refused():
    t, signals = known_signals()
    backwards = {name: readings[::-1] for name, readings in signals.items()}
    with pytest.raises(LogError, match=r"^flight: time: expected times that rise .* sort the rows"):
        cleaned(RawLog("flight", t[::-1], backwards))


def test_times_in_another_unit_are_refused():
    with pytest.raises(LogError, match=r"^flight: time: expected rows every .* got one every 10 s"):
        cleaned(flight(t=1e3 * known_signals()[0]))


# Readings


def test_impossible_and_missing_readings_become_nan_alone():
    def spoil(motors):
        motors[20:30, 1] = 4.2
        motors[30:40] = np.nan
        motors[50, 2] = -np.inf

    log = cleaned(changed("motor_commands", spoil))
    missing = ~np.isfinite(log.motor_commands)
    assert missing[20:30].sum() == 10
    assert missing.sum() == 10 + 40 + 1
    assert "motor commands: readings left out, impossible: 10" in log.remarks


def test_missing_readings_are_counted_but_not_those_of_a_slower_sensor():
    def lose(rows):
        def change(readings):
            readings[rows] = np.nan

        return change

    lost = cleaned(changed("body_rates", lose(slice(40, 60)))).remarks
    assert "body rates: rows without a reading: 20" in lost
    slower = np.arange(ROWS) % 4 > 0
    assert not any(
        "without a reading" in each for each in cleaned(changed("battery", lose(slower))).remarks
    )


def test_a_log_without_any_reading_is_refused():
    t, signals = known_signals()
    empty = {name: np.full_like(readings, np.nan) for name, readings in signals.items()}
    with pytest.raises(LogError, match="expected readings of a signal beside the time, got none"):
        cleaned(RawLog("flight", t, empty))


def test_saturated_readings_are_left_out_where_the_sensors_limit_is_known():
    t, signals = known_signals()
    raw = RawLog("flight", t, signals, largest={"body_rates": 1.9})
    log = cleaned(raw)
    saturated = np.abs(signals["body_rates"]) > 0.998 * 1.9
    assert saturated.sum() > 10
    np.testing.assert_array_equal(np.isnan(log.body_rates), saturated)
    assert f"body rates: readings left out, saturated: {saturated.sum()}" in log.remarks
    assert np.isfinite(cleaned(flight()).body_rates).all()


def test_a_jump_of_the_pose_divides_the_log_and_a_change_of_sign_does_not():
    def reset(position):
        position[200:] += 3.0

    assert cleaned(changed("position", reset)).pieces == (slice(0, 200), slice(200, ROWS))

    def turn(quaternion):
        quaternion[200:] *= -1.0

    assert cleaned(changed("quaternion", turn)).pieces == (slice(0, ROWS),)

    turned = known_signals()[1]["quaternion"]
    w, x, y, z = turned[200:].T.copy()
    turned[200:] = np.stack((-z, y, -x, w), axis=1)
    t, signals = known_signals()
    log = RawLog("flight", t, {"body_rates": signals["body_rates"], "quaternion": turned})
    assert len(cleaned(log).pieces) == 2


# Units and frames


@pytest.mark.parametrize(
    ("name", "factor", "problem"),
    [
        ("motor_commands", 65535.0, "motor_commands: expected motor commands [1] from 0 to 1"),
        ("specific_force", 1 / 9.80665, "specific_force: expected an accelerometer [m/s^2] that"),
        ("specific_force", -1.0, "specific_force: expected an accelerometer that reads +9.81"),
        ("body_rates", 180.0 / np.pi, "body_rates: expected body rates [rad/s] from -100 to 100"),
        ("body_rates", np.pi / 180.0, "body_rates: expected the derivative of the attitude"),
        ("body_rates", 2.0, "body_rates: expected the derivative of the attitude"),
        ("body_rates", (1.0, -1.0, -1.0), "body_rates: expected the derivative of the attitude"),
        ("position", 1e3, "velocity: expected the derivative of position"),
        ("velocity", (1.0, 1.0, -1.0), "velocity: expected the derivative of position along z"),
        ("battery", 1e3, "battery: expected battery voltage [V] from 0 to 200"),
    ],
)
def test_a_signal_in_another_unit_or_frame_is_one_line(name, factor, problem):
    readings = known_signals()[1][name] * np.array(factor)
    with pytest.raises(LogError, match=f"^flight: {re.escape(problem)}") as error:
        cleaned(flight(**{name: readings}))
    assert "\n" not in str(error.value)


def test_noise_and_delay_are_no_other_unit():
    """The checks of units bear what real logs have."""
    rng = np.random.default_rng(3)
    _, known = known_signals()
    delayed = np.roll(known["body_rates"], 4, axis=0)
    noisy = {
        "body_rates": delayed + rng.normal(0.0, 0.3, delayed.shape),
        "velocity": known["velocity"] + rng.normal(0.0, 0.2, delayed.shape),
        "specific_force": known["specific_force"] + rng.normal(0.0, 3.0, delayed.shape),
    }
    assert cleaned(flight(**noisy)).pieces == (slice(0, ROWS),)


# Files


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "expected a log, got an empty file"),
        (b"\x00\x01\x02" * 100, "expected a folder of a run or a file of one of these"),
        (b"once upon a time\n" * 50, "expected a folder of a run or a file of one of these"),
        (b"1,2,3\n4,5,6\n", "expected a first line that names the columns"),
        (b"# x\nmonday\nt,px\n1,2\n", ":2: expected the names of the columns, got 'monday': begin"),
        (b"t,px,py\n1,2,3\n", "expected the columns of a shipped mapping"),
        (b"\x89MCAP0\r\n" + b"\0" * 50, "damaged, or cut off"),
    ],
)
def test_what_is_no_log_is_one_line(tmp_path, content, problem):
    if content.startswith(b"\x89MCAP"):
        pytest.importorskip("mcap_protobuf", reason="the extra mcap is not installed")
    file = tmp_path / "flight"
    file.write_bytes(content)
    with pytest.raises(LogError, match=problem) as error:
        read_logs(file)
    assert str(error.value).startswith(str(file))
    assert "\n" not in str(error.value)


def test_a_folder_and_a_missing_file_are_one_line(tmp_path):
    with pytest.raises(LogError, match="got another folder"):
        read_logs(tmp_path)
    with pytest.raises(LogError, match="no such file"):
        read_logs(tmp_path / "nothing.csv")


def test_a_pointer_of_git_lfs_is_named(tmp_path):
    file = tmp_path / "flight.bbl"
    file.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n")
    with pytest.raises(LogError, match="got a pointer of Git LFS: run git lfs pull"):
        read_logs(file)


def test_a_variable_without_a_type_is_a_damaged_header(tmp_path):
    file = tmp_path / "log00"
    file.write_bytes(crazyflie_bytes().replace(b"acc.x(f)\0", b"a\0"))
    with pytest.raises(LogError, match="its header is cut off or damaged"):
        read_logs(file)


def test_what_px4_says_of_the_vehicle_counts(tmp_path):
    pytest.importorskip("pyulog", reason="the extra logs is not installed")
    file = tmp_path / "flight.ulg"

    def read(**topics):
        file.write_bytes(ulog_bytes(**topics))
        (log,) = read_logs(file)
        return log

    landed = np.arange(ROWS) < 100
    log = read(vehicle_land_detected={"landed": landed}, vehicle_status={"vehicle_type": landed})
    assert len(log.t) == ROWS - 100
    assert "rows left out, in which the vehicle is landed: 100" in log.remarks
    with pytest.raises(LogError, match="expected a flight, got a log of a vehicle that stays land"):
        read(vehicle_land_detected={"landed": np.ones(ROWS)})
    with pytest.raises(LogError, match="expected a log of a multirotor, got a VTOL"):
        read(vehicle_status={"is_vtol": np.ones(ROWS), "vehicle_type": np.ones(ROWS)})
    with pytest.raises(LogError, match="expected a log of a multirotor, got another vehicle"):
        read(vehicle_status={"vehicle_type": 2.0 * np.ones(ROWS)})


FILES = {
    "csv": lambda: b"",
    "crazyflie": crazyflie_bytes,
    "blackbox": blackbox_bytes,
    "ulog": ulog_bytes,
}
READERS = {"blackbox": "orangebox", "ulog": "pyulog"}


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["csv", "crazyflie", "blackbox", "ulog"])
def test_a_log_that_is_cut_off_is_read_up_to_there_or_is_one_line(tmp_path, kind):
    if kind in READERS:
        pytest.importorskip(READERS[kind], reason="the extra logs is not installed")
    if kind == "csv":
        data = write_csv(tmp_path / "whole.csv", nanobench_columns()).read_bytes()
    else:
        data = FILES[kind]()
    file = tmp_path / "flight"
    rows = []
    for share in np.linspace(0.02, 1.0, 25):
        file.write_bytes(data[: int(share * len(data))])
        rows.append(sum(len(log.t) for log in read_or_refused(file)))
    assert rows == sorted(rows)
    assert rows[-1] == ROWS
    assert rows[12] > 0.35 * ROWS


@pytest.mark.parametrize("kind", ["crazyflie", "blackbox", "ulog"])
def test_damaged_bytes_never_end_in_a_traceback(tmp_path, kind, capfd):
    if kind in READERS:
        pytest.importorskip(READERS[kind], reason="the extra logs is not installed")
    data = FILES[kind]()
    rng = np.random.default_rng(5)
    file = tmp_path / "flight"
    read = 0
    for _ in range(20):
        damaged = bytearray(data)
        for place in rng.integers(16, len(data), 20):
            damaged[place] = rng.integers(256)
        file.write_bytes(damaged)
        read += len(read_or_refused(file))
    assert read > 0
    # Nor do they make a library print.
    assert capfd.readouterr() == ("", "")


def test_cells_that_are_no_numbers_are_missing_readings(tmp_path):
    file = write_csv(tmp_path / "flight.csv", nanobench_columns())
    lines = file.read_text().splitlines()
    cells = lines[11].split(",")
    cells[1] = ""
    cells[2] = "n/a"
    lines[11] = ",".join(cells)
    lines[21] = ",".join(lines[21].split(",")[:10])
    file.write_text("\n".join(lines))
    (log,) = read_logs(file)
    assert np.isnan(log.position).sum() == 2
    assert np.isnan(log.motor_commands).sum() == 4
    assert "lines with cells that are missing or no numbers: 2" in log.remarks


MINE = "time: {column: t}\nbody_rates: {columns: [gx, gy, gz]}\n"


def gyro_csv(tmp_path, head, row):
    """Return a CSV log of 60 rows and its mapping."""
    file = tmp_path / "mine.csv"
    file.write_text("\n".join([head, *(row.format(t=0.01 * k) for k in range(60))]))
    mapping = tmp_path / "mine.yaml"
    mapping.write_text(MINE)
    return file, mapping


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ('t,"pos (x,y)",gx,gy,gz,rest', "{t:.2f},7,0.1,0.2,0.3,9"),
        ('"t","gx","gy","gz",', '{t:.2f},"0.1",0.2,0.3,'),
        ("t; gx; gy; gz", "{t:.2f}; 0.1; 0.2; 0.3"),
        ("# made by hand\n\n# t,gx,gy,gz", "{t:.2f},0.1,0.2,0.3"),
        ("t,gx,gy,gz,rest,rest", "{t:.2f},0.1,0.2,0.3,1,1"),
    ],
)
def test_names_are_read_as_the_rows_are(tmp_path, head, row):
    file, mapping = gyro_csv(tmp_path, head, row)
    (log,) = read_logs(file, mapping)
    np.testing.assert_allclose(log.body_rates, np.tile((0.1, 0.2, 0.3), (60, 1)))
    assert not any("missing or no numbers" in remark for remark in log.remarks)


@pytest.mark.parametrize(
    ("head", "row", "problem"),
    [
        ("t,gx,gy,gz,gx", "{t:.2f},0.1,0.2,0.3,99", ":1: expected one column 'gx', got it 2 times"),
        ("t,pos (x,y),gx,gy,gz", "{t:.2f},7,0.1,0.2,0.3", ":1: expected a row of 6 cells"),
        ("t,gx,gy,gz", "{t:.2f},0.1,0.2,0.3,5", ":1: expected a row of 4 cells"),
        (
            "t,gx,gy,gz" + 100_000 * "x",
            "{t:.2f},0.1,0.2,0.3",
            ":1: expected a line of names of at most",
        ),
    ],
)
def test_names_that_do_not_fit_the_rows_are_one_line(tmp_path, head, row, problem):
    with pytest.raises(LogError, match=re.escape(problem)):
        read_logs(*gyro_csv(tmp_path, head, row))


def test_a_long_log_is_read_up_to_a_number_of_rows(tmp_path, monkeypatch):
    monkeypatch.setattr(csv_log, "MOST_ROWS", 300)
    (log,) = read_logs(write_csv(tmp_path / "flight.csv", nanobench_columns()))
    assert len(log.t) == 300
    assert "the first 300 rows are read, and no more" in log.remarks


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("time: {column: t}\nbody_rates: {columns: [a, b]}", "body_rates: expected columns with 3"),
        ("time: {column: t, unit: h}", "time.unit: expected one of s, ms, us, ns, got 'h'"),
        ("body_rates: {columns: [a, b, c]}", "time: missing"),
        ("time: {column: t}\nworld: NED\neuler: {columns: [a, b, c]}", "world: expected an attit"),
        ("time: {column: t}\nthrottle: {column: a, zero: 1, full: 1}", "throttle.full: expected"),
        ("time: {column: -t}", "time: expected a column that rises, got '-t'"),
        ("time: {column: t}\nthrottle: {column: a, zero: 1}", "throttle.zero: expected full besi"),
        (
            "time: {column: t}\nthrottle: {column: a, unit: '%', full: 100}",
            "throttle.unit: expected either unit, or zero and full, got both",
        ),
        (
            "time: {column: t}\nbody_rates: {columns: [a, b, c], full: 2}",
            "body_rates.full: expected it at motor_commands and throttle",
        ),
        (
            "time: {column: t}\nbody_rates: {columns: [a, b, -b]}",
            "body_rates: expected each column once, got 'b' twice",
        ),
        ("time: {column: t}\nheight: {column: a}", "height"),
    ],
)
def test_a_wrong_mapping_is_one_line_with_its_place(tmp_path, text, problem):
    file = write_csv(tmp_path / "flight.csv", nanobench_columns())
    mapping = tmp_path / "mine.yaml"
    mapping.write_text(text)
    with pytest.raises(FileError, match=re.escape(problem)) as error:
        read_logs(file, mapping)
    assert str(error.value).startswith(f"{mapping}:")
