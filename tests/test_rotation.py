"""Rotations: against SciPy's and against each other."""

from math import hypot, radians

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from quadsim.course import Gate
from quadsim.rotation import (
    along,
    between,
    body_axes,
    euler_angles,
    euler_matrix,
    exp,
    from_euler,
    from_yaw,
    log,
    matrix,
    product,
    quaternion_rate,
    skew,
    to_body,
    to_world,
    turned,
    turned_at,
    without_jumps,
)

NEAR = {"rtol": 0, "atol": 1e-12}


def attitudes(number, seed=0):
    """Return random attitudes, uniform over all, as tuples of floats."""
    rows = np.random.default_rng(seed).normal(size=(number, 4))
    return [tuple((q / np.linalg.norm(q)).tolist()) for q in rows]


def vectors(number, seed=1, size=1.0):
    """Return random vectors as tuples of floats."""
    return [tuple(v) for v in np.random.default_rng(seed).normal(0.0, size, (number, 3)).tolist()]


def scipys(q):
    """Return the same attitude as SciPy's Rotation, whose quaternions are xyzw."""
    w, x, y, z = q
    return Rotation([x, y, z, w])


CASES = list(zip(attitudes(200), vectors(200), strict=True))


def test_vectors_and_matrices_turn_as_scipys_do():
    for q, v in CASES:
        np.testing.assert_allclose(to_world(q, v), scipys(q).apply(v), **NEAR)
        np.testing.assert_allclose(to_body(q, v), scipys(q).inv().apply(v), **NEAR)
        np.testing.assert_allclose(matrix(q), scipys(q).as_matrix(), **NEAR)
        # a product with a matrix in another order has other bits
        assert matrix(q).flags["C_CONTIGUOUS"]
        np.testing.assert_allclose(matrix(q).T.ravel(), body_axes(q), **NEAR)
        np.testing.assert_allclose(along(body_axes(q), *v), to_body(q, v), **NEAR)


def test_products_follow_each_other_as_scipys_do_and_not_the_other_way_round():
    for a, b in zip(attitudes(50), attitudes(50, seed=2), strict=True):
        np.testing.assert_allclose(matrix(product(a, b)), matrix(a) @ matrix(b), **NEAR)
        assert abs(matrix(product(a, b)) - matrix(b) @ matrix(a)).max() > 1e-3


def test_small_and_large_turns_are_found_again():
    for q, turn in zip(attitudes(50), vectors(50, size=0.8), strict=True):
        np.testing.assert_allclose(
            matrix(exp(turn)), Rotation.from_rotvec(turn).as_matrix(), **NEAR
        )
        np.testing.assert_allclose(between(q, turned(q, turn)), turn, **NEAR)
        # -q is the same attitude
        np.testing.assert_allclose(log(tuple(-c for c in exp(turn))), turn, **NEAR)
    tiny = (1e-12, -2e-12, 0.0)
    np.testing.assert_allclose(log(exp(tiny)), tiny, rtol=1e-9)


def test_turning_at_a_rate_is_a_turn_by_rate_times_time_but_for_rounding():
    for q, rates in zip(attitudes(50), vectors(50, size=10.0), strict=True):
        after = turned_at(q, rates, 0.0025)
        np.testing.assert_allclose(after, turned(q, np.multiply(rates, 0.0025)), **NEAR)
        assert hypot(*after) == pytest.approx(1.0, abs=1e-15)
    assert turned_at((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0025) == (1.0, 0.0, 0.0, 0.0)


def test_the_rate_of_a_quaternion_is_how_it_changes():
    dt = 1e-7
    for q, rates in zip(attitudes(20), vectors(20), strict=True):
        slope = np.subtract(turned_at(q, rates, dt), turned_at(q, rates, -dt)) / (2 * dt)
        np.testing.assert_allclose(quaternion_rate(q, np.multiply(0.5, rates)), slope, atol=1e-7)


def test_euler_angles_are_yaw_then_pitch_then_roll():
    for yaw, pitch, roll in vectors(50, size=1.5):
        expected = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
        np.testing.assert_allclose(euler_matrix(yaw, pitch, roll), expected, **NEAR)
        np.testing.assert_allclose(matrix(from_euler(yaw, pitch, roll)), expected, **NEAR)
    np.testing.assert_allclose(from_yaw(0.7), from_euler(0.7, 0.0, 0.0), **NEAR)
    gate = Gate((0.0, 0.0, 2.0), radians(30), radians(-20), radians(10), (1.5, 1.5), 0.2)
    np.testing.assert_array_equal(gate.rotation, euler_matrix(gate.yaw, gate.pitch, gate.roll))


def test_skew_is_the_cross_product():
    for a, b in zip(vectors(20), vectors(20, seed=3), strict=True):
        np.testing.assert_allclose(skew(a) @ b, np.cross(a, b), **NEAR)


def test_plain_functions_take_rows_of_numbers():
    q, v = (np.array(part).T for part in zip(*CASES, strict=True))
    for k, (one_q, one_v) in enumerate(CASES):
        for function in (to_body, to_world):
            np.testing.assert_allclose(
                np.array(function(q, v))[:, k], function(one_q, one_v), **NEAR
            )
        np.testing.assert_allclose(np.array(body_axes(q))[:, k], body_axes(one_q), **NEAR)
        np.testing.assert_allclose(
            np.array(quaternion_rate(q, v))[:, k], quaternion_rate(one_q, one_v), **NEAR
        )


def test_plain_functions_take_symbols():
    casadi = pytest.importorskip("casadi")
    q, v = casadi.SX.sym("q", 4), casadi.SX.sym("v", 3)
    parts = tuple(casadi.vertsplit(q)), tuple(casadi.vertsplit(v))
    one_q, one_v = CASES[0]
    for function in (to_body, to_world, quaternion_rate):
        value = casadi.Function("f", [q, v], [casadi.vertcat(*function(*parts))])(one_q, one_v)
        np.testing.assert_allclose(np.array(value).ravel(), function(one_q, one_v), **NEAR)


def test_euler_angles_give_the_attitude_again_also_where_a_gate_points_up_or_down():
    straight_up = [from_euler(0.3, side * radians(90.0), 0.2) for side in (-1.0, 1.0)]
    for q in (*attitudes(200), *straight_up):
        yaw, pitch, roll = euler_angles(q)
        assert abs(pitch) <= radians(90.0)
        np.testing.assert_allclose(euler_matrix(yaw, pitch, roll), matrix(q), rtol=0, atol=1e-6)


def test_an_attitude_that_changes_its_sign_is_the_same_attitude_without_a_jump():
    angles = np.linspace(0.0, 4.0 * np.pi, 50)
    smooth = np.column_stack([np.cos(angles / 2), np.zeros((50, 2)), np.sin(angles / 2)])
    signs = np.where(np.arange(50) % 7 < 3, 1.0, -1.0)[:, None]
    np.testing.assert_array_equal(without_jumps(signs * smooth), smooth)
    np.testing.assert_array_equal(without_jumps(smooth), smooth)
    assert without_jumps(smooth[:0]).shape == (0, 4)
