"""Metrics against signals whose answer is known, and statistics against published values."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest

from quadsim.record.run import RecordedRun
from quadsim.report.metrics import (
    MOTOR_TAU,
    chatter,
    high_frequency_fraction,
    motor_corner,
    motor_residual,
    smoothness,
    thrust_psd,
    total_variation,
)
from tests.run_cases import SPEC, frame, two_laps

DT = 0.01
T = np.arange(4001) * DT  # 40 s


def white(seed=0, n=200_000):
    return np.arange(n) * DT, np.random.default_rng(seed).standard_normal(n)


def filtered(noise, tau):
    """First-order low-pass."""
    out, y = np.empty_like(noise), 0.0
    for k, v in enumerate(noise):
        y += (1 - np.exp(-DT / tau)) * (v - y)
        out[k] = y
    return out


def test_total_variation_of_a_sine_is_four_amplitudes_a_period():
    assert total_variation(T, 3.0 * np.sin(2 * pi * 0.5 * T)) == pytest.approx(
        4 * 3.0 * 0.5, rel=1e-3
    )


def test_total_variation_of_a_ramp_is_its_slope_and_does_not_see_an_offset():
    assert total_variation(T, 7.0 - 2.5 * T) == pytest.approx(2.5)


@pytest.mark.parametrize("dt", [0.01, 0.0025, 0.04])
def test_motor_residual_of_a_step_is_its_size_times_root_tau_over_two_t(dt):
    """int (A exp(-t/tau))^2 dt = A^2 tau / 2, for any control period."""
    t, tau = np.arange(1, round(8 / dt) + 1) * dt, 0.05
    step = np.where(np.arange(len(t)) >= len(t) // 2, 6.0, 0.0)
    assert motor_residual(t, step, tau) == pytest.approx(6.0 * sqrt(tau / (2 * 8)), rel=1e-9)


def test_motor_follows_what_is_slow_and_not_what_is_fast():
    slow, fast = np.sin(2 * pi * 0.05 * T), np.sin(2 * pi * 25 * T + 1)
    assert motor_residual(T, slow, 0.033) < 0.02
    assert motor_residual(T, fast, 0.033) > 0.6


def test_smoothness_of_a_sine_is_its_amplitude_times_its_frequency():
    """2/(n f_s) A f_0 with n = 2000 frequencies up to 50 Hz."""
    u = 2.0 * np.sin(2 * pi * 5.0 * T[:-1])
    assert smoothness(T[:-1], u) == pytest.approx(2 / (2000 * 100) * 2.0 * 5.0, rel=1e-6)


def test_psd_integrates_to_the_variance():
    t, u = white()
    for signal in (u, filtered(u, 0.01)):
        f, psd = thrust_psd(t, 9.81 + 3.0 * signal)
        assert np.sum(psd) * f[1] == pytest.approx(9.0 * signal.var(), rel=0.02)


def test_psd_finds_a_line_where_it_is():
    f, psd = thrust_psd(T, np.sin(2 * pi * 12.5 * T))
    assert f[np.argmax(psd)] == pytest.approx(12.5)
    assert np.sum(psd) * f[1] == pytest.approx(0.5, rel=1e-3)


@pytest.mark.parametrize("n", [3, 100, 255, 256, 257, 1000])
def test_psd_is_the_mean_periodogram_of_hann_windows_that_overlap_by_half(n):
    u = np.random.default_rng(n).standard_normal(n)
    f, psd = thrust_psd(np.arange(n) * DT, u)
    size = min(n, 256)
    window = np.sin(pi * np.arange(size) / size) ** 2
    parts = np.array([u[k : k + size] for k in range(0, n - size + 1, size // 2)])
    power = np.abs(np.fft.rfft(window * (parts - parts.mean(axis=1, keepdims=True)))) ** 2
    expected = power.mean(axis=0) * DT / np.sum(window**2)
    # both signs of all but zero and an even length's Nyquist frequency
    expected[1 : (size + 1) // 2] *= 2.0
    assert f == pytest.approx(np.fft.rfftfreq(size, DT))
    assert psd == pytest.approx(expected)


def test_white_noise_has_its_share_above_the_corner_and_filtered_noise_has_not():
    t, u = white()
    corner = motor_corner(0.05)
    assert corner == pytest.approx(3.183, abs=1e-3)
    assert high_frequency_fraction(t, u, corner) == pytest.approx(1 - corner / 50, abs=0.02)
    assert high_frequency_fraction(t, filtered(u, 0.5), corner) < 0.15
    assert high_frequency_fraction(t, np.full(len(t), 9.81), corner) == 0.0


def test_every_chatter_of_filtered_thrust_is_lower_than_of_white_thrust():
    t, u = white(n=4000)
    low = filtered(u, 0.2)
    low *= u.std() / low.std()  # the same power
    for rough, smooth in zip(measures(t, u), measures(t, low), strict=True):
        assert smooth < 0.7 * rough


def measures(t, u):
    frames = [replace(frame(k), u=(0.0, 0.0, 0.0, float(a))) for k, a in enumerate(u)]
    commanded = chatter(RecordedRun.from_frames(SPEC, frames))["commanded"]
    return [v for k, v in commanded.items() if k != "body_rates_tv"]


def test_chatter_names_its_corner_and_takes_the_vehicle_s_motor():
    run = two_laps()
    assert chatter(run)["motor_tau"] == 0.05
    assert chatter(run)["motor_corner"] == pytest.approx(1 / (2 * pi * 0.05))
    bare = replace(run, spec=SPEC | {"vehicle": {"rotors": None}})
    assert chatter(bare)["motor_tau"] == MOTOR_TAU


def test_chatter_tells_commanded_from_delivered():
    result = chatter(two_laps())
    assert result["delivered"]["thrust_tv"] == 0.0
    assert result["commanded"]["thrust_tv"] == pytest.approx(4.0 * 0.6 / 0.6, rel=0.2)
    assert result["commanded"]["thrust_slew_max"] == pytest.approx(2 * pi, rel=1e-2)
    assert result["commanded"]["thrust_slew_rms"] == pytest.approx(2 * pi / sqrt(2), rel=0.2)
    assert result["commanded"].keys() == result["delivered"].keys()


@pytest.mark.parametrize("frames", [0, 1, 2, 3])
def test_chatter_of_the_shortest_flights_is_a_number(frames):
    result = chatter(RecordedRun.from_frames(SPEC, [frame(k) for k in range(frames)]))
    assert all(
        np.isfinite(list(result[side].values())).all() for side in ("commanded", "delivered")
    )
