"""The geometry of a gate's opening, held against spheres and boxes that know nothing of it."""

from dataclasses import replace
from itertools import pairwise
from math import radians

import numpy as np
import pytest

from quadsim.course import FRAME_DEPTH, Gate, InGate
from quadsim.course.opening import (
    HalfSizes,
    Offset,
    approach_length,
    between,
    beyond,
    crossing,
    distance_to_frame,
    free_half_sizes,
    half_depth,
    half_sizes,
    in_front,
    margin_inside,
    on_passage,
    outer_half_sizes,
    rectangle_corners,
)

RADIUS = 0.15
GATE = Gate((3.0, -2.0, 5.0), radians(40), radians(20), radians(15), (1.6, 1.2), 0.25)
NARROW = replace(GATE, opening=(0.4, 1.2))
TINY = replace(GATE, opening=(0.2, 0.25))  # the sphere does not fit


def points(n, seed=0):
    """Around a frame, in its own axes: most in or near the slab.  (n, 3)"""
    return np.random.default_rng(seed).uniform((-0.5, -1.5, -1.3), (0.5, 1.5, 1.3), (n, 3))


def boxes(gate):
    """The frame's four bars by their faces, written down anew: (low, high) in the gate's axes."""
    (w, h), bar, d = gate.opening, gate.frame_width, FRAME_DEPTH / 2
    right, left, low, high = -w / 2, w / 2, -h / 2, h / 2
    return [
        ((-d, right - bar, high), (d, left + bar, high + bar)),
        ((-d, right - bar, low - bar), (d, left + bar, low)),
        ((-d, left, low), (d, left + bar, high)),
        ((-d, right - bar, low), (d, right, high)),
    ]


def touches(p, gate, radius):
    """By the opening's geometry: in the slab and not in the free shaft."""
    outer = outer_half_sizes(gate.opening, gate.frame_width, radius)
    free = free_half_sizes(gate.opening, radius)
    in_slab = abs(p.along) < half_depth(radius) and beyond(p.offset, outer) < 0.0
    return in_slab and not beyond(p.offset, free) < 0.0


def outside(p, gate):
    """From a point to each bar along each axis, 0 within its faces.  (4, 3)"""
    return np.array(
        [np.maximum(np.maximum(low - p, p - high), 0.0) for low, high in map(np.array, boxes(gate))]
    )


@pytest.mark.slow
@pytest.mark.parametrize("gate", [GATE, NARROW, TINY])
def test_slab_without_shaft_is_the_four_bars_grown_as_boxes(gate):
    found = [touches(InGate(*p), gate, RADIUS) for p in points(4000).tolist()]
    in_a_grown_box = [(outside(p, gate) < RADIUS).all(axis=1).any() for p in points(4000)]
    assert found == in_a_grown_box
    assert set(found) == {True, False}


def test_slab_without_shaft_of_another_radius_is_not_the_grown_boxes():
    """The negative control of the claim above: a tenth of the radius is seen."""
    found = [touches(InGate(*p), GATE, 0.9 * RADIUS) for p in points(4000).tolist()]
    assert found != [(outside(p, GATE) < RADIUS).all(axis=1).any() for p in points(4000)]


@pytest.mark.parametrize("gate", [GATE, NARROW])
def test_no_overlap_of_a_sphere_is_missed_and_contact_is_at_most_three_quarters_of_a_radius_early(
    gate,
):
    distances = np.array([np.linalg.norm(outside(p, gate), axis=1).min() for p in points(4000, 1)])
    found = np.array([touches(InGate(*p), gate, RADIUS) for p in points(4000, 1).tolist()])
    assert found[distances < RADIUS].all()
    assert not found[distances > np.sqrt(3.0) * RADIUS].any()
    assert (found & (distances > RADIUS)).any()  # at edges, where a sphere would round them


def test_where_the_sphere_does_not_fit_no_half_size_is_free():
    assert max(free_half_sizes(TINY.opening, RADIUS)) < 0.0
    assert free_half_sizes(NARROW.opening, RADIUS) == pytest.approx((0.05, 0.45))


def test_a_margin_is_a_larger_sphere():
    for margin in (0.0, 0.02, 0.3):
        larger = RADIUS + margin
        assert free_half_sizes(GATE.opening, RADIUS, margin) == pytest.approx(
            free_half_sizes(GATE.opening, larger)
        )
        outer = outer_half_sizes(GATE.opening, 0.25, RADIUS, margin)
        assert outer == pytest.approx(outer_half_sizes(GATE.opening, 0.25, larger))
        assert half_depth(RADIUS, margin) == pytest.approx(half_depth(larger))


@pytest.mark.parametrize(
    "free", [HalfSizes(0.65, 0.45), HalfSizes(0.05, 0.45), HalfSizes(0.4, 0.01)]
)
def test_a_margin_inside_takes_what_is_wanted_and_never_more_than_half_of_the_room(free):
    for wanted in (0.0, 0.004, 0.02, 0.3):
        margin = margin_inside(free, wanted)
        assert margin == wanted or margin == pytest.approx(min(free) / 2)
        assert margin <= wanted
        assert min(free) - margin >= min(free) / 2


def test_the_distance_to_the_frame_is_that_to_the_nearest_of_many_points_on_it():
    step = 0.02
    y, z = (
        a.ravel() for a in np.meshgrid(np.arange(-1.05, 1.051, step), np.arange(-0.85, 0.851, step))
    )
    on_frame = (abs(y) >= 0.8 - 1e-9) | (abs(z) >= 0.6 - 1e-9)
    flat = np.column_stack([0.0 * y, y, z])[on_frame]
    for p in points(300, 2):
        nearest = np.linalg.norm(flat - p, axis=1).min()
        found = distance_to_frame(InGate(*p.tolist()), GATE.opening, GATE.frame_width)
        assert found <= nearest + 1e-9
        assert found >= nearest - step


def test_the_passage_is_the_rectangle_around_the_bars():
    faces = np.array(boxes(GATE))  # (4, 2, 3)
    low, high = faces[:, 0].min(axis=0), faces[:, 1].max(axis=0)
    on_it = [
        on_passage(Offset(y, z), GATE.opening, GATE.frame_width)
        for _, y, z in points(2000, 3).tolist()
    ]
    assert on_it == [
        bool((low[1:] <= p[1:]).all() and (p[1:] <= high[1:]).all()) for p in points(2000, 3)
    ]
    assert set(on_it) == {True, False}


def test_the_bars_of_a_gate_are_those_of_its_faces():
    for bar, (low, high) in zip(GATE.bars, boxes(GATE), strict=True):
        np.testing.assert_allclose(np.subtract(bar.centre, bar.half), low, atol=1e-12)
        np.testing.assert_allclose(np.add(bar.centre, bar.half), high, atol=1e-12)


def test_corners_are_where_free_begins_for_a_point_and_go_from_lower_right_to_upper_left():
    corners = rectangle_corners(half_sizes(GATE.opening))
    # left and up
    np.testing.assert_array_equal(np.sign(corners[:, 1:]), [(-1, -1), (-1, 1), (1, -1), (1, 1)])
    for along, left, up in corners.tolist():
        assert along == 0.0
        assert beyond(Offset(left, up), free_half_sizes(GATE.opening, 0.0)) == 0.0


def test_a_crossing_lies_on_the_plane_and_reversed_it_is_the_same_the_other_way_round():
    found = 0
    for a, b in zip(points(500, 4).tolist(), points(500, 5).tolist(), strict=True):
        a, b = InGate(*a), InGate(*b)
        there, back = crossing(a, b), crossing(b, a)
        if in_front(a) == in_front(b):
            assert there is None
            assert back is None
            continue
        found += 1
        assert between(a, b, there.fraction) == pytest.approx((0.0, *there.offset), abs=1e-12)
        assert there.forward == in_front(a) != back.forward
        assert back.fraction == pytest.approx(1.0 - there.fraction)
        assert back.offset == pytest.approx(there.offset)
    assert found > 100


@pytest.mark.parametrize(
    "along", [(-1.0, 0.0, 1.0), (-1.0, -0.0, 0.0, 2.0), (-1.0, -1e-300, 1.0), (-2.0, 3.0)]
)
def test_a_path_through_the_plane_crosses_it_once_wherever_its_points_lie(along):
    path = [InGate(x, 0.1, 0.2) for x in along]
    crossings = [crossing(a, b) for a, b in pairwise(path)]
    assert [c.forward for c in crossings if c] == [True]
    backward = [crossing(b, a) for a, b in pairwise(path)]
    assert [c.forward for c in backward if c] == [False]


def test_the_approach_begins_as_far_in_front_as_the_opening_is_large():
    assert approach_length((1.6, 1.2)) == approach_length((1.2, 1.6)) == 1.6


def test_a_point_comes_back_from_the_gate_frame_and_rows_are_points():
    world = points(50, 6) + GATE.position
    rows = GATE.to_local_rows(world)
    for k, p in enumerate(world.tolist()):
        local = GATE.to_local(tuple(p))
        assert GATE.to_world(local) == pytest.approx(p)
        assert (rows.along[k], rows.left[k], rows.up[k]) == pytest.approx(local)
    ahead = GATE.to_world(InGate(1.0, 0.0, 0.0))
    assert np.subtract(ahead, GATE.position) == pytest.approx(GATE.rotation[:, 0])
