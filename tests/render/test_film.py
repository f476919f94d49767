"""A film: the eye is behind the vehicle, and the path is seen where nothing hides it."""

import numpy as np
import pytest
from PIL import Image

from quadsim.course import Course, Gate, Start
from quadsim.render.film import draw_path, film, views, write_film
from quadsim.render.poses import Pose
from quadsim.sensing.camera import Camera

CAMERA = Camera(64, 36, 34.0, 34.0, rate=20.0)
RADIUS = 0.2
SPEED = 10.0  # [m/s]


def circle(seconds=2.0, radius=10.0):
    """Return the telemetry of a level circle, counted from the east; the nose points east."""
    t = np.arange(0.0, seconds + 1e-9, 0.01)
    angle = SPEED / radius * t
    zero = 0.0 * t
    columns = {"t": t, "px": radius * np.cos(angle), "py": radius * np.sin(angle), "pz": zero + 3}
    columns |= {"vx": -SPEED * np.sin(angle), "vy": SPEED * np.cos(angle), "vz": zero}
    return columns | {"qw": zero + 1, "qx": zero, "qy": zero, "qz": zero}


def at_rest():
    """Return the telemetry of a vehicle that hovers at a place, with its nose to the east."""
    flight = circle()
    still = {name: np.full_like(flight["t"], flight[name][0]) for name in flight}
    return still | {"t": flight["t"], "vx": 0 * flight["t"], "vy": 0 * flight["t"]}


def test_the_eye_is_behind_and_above_the_vehicle_and_looks_at_it():
    found = views(circle(), 20.0, RADIUS)
    assert len(found) == 41
    for view in found:
        back = np.array(view.eye) - view.vehicle.p
        velocity = np.array([-view.vehicle.p[1], view.vehicle.p[0], 0.0])
        assert back @ velocity / np.linalg.norm(velocity) < -2.0
        assert 0.3 < back[2] < 1.0
        ((u, v),), depth = CAMERA.project(np.array([view.vehicle.p]), view.eye, view.attitude)
        assert 24 < u < 40
        assert 12 < v < 24
        assert 2.0 < depth[0] < 3.0


def test_a_vehicle_at_rest_is_seen_from_behind_its_nose():
    for view in views(at_rest(), 20.0, RADIUS):
        east, north, up = np.array(view.eye) - view.vehicle.p
        assert (east, north, up) == pytest.approx((-13 * RADIUS, 0.0, 3 * RADIUS))


def test_the_path_is_drawn_behind_the_vehicle_unless_something_hides_it():
    flight = circle()
    view = views(flight, 20.0, RADIUS)[-1]

    class Seen:
        """A picture of nothing, or of a wall before the eye."""

        def __init__(self, depth):
            self.depth = np.full((36, 64), depth, np.float32)

    drawn = {}
    for depth in (np.inf, 0.01):
        picture = Image.new("RGB", (64, 36))
        draw_path(picture, Seen(depth), CAMERA, view, flight, RADIUS)
        drawn[depth] = np.asarray(picture).any(axis=2)
    assert drawn[np.inf].sum() > 10
    assert not drawn[0.01].any()
    # What the vehicle has not flown yet is not drawn.
    first = view._replace(vehicle=Pose(0.0, view.vehicle.p, view.vehicle.q))
    picture = Image.new("RGB", (64, 36))
    draw_path(picture, Seen(np.inf), CAMERA, first, flight, RADIUS)
    assert not np.asarray(picture).any()


@pytest.mark.compiled
def test_a_film_has_its_pictures_in_their_size_and_shows_the_vehicle(tmp_path):
    gate = Gate((0.0, 10.0, 3.0), np.pi, 0.0, 0.0, (2.0, 2.0), 0.3)
    start = Start((10.0, 0.0, 3.0), 0.0)
    course = Course("one", "", (gate,), start, ((-50, 50),) * 3, False, 1, (), "")
    pictures = list(film(course, circle(), RADIUS, CAMERA, 3))
    # Its rotors are dark where nothing else of the scene is.
    assert [np.asarray(picture).max(axis=2).min() < 70 for picture in pictures] == [True] * 3
    for name in ("film.webp", "film.GIF"):
        write_film(pictures, CAMERA.rate, tmp_path / name)
        with Image.open(tmp_path / name) as read:
            assert (read.n_frames, read.size) == (3, (64, 36))
            read.seek(1)
            read.load()
            assert read.info["duration"] == 50
            assert read.info["loop"] == 0
