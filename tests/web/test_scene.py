"""Claims about where things are drawn in the view, and about the pace of the race."""

from dataclasses import replace

import numpy as np
import pytest
from web_cases import Clock, competitor

from quadsim.course import course_names, load_course
from quadsim.palette import NEXT, STYLES, Style
from quadsim.web.page.scene.camera import ASIDE, FOV, fpv, overview, top_view, towards
from quadsim.web.page.scene.drones import (
    INTO,
    OUT,
    SPAN,
    array_colour,
    decoded,
    encoded,
    quadrotor,
    ramp,
    resampled,
    segments,
    single_colour,
)
from quadsim.web.page.scene.race_scene import arrows, bars_of, visible_scale
from quadsim.web.race.lap_timing import lap_timings
from quadsim.web.race.pace import Pace
from quadsim.web.race.snapshot import Snapshot


@pytest.mark.parametrize("name", course_names())
@pytest.mark.parametrize("view", [overview, top_view])
@pytest.mark.parametrize(
    "size", [(900, 900), (572, 720), (390, 844)], ids=["1600 px", "1280 px", "a phone"]
)
def test_the_camera_frames_any_course(name, view, size):
    """All of it, and no smaller than need be."""
    course = load_course(name)
    eye, centre = view(course, size)
    forward = (centre - eye) / np.linalg.norm(centre - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    p = course.points() - eye  # the start, the corners of frames and obstacles
    x, y = (
        p @ axis / (p @ forward) / np.tan(FOV / 2) for axis in (right, np.cross(right, forward))
    )
    x *= size[1] / size[0]
    assert (p @ forward > 0).all()
    assert -1.0 < x.min() < x.max() < 1.0
    assert -1.0 < y.min() < y.max() < 1.0
    assert max(np.ptp(x) / 2.0, np.ptp(y) / 2.0) > 0.8


def test_the_drones_camera_looks_ahead_and_up_from_its_centre():
    """Level at yaw 90 degrees it looks north, 45 degrees up; its up direction is at right
    angles."""
    one = competitor(laps=1)
    x = one.x | {"qw": np.full(len(one.t), np.sqrt(0.5)), "qz": np.full(len(one.t), np.sqrt(0.5))}
    (s,) = lap_timings(Snapshot(t=0.5, end=9.0, competitors=(replace(one, x=x),)))
    (eye, ahead), up = fpv(s)
    assert np.allclose(eye, one.rows(("px", "py", "pz"), s.i))
    assert np.allclose(ahead - eye, [0.0, np.sqrt(0.5), np.sqrt(0.5)])
    assert np.allclose(up, [0.0, -np.sqrt(0.5), np.sqrt(0.5)])


def test_bars_leave_the_opening_free_and_touch_at_the_corners():
    gate = load_course("split_s_swift").gates[0]
    centres, sizes, _ = bars_of(gate)
    local = (centres - gate.position) @ gate.rotation  # gate frame
    inner_z = (abs(local[:2, 2]) - sizes[:2, 2] / 2).tolist()
    inner_y = (abs(local[2:, 1]) - sizes[2:, 1] / 2).tolist()
    assert inner_z == pytest.approx([gate.opening[1] / 2] * 2)
    assert inner_y == pytest.approx([gate.opening[0] / 2] * 2)


def test_a_drone_is_as_wide_as_it_is_said_to_be():
    meshes = quadrotor(1.0).values()
    vertices = np.vstack([mesh.vertices for mesh in meshes])
    assert np.ptp(vertices[:, 0]) == pytest.approx(1 / np.sqrt(2) + 2 * 0.26, rel=0.02)
    assert all(mesh.faces.max() < len(mesh.vertices) for mesh in meshes)


def test_resampled_paths_keep_their_ends():
    paths = np.random.default_rng(0).normal(size=(3, 16, 3))
    more = resampled(paths, 25)
    assert more.shape == (3, 25, 3)
    assert np.allclose(more[:, [0, -1]], paths[:, [0, -1]])
    assert segments(more[0]).shape == (24, 2, 3)


def test_brighter_is_more():
    light = ramp(np.linspace(0, 1, 20)).astype(float) @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(light) > 0).all()


def test_half_speed_takes_twice_as_long():
    clock = Clock()
    pace = Pace(clock)
    pace.speed = 0.5
    pace.anchor(0.0)
    clock.now += 1.0
    assert pace.now() == 0.5
    assert pace.until(1.0) == 1.0


def test_a_late_flight_does_not_catch_up():
    clock = Clock()
    pace = Pace(clock)
    clock.now += 5.0  # a plan that took 5 s
    assert pace.until(0.01) < 0.0
    assert pace.until(0.02) == pytest.approx(0.01)  # the next is due one period later, not at once


def test_the_factor_is_race_seconds_a_second():
    clock = Clock()
    pace = Pace(clock)
    for k in range(100):
        clock.now += 0.02
        pace.mark(0.01 * k)
    assert pace.factor == pytest.approx(0.5)


def shown(sent, linear):
    """The sRGB colour on the screen, as three.js maps it: exposure, Hill's fit of ACES,
    encoding."""
    light = np.asarray(sent) / 255 if linear else decoded(np.asarray(sent) / 255)
    v = INTO @ (light / 0.6)
    return 255 * encoded(
        np.clip(
            OUT
            @ ((v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.432951) + 0.238081)),
            0,
            1,
        )
    )


@pytest.mark.parametrize("colour", [s.colour for s in STYLES.values()] + [NEXT, "#ced2d8"])
def test_what_is_sent_looks_like_the_legend(colour):
    """Off by less than two colours differ where it cannot be shown, as no blue at all beside a
    bright orange."""
    rgb = Style(colour, ()).rgb
    assert abs(shown(array_colour(rgb), True) - rgb).max() < 42
    assert abs(shown(single_colour(rgb), False) - rgb).max() < 42
    assert abs(shown(array_colour(rgb), True) - rgb).mean() < 22


def test_sent_as_it_is_orange_would_look_pale():
    """The colour that was found in a screenshot."""
    assert shown((230, 159, 0), True) == pytest.approx([226, 209, 73], abs=1)


@pytest.mark.parametrize("name", course_names())
def test_drones_and_arrows_fit_through_the_narrowest_gate(name):
    course = load_course(name)
    opening = min(min(gate.opening) for gate in course.gates)
    assert SPAN * visible_scale(course) <= opening
    lengths = np.linalg.norm(np.diff(arrows(course), axis=1), axis=-1)
    assert lengths.max() <= 1.2 * max(opening, 0.01)


def test_a_scrubbed_competitor_is_as_it_was_then():
    whole = competitor(laps=2)
    t = whole.laps[0] + 0.05
    then = whole.until(t)
    assert then.laps == whole.laps[:1]
    assert then.outcome is None
    assert then.t[-1] <= t < whole.t[-1]
    assert then.events == tuple(e for e in whole.events if e.t <= t)
    assert whole.until(whole.t[-1]) is whole


def test_the_chasing_camera_turns_from_the_drone_towards_the_next_gate():
    """The drone stays in the picture, also where the gate is beside or behind it."""
    eye, p = np.array([0.0, 0.0, 1.3]), np.array([3.6, 0.0, 0.0])

    def angle(look_at, at):
        a, b = look_at - eye, np.array(at) - eye
        return np.arccos(np.clip(a @ b / np.linalg.norm(a) / np.linalg.norm(b), -1, 1))

    ahead = (20.0, 4.0, 0.0)
    middle = towards(eye, p, ahead)
    assert angle(middle, p) == pytest.approx(angle(middle, ahead))
    for gate in ((3.0, 20.0, 0.0), (-20.0, 1.0, 3.0)):
        look_at = towards(eye, p, gate)
        assert angle(look_at, p) == pytest.approx(ASIDE)
        assert angle(look_at, gate) < angle(p, gate)
    assert np.allclose(towards(eye, p, tuple(2 * p - eye)), p)
