"""The off-road stand-in: its equations, and the lanes against the oracle in the corridor."""

from dataclasses import replace

import numpy as np
import pytest
from oracle import fly_rows, to_lanes

from quadsim.controllers.lanes.lanes import Rollout
from quadsim.controllers.lanes.layout import LANES
from quadsim.paper.car import DRIVEN, NOMINAL, CarState, OffroadVehicle, car, disturbed
from quadsim.paper.corridor import ZIGZAG
from quadsim.paper.corridor_cost import corridor_cost

M = 300  # samples
T = 250  # steps
DT = 0.02  # [s]
SYSTEM = car(NOMINAL, DT)
STATES = SYSTEM.states
COST = corridor_cost(ZIGZAG, half_width=0.8, dt=DT)


def state(**values):
    return CarState(**{**dict.fromkeys(STATES, 0.0), "hx": 1.0, **values})


def drive(x, u, seconds, vehicle=NOMINAL, dt=DT):
    """Return all states.  (steps + 1, n_x)"""
    system = car(vehicle, dt)
    states = [x]
    for _ in range(round(seconds / dt)):
        states.append(system.next(states[-1], u))
    return np.array(states, float)


def column(states, name):
    return states[:, STATES.index(name)]


def test_steering_takes_about_two_seconds_from_lock_to_lock():
    wheel = column(drive(state(steer=-1.0), (0.0, 1.0), 4.0), "steer")
    assert 1.8 < np.argmax(wheel > 0.9) * DT < 2.4
    assert np.diff(wheel).max() == pytest.approx(DT * NOMINAL.steer_rate)


def test_slow_circle_has_the_radius_of_full_lock():
    states = drive(state(v=2.0, steer=1.0), (0.0, 1.0), 3.0, replace(NOMINAL, drag=0.0))
    assert column(states, "r")[-1] * (1 / NOMINAL.curvature) == pytest.approx(2.0, rel=1e-3)


def test_fast_turn_has_the_lateral_acceleration_of_the_grip():
    """Without its limit, at 12 m/s and full lock it would be 26 m/s^2."""
    states = drive(state(v=12.0, steer=1.0), (0.0, 1.0), 3.0, replace(NOMINAL, drag=0.0))
    lateral = column(states, "v") * column(states, "r")
    assert lateral.max() == pytest.approx(NOMINAL.grip, rel=1e-3)
    assert 12.0**2 * NOMINAL.curvature > 4 * NOMINAL.grip


def test_braking_leaves_less_for_the_turn_and_ends_at_rest():
    states = drive(
        state(v=10.0, steer=1.0, drive=-1.0), (-1.0, 1.0), 4.0, replace(NOMINAL, brake=5.0)
    )
    v, r = column(states, "v"), column(states, "r")
    assert (v * r)[v > 6].max() < 0.6 * NOMINAL.grip
    assert v[-1] == 0.0 == v.min()
    assert states[-1, 0] == states[-2, 0]


def test_heading_stays_a_unit_vector_and_turns_by_the_integral_of_the_yaw_rate():
    states = drive(state(v=6.0), (0.3, 0.8), 10.0)
    hx, hy, r = (column(states, name) for name in ("hx", "hy", "r"))
    np.testing.assert_allclose(np.hypot(hx, hy), 1.0, atol=1e-6)
    turned = np.unwrap(np.arctan2(hy, hx))[-1]
    assert turned == pytest.approx((r[1:] + r[:-1]).sum() * DT / 2, rel=1e-3)
    assert turned > 3.0


def test_finer_steps_converge():
    def end(dt):
        return drive(state(v=5.0), (0.5, 0.7), 5.0, dt=dt)[-1, :2]

    coarse, fine, finest = end(0.02), end(0.005), end(0.00125)
    assert np.linalg.norm(fine - finest) < 0.35 * np.linalg.norm(coarse - finest) < 0.2


def test_driven_vehicle_slips_out_of_the_turn_that_the_nominal_one_makes():
    nominal, driven = (drive(state(v=6.0), (0.2, 1.0), 4.0, v) for v in (NOMINAL, DRIVEN))
    assert np.linalg.norm(nominal[-1, :2] - driven[-1, :2]) > 1.0
    slipping = drive(state(v=6.0), (0.2, 1.0), 4.0, replace(NOMINAL, slip=0.02))
    course = np.diff(slipping[:, :2], axis=0)[-1]
    heading = np.array(slipping[-1, 2:4])
    beside = np.arctan2(course @ [-heading[1], heading[0]], course @ heading)
    assert beside == pytest.approx(-0.02 * slipping[-1, 4] * slipping[-1, 5], rel=0.05)


def test_the_disturbed_vehicle_drifts_by_its_disturbance_alone():
    """Its yaw rate moves by 0.2 rad/s in 1 s; without the disturbance not at all."""
    std = CarState(*[0.2 if name == "r" else 0.0 for name in STATES])
    free = car(OffroadVehicle(yaw_tau=1e9), 0.05)
    ends = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        x = state()
        for _ in range(20):
            x = disturbed(free.next(x, (0.0, 0.0)), 0.05, rng, std)
        ends.append(x.r)
    assert np.std(ends) == pytest.approx(0.2, rel=0.2)
    assert drive(state(), (0.0, 0.0), 1.0)[-1].tolist() == list(state())


def controls(seed=0):
    """Slow in part, so that samples turn into walls and round bends."""
    rng = np.random.default_rng(seed)
    slow = rng.normal(0, 0.7, (M, 2, 1)) + rng.normal(0, 0.5, (M, 2, T))
    return np.tile((0.3, 0.2), (T, 1)), slow.astype(np.float32)


def fly_lanes(U, z, dtype):
    J = np.empty((-(-M // LANES), LANES), dtype)
    Rollout(SYSTEM, COST, dtype)(np.array(state(px=14.0, v=5.0)), U, to_lanes(z, dtype=dtype), 0, J)
    return J.ravel()[:M]


def end_line(x, x_next, target, params):
    """Distance to the line at which the leg ends.  (M,)"""
    return abs((x_next.px - target.x) * target.mx + (x_next.py - target.y) * target.my)


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("dtype", "rtol", "graze"),
    [
        (np.float32, 3e-4, 1e-4),
        pytest.param(np.float64, 1e-10, 1e-10, marks=pytest.mark.regression),
    ],
)
def test_lanes_agree_with_the_oracle(dtype, rtol, graze):
    U, z = controls()
    oracle = fly_rows(SYSTEM, COST, state(px=14.0, v=5.0), U, z, clearance=end_line)
    clear = oracle.clearance > graze
    assert clear.mean() > 0.95
    assert 0.2 < np.mean(oracle.reached > 0) < 0.98, "some take the bend, some do not"
    J = fly_lanes(U, z, dtype)
    np.testing.assert_allclose(J[clear], oracle.J[clear], rtol=rtol, atol=0.02 * rtol)
    other = car(replace(NOMINAL, grip=5.0, curvature=0.175), DT)
    wrong = fly_rows(other, COST, state(px=14.0, v=5.0), U, z).J
    assert np.mean(abs(wrong / oracle.J - 1) > rtol) > 0.8
