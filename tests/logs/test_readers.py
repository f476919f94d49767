"""Each kind of log gives the signals of one known flight, in the same units, frames and order."""

import numpy as np
import pytest

import quadsim
from quadsim.logs.raw_log import LogError
from quadsim.logs.read import read_logs
from quadsim.record.exchange import telemetry_csv
from quadsim.record.mcap_file import mcap_bytes
from tests.logs.log_cases import (
    ROWS,
    blackbox_bytes,
    crazyflie_bytes,
    known_signals,
    nanobench_columns,
    ulog_bytes,
    write_csv,
)

# What a format rounds to: whole degrees a second, whole steps of an accelerometer or a motor
ROUNDED = {"body_rates": 0.01, "rate_setpoints": 0.01, "specific_force": 3e-3}


def written(path, data):
    """Write a file, and return its path."""
    path.write_bytes(data)
    return path


def expect_known(log, names, tolerances=None):
    """Check that a log has these signals of the known flight, and no others of it."""
    t, known = known_signals()
    np.testing.assert_allclose(log.t, t, atol=2e-3)
    assert set(names) == known.keys() & set(log.signals)
    for name in names:
        found = getattr(log, name)
        wanted = known[name]
        if name == "quaternion":
            # An attitude has two quaternions.
            found = found * np.sign(np.sum(found * wanted, axis=1, keepdims=True))
        atol = {"motor_commands": 3e-4, "battery": 0.006, **(tolerances or {})}.get(name, 1e-5)
        good = np.isfinite(found)
        assert good.mean() > 0.97, name
        np.testing.assert_allclose(found[good], wanted[good], atol=atol, err_msg=name)


def test_a_csv_of_nanobench_is_known_by_its_header(tmp_path):
    (log,) = read_logs(write_csv(tmp_path / "flight.csv", nanobench_columns()))
    expect_known(log, known_signals()[1])
    np.testing.assert_allclose(log.throttle, 0.5)
    assert log.start == pytest.approx(1.7e6)


MINE = """
world: NED
body: FRD
time: {column: ms, unit: ms}
position: {columns: [n, e, d], unit: mm}
euler: {columns: [roll, pitch, yaw], unit: deg}
body_rates: {columns: [p, q, r], unit: deg/s}
specific_force: {columns: [-ax, -ay, -az], unit: g}
motor_commands: {columns: [m1, m2, m3, m4], zero: 1000, full: 2000}
battery: {column: mv, unit: mV}
"""


def test_a_csv_of_ones_own_is_read_with_a_mapping(tmp_path):
    t, s = known_signals()
    # Angles of an attitude from NED to FRD
    w, x, y, z = _ned_frd(s["quaternion"]).T
    columns = {
        "ms": 1e3 * t,
        **dict(zip("ned", 1e3 * s["position"][:, [1, 0, 2]].T * [[1], [1], [-1]], strict=True)),
        "roll": np.degrees(np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))),
        "pitch": np.degrees(np.arcsin(2 * (w * y - z * x))),
        "yaw": np.degrees(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))),
        **dict(zip("pqr", np.degrees(s["body_rates"].T) * [[1], [-1], [-1]], strict=True)),
        **{f"a{k}": -s["specific_force"][:, i] / 9.80665 for i, k in enumerate("xyz")},
        **{f"m{k + 1}": 1000 + 1000 * s["motor_commands"][:, k] for k in range(4)},
        "mv": 1e3 * s["battery"],
    }
    # The accelerometer measures gravity's sign the other way, and y and z point right and down.
    columns["ay"] *= -1
    columns["az"] *= -1
    (tmp_path / "mine.yaml").write_text(MINE)
    file = write_csv(tmp_path / "flight.csv", columns)
    (log,) = read_logs(file, tmp_path / "mine.yaml")
    expect_known(log, s.keys() - {"velocity"})
    with pytest.raises(LogError, match=r"flight.csv:1: expected the columns of a shipped mapping"):
        read_logs(file)


def _ned_frd(quaternions):
    """Return attitudes from ENU to FLU as attitudes from NED to FRD."""
    from tests.logs.log_cases import products

    return products(
        products(np.array((0.0, 0.5**0.5, 0.5**0.5, 0.0)), quaternions),
        np.array((0.0, 1.0, 0.0, 0.0)),
    )


def test_columns_that_are_missing_switch_off_their_signal_alone(tmp_path):
    columns = nanobench_columns()
    del columns["pz"], columns["pwr_pm_vbat"]
    file = write_csv(tmp_path / "flight.csv", columns)
    (log,) = read_logs(file, "nanobench")
    expect_known(log, known_signals()[1].keys() - {"position", "battery"})
    assert "left out: position (no column pz); battery (no column pwr_pm_vbat)" in log.remarks


@pytest.mark.parametrize(("version", "others"), [(1, False), (2, False), (2, True)])
def test_a_log_of_the_crazyflies_sd_card(tmp_path, version, others):
    (log,) = read_logs(written(tmp_path / "log10", crazyflie_bytes(version, others)))
    expect_known(log, ("body_rates", "specific_force", "motor_commands"))
    assert log.start == pytest.approx(20.0)


def test_a_blackbox_log(tmp_path):
    pytest.importorskip("orangebox", reason="the extra logs is not installed")
    (log,) = read_logs(written(tmp_path / "log.bbl", blackbox_bytes()))
    names = ("body_rates", "specific_force", "motor_commands", "battery")
    expect_known(log, names, ROUNDED)
    np.testing.assert_allclose(log.rate_setpoints, log.body_rates)
    np.testing.assert_allclose(log.throttle, 0.5)
    np.testing.assert_allclose(log.rotor_speeds, 1000.0, rtol=1e-3)


def test_commands_of_an_analogue_protocol(tmp_path):
    pytest.importorskip("orangebox", reason="the extra logs is not installed")
    data = blackbox_bytes(output="1070,2000", without=("eRPM", "vbatLatest"))
    (log,) = read_logs(written(tmp_path / "log.BFL", data))
    names = ("body_rates", "specific_force", "motor_commands")
    expect_known(log, names, ROUNDED | {"motor_commands": 6e-4})


def test_differences_to_a_frame_that_is_lost_are_left_out(tmp_path):
    """Frames are lost on the way to the card, and the next ones are differences to them."""
    pytest.importorskip("orangebox", reason="the extra logs is not installed")
    rows = [*range(100), *range(150, ROWS)]
    (log,) = read_logs(written(tmp_path / "log.bbl", blackbox_bytes(rows)))
    # Frames of whole values are 16 apart: rows 97 to 99 and 150 to 159 may follow what is lost.
    kept = [*range(97), *range(160, ROWS)]
    _, known = known_signals()
    np.testing.assert_allclose(log.body_rates, known["body_rates"][kept], atol=0.01)
    assert [piece.stop - piece.start for piece in log.pieces] == [97, ROWS - 160]
    assert any(remark.endswith("differences to a row that is lost: 13") for remark in log.remarks)


def test_the_other_logs_of_a_blackbox_file_survive_a_damaged_one(tmp_path):
    pytest.importorskip("orangebox", reason="the extra logs is not installed")
    whole = blackbox_bytes()
    head = whole[: whole.index(b"H Field P")]
    first, second = read_logs(written(tmp_path / "log.bbl", whole + head + whole))
    assert (first.name, second.name) == ("log.bbl[1]", "log.bbl[3]")
    for log in (first, second):
        assert len(log.t) == ROWS
    assert any(remark.startswith("left out: log.bbl[2]: ") for remark in first.remarks)


def test_a_log_of_px4(tmp_path):
    pytest.importorskip("pyulog", reason="the extra logs is not installed")
    (log,) = read_logs(written(tmp_path / "log.ulg", ulog_bytes()))
    # Poses are interpolated between readings 40 ms apart.
    coarse = {"position": 3e-4, "velocity": 3e-4, "quaternion": 3e-4, "battery": 0.006}
    expect_known(log, known_signals()[1], coarse)


@pytest.fixture(scope="module")
def run():
    """Return a short run."""
    return quadsim.fly(excite=True, plant="rigid", sensing="perfect", timeout=1.5)


@pytest.mark.slow
def test_a_run_is_the_same_log_from_its_folder_as_csv_and_as_mcap(run, tmp_path):
    pytest.importorskip("mcap_protobuf", reason="the extra mcap is not installed")
    (log,) = read_logs(run.save(tmp_path))
    (exported,) = read_logs(written(tmp_path / "run.mcap", mcap_bytes(run)))
    table = written(tmp_path / "run.csv", telemetry_csv([("run", run)]))
    (columns,) = read_logs(table)
    telemetry = run.telemetry
    np.testing.assert_array_equal(log.position.T, [telemetry[f"p{k}"] for k in "xyz"])
    np.testing.assert_array_equal(log.thrust_setpoint, telemetry["a_cmd"])
    for other in (exported, columns):
        assert other.signals == log.signals
        for name in log.signals:
            np.testing.assert_allclose(getattr(other, name), getattr(log, name), rtol=1e-12)
