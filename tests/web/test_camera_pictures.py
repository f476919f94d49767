"""Claims about the pictures of a drone's camera on the page: what they show, and who draws them."""

import io
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from PIL import Image
from web_cases import competitor, until

from quadsim.config.spec import Spec
from quadsim.sensing.config import GateCameraConfig
from quadsim.sensing.measurements import Corners
from quadsim.web.page.parts.elements import to_html
from quadsim.web.page.parts.pictures import shown_picture
from quadsim.web.race.camera_pictures import (
    At,
    CameraPictures,
    camera_of,
    moment_of,
    pose_at,
    smaller,
)

A, B, C = 1, 2, 3  # visitors
T = 0.203  # between two frames [s]


@pytest.fixture(scope="module")
def entry():
    """A flight with the gate camera."""
    plain = competitor()
    sensing = Spec.of("figure8", sensing="gates").record()["sensing"]
    return plain.with_record({**plain.record, "sensing": sensing})


@pytest.fixture(scope="module")
def pictures():
    pictures = CameraPictures()
    yield pictures
    pictures.close()


def taken(pictures, entry, t):
    """The picture of a moment, in place of the last one."""
    pictures.last = {}

    def is_there():
        pictures.show({A: At(entry, t)})
        return A in pictures.last

    assert until(is_there)
    assert pictures.last[A].problem == ""
    return pictures.last[A]


def corners_at(entry, t):
    """What a camera without errors finds."""
    camera = camera_of(entry)
    pixels, depth = camera.gate_corners(entry.course.gates, *pose_at(entry, t))
    seen = (depth > 0.5) & camera.in_picture(pixels.reshape(-1, 2)).reshape(-1, 4)
    gates, corners = np.nonzero(seen)
    return Corners(t, gates, corners, pixels[seen], int(seen.sum()))


@pytest.mark.process
def test_corners_that_were_found_lie_on_the_gates_of_the_picture(entry, pictures):
    """Inside the opening is ground or sky, and just outside the corner the orange frame."""
    found = corners_at(entry, T)
    picture = taken(pictures, replace(entry, corners=found), T + 0.02)
    assert picture.moment.t == T  # of the camera's own picture, not of the page
    image = np.asarray(Image.open(io.BytesIO(picture.jpeg))).astype(int)
    scale = image.shape[1] / picture.moment.size[0]
    camera = camera_of(entry)
    position, attitude = pose_at(entry, T)
    orange = []
    for number in set(found.gates.tolist()):
        gate = entry.course.gates[number]
        centre = gate.corners().mean(axis=0)
        outside = centre + 1.06 * (gate.corners() - centre)
        pixels, depth = camera.project(outside, position, attitude)
        near = (depth > 0.5) & (depth < 8.0) & camera.in_picture(pixels)
        for u, v in (scale * pixels[near]).astype(int):
            red, green, blue = image[v, u]
            orange.append(red > 1.3 * green > 1.3 * blue)
    assert len(orange) >= 2
    assert np.mean(orange) > 0.6
    html = to_html(shown_picture(picture))
    assert html.count("<line") == 2 * len(found.pixels)
    u, v = found.pixels[0]
    assert f'x1="{u - 6:.1f}" y1="{v - 6:.1f}"' in html


def test_corners_of_another_moment_are_not_drawn(entry):
    found = corners_at(entry, T)
    later = moment_of(replace(entry, corners=found), T + 0.3)
    assert later.corners is None
    assert later.t == T + 0.3
    earlier = moment_of(replace(entry, corners=found), T - 0.05)
    assert earlier.corners is None


@pytest.mark.process
def test_whoever_asks_does_not_wait(entry, pictures, monkeypatch):
    """A picture that was asked for is there in one of the calls after that."""
    monkeypatch.setattr("quadsim.web.race.camera_pictures.PERIOD", 0.0)
    for t in (0.1, 0.2):
        before = pictures.last
        pictures.show({A: At(entry, t)})
        assert pictures.last == before
        assert taken(pictures, entry, t).moment.t == t


@pytest.mark.process
def test_each_visitor_has_pictures_of_what_it_watches(entry, pictures, monkeypatch):
    """Two who watch the same share one picture, and nobody waits for ever."""
    monkeypatch.setattr("quadsim.web.race.camera_pictures.PERIOD", 0.0)
    pictures.last = {}
    wanted = {A: At(entry, 0.3), B: At(entry, 0.4), C: At(entry, 0.3)}
    for _ in range(2):

        def are_there(wanted=wanted):
            pictures.show(wanted)
            shown = {one: picture.moment.t for one, picture in pictures.last.items()}
            return shown == {one: at.t for one, at in wanted.items()}

        assert until(are_there)
        assert pictures.last[A] is pictures.last[C]
        wanted = {one: At(entry, at.t + 0.2) for one, at in wanted.items()}


@pytest.mark.process
def test_a_process_that_was_killed_is_said_and_replaced(entry, pictures):
    taken(pictures, entry, 0.1)
    pictures._process.kill()
    pictures._process.join()

    def is_said():
        pictures.show({A: At(entry, 0.5)})
        return pictures.last[A].problem

    assert until(is_said)
    assert "has ended" in pictures.last[A].problem
    assert "has ended" in to_html(shown_picture(pictures.last[A]))
    assert taken(pictures, entry, 0.6).jpeg


def test_a_flight_without_a_camera_is_seen_by_that_of_race_render():
    plain = competitor()
    assert camera_of(plain).source == "AI Grand Prix"
    assert camera_of(plain).tilt_deg == 20


def test_a_smaller_picture_has_the_same_field_of_view():
    spec = {"width": 641, "height": 360, "fx": 300.0, "fy": 310.0, "tilt_deg": 10.0}
    camera = msgspec.convert(spec, GateCameraConfig)
    small = smaller(camera)
    assert small.width <= 400
    assert small.width / small.fx == pytest.approx(camera.width / camera.fx)
    assert small.height / small.fy == pytest.approx(camera.height / camera.fy)
