"""The frame of a gate hides what lies behind it from the camera."""

from math import pi

import numpy as np
import pytest

from quadsim.course import Gate
from quadsim.sensing.visibility import hidden, hidden_corners

NEAR = Gate((5.0, 0.0, 2.0), 0.0, 0.0, 0.0, (2.0, 2.0), 0.3)
FAR = Gate((10.0, 0.0, 2.0), 0.0, 0.0, 0.0, (2.0, 2.0), 0.3)
EYE = np.array([0.0, 0.0, 2.0])


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ((10.0, 0.0, 2.0), False),  # through the opening
        ((10.0, 2.2, 2.0), True),  # the post stands at y = 1 to 1.3 half way
        ((10.0, 0.0, 4.2), True),  # the beam on top
        ((10.0, 3.0, 2.0), False),  # past the frame
        ((4.0, 0.9, 2.0), False),  # in front of it
        ((-10.0, -2.2, 2.0), False),  # behind the eye
        ((5.0, 1.15, 2.0), True),  # within the post
    ],
)
def test_a_bar_hides_what_lies_behind_it(point, expected):
    assert hidden(np.array([point]), EYE, [NEAR]).tolist() == [expected]


def test_a_turned_gate_hides_by_its_turned_bars():
    across = Gate((5.0, 0.0, 2.0), pi / 2, 0.0, 0.0, (2.0, 2.0), 0.3)  # seen along its plane
    assert hidden(np.array([(10.0, 0.0, 2.0), (10.0, 0.2, 2.0)]), EYE, [across]).tolist() == [
        True,
        False,
    ]


def test_corners_are_hidden_by_other_frames_only():
    # the far gate's left corners at y = 1 are seen at y = .375, its right at -.625
    aside = np.array([0.0, -0.25, 2.0])
    assert not hidden_corners([NEAR, FAR], aside).any()
    # its left corners lie behind the near gate's post
    wide = Gate((10.0, 0.0, 2.0), 0.0, 0.0, 0.0, (4.4, 2.0), 0.3)
    assert hidden_corners([NEAR, wide], EYE).tolist() == [[False] * 4, [True] * 4]
    assert hidden_corners([wide], EYE).tolist() == [[False] * 4]


@pytest.mark.slow
def test_samples_along_the_line_agree():
    rng = np.random.default_rng(0)
    points = np.column_stack([np.full(300, 9.0), rng.uniform(-3, 3, 300), rng.uniform(0, 5, 300)])
    turned = Gate((4.5, 0.2, 2.1), 0.4, 0.2, 0.3, (1.5, 1.2), 0.3)
    ways = EYE + np.linspace(0, 1, 4000)[:, None, None] * (points - EYE)  # (s, n, 3)
    local = (ways - turned.position) @ turned.rotation
    inside = [(np.abs(local - np.array(c)) <= h).all(axis=2).any(axis=0) for c, h in turned.bars]
    found = hidden(points, EYE, [turned])
    assert (found == np.any(inside, axis=0)).mean() > 0.99  # the samples may step over a bar's edge
    assert 20 < found.sum() < 280
