"""Paths as pieces of polynomials: the file alone gives the path back, with the stated error."""

import csv
from dataclasses import replace

import numpy as np
import pytest

import quadsim
from quadsim.cli.cli import race
from quadsim.record.polynomials import MOST_PIECES, run_polynomials
from tests.run_cases import save, two_laps

T = np.arange(0.0, 8.0, 0.01)
PATH = np.column_stack([3.0 * np.cos(2.0 * T), np.sin(3.0 * T), 1.0 + 0.2 * T])


def evaluated(file, times, derivative=0):
    """Return x, y, z and yaw at times by the file alone, as uav_trajectories reads it.  (n, 4)"""
    with file.open() as lines:
        rows = [np.array(row, float) for row in list(csv.reader(lines))[1:]]
    ends = np.cumsum([row[0] for row in rows])
    found = []
    for t in times:
        piece = min(int(np.searchsorted(ends, t, side="right")), len(rows) - 1)
        start = ends[piece] - rows[piece][0]
        powers = rows[piece][1:].reshape(4, 8)
        curves = [np.polynomial.Polynomial(axis).deriv(derivative) for axis in powers]
        found.append([curve(t - start) for curve in curves])
    return np.array(found)


def test_the_file_gives_the_path_back_with_the_stated_error(tmp_path):
    fitted = quadsim.fit_polynomials(T, PATH, yaw=0.5 * T, pieces=6)
    back = evaluated(fitted.save(tmp_path / "lap.csv"), T)
    error = np.linalg.norm(back[:, :3] - PATH, axis=1).max()
    assert error == pytest.approx(fitted.largest_error, rel=1e-3)
    assert 1e-6 < error < 0.01
    np.testing.assert_allclose(back[:, 3], 0.5 * T, atol=1e-6)


@pytest.mark.parametrize("derivative", range(4))
def test_pieces_meet_up_to_the_jerk(derivative, tmp_path):
    fitted = quadsim.fit_polynomials(T, PATH, pieces=6)
    file = fitted.save(tmp_path / "lap.csv")
    joints = np.cumsum(fitted.durations)[:-1]
    before = evaluated(file, joints - 1e-7, derivative)
    after = evaluated(file, joints + 1e-7, derivative)
    np.testing.assert_allclose(before, after, atol=1e-3)


def test_more_pieces_are_nearer_to_the_path():
    errors = [quadsim.fit_polynomials(T, PATH, pieces=n).largest_error for n in (2, 4, 8)]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.1 * errors[0]


def test_a_polynomial_is_found_exactly():
    fitted = quadsim.fit_polynomials(T, np.column_stack([1.0 + 2.0 * T, T**2, 0.1 * T**3]), 0.4, 1)
    expected = np.zeros((1, 4, 8))
    expected[0, 0, :2] = [1.0, 2.0]
    expected[0, 1, 2] = 1.0
    expected[0, 2, 3] = 0.1
    expected[0, 3, 0] = 0.4
    np.testing.assert_allclose(fitted.coefficients, expected, atol=1e-6)


def turning_run(axis):
    """Return a run of 0.6 s in which the vehicle turns by 2 rad about a body axis, 1 to 3."""
    run = two_laps()
    half = run.telemetry["t"] / run.telemetry["t"][-1]
    attitude = np.zeros((4, len(half)))
    attitude[0] = np.cos(half)
    attitude[axis] = np.sin(half)
    turned = dict(zip(("qw", "qx", "qy", "qz"), attitude, strict=True))
    return replace(run, telemetry=run.telemetry | turned)


def test_a_short_path_has_fewer_pieces():
    fitted = quadsim.fit_polynomials(T[:40], PATH[:40])
    assert len(fitted.durations) == 5 < MOST_PIECES
    assert fitted.durations.sum() == pytest.approx(T[39])


def test_a_vehicle_that_turns_over_holds_its_heading():
    turning = run_polynomials(turning_run(axis=3))
    assert not turning.yaw_held
    end = turning.coefficients[-1, 3] @ turning.durations[-1] ** np.arange(8)
    assert end == pytest.approx(2.0, abs=1e-3)
    looping = run_polynomials(turning_run(axis=2))
    assert looping.yaw_held
    np.testing.assert_allclose(looping.coefficients[:, 3], 0.0, atol=1e-6)


def test_the_command_prints_the_largest_error(tmp_path, capsys):
    folder = save(tmp_path, two_laps())
    out = tmp_path / "lap.csv"
    assert race(["export", str(folder), "--polynomials", "--out", str(out)]) == 0
    assert "7 pieces, 0.60 s, largest error" in capsys.readouterr().out
    times = np.arange(0.0, 0.6, 0.05)
    np.testing.assert_allclose(evaluated(out, times)[:, 0], 30.0 * times, atol=1e-3)
    assert race(["export", str(folder), str(folder), "--polynomials"]) == 2
    assert "--polynomials: expected one run, got 2" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ((T[::-1], PATH), r"t: expected at least 8 increasing times"),
        ((T[:4], PATH[:4]), r"t: expected at least 8 increasing times"),
        ((T, PATH[:5]), r"position: expected the shape \(800, 3\), got \(5, 3\)"),
        ((T, PATH, T[:3]), r"yaw: expected a number or the shape \(800,\)"),
        ((T, PATH, 0.0, 0), r"pieces: expected at least 1, got 0"),
    ],
)
def test_what_is_no_path_is_refused(arguments, problem):
    with pytest.raises(quadsim.SettingError, match=problem):
        quadsim.fit_polynomials(*arguments)
