"""`race serve` reads its flags before it binds a socket."""

import pytest

from quadsim.cli.cli import race
from quadsim.cli.serve import _camera
from quadsim.mavlink.udp_link import address_of


@pytest.mark.parametrize(
    ("name", "given", "width"),
    [
        (None, {}, 640),
        (None, {"competition": "aigp_physical"}, 1920),
        (None, {"competition": "aigp_physical", "sensing": "perfect"}, 1920),
        (None, {"sensing": "aigp_physical"}, 1920),
        ("aigp", {"competition": "aigp_physical"}, 640),
        ("aigp_physical", {}, 1920),
        ("none", {"competition": "aigp_physical"}, None),
    ],
)
def test_the_pictures_are_of_the_competitions_lens_unless_another_is_named(name, given, width):
    camera = _camera(name, given)
    assert (camera and camera.width) == width


def test_a_set_of_sensors_without_a_camera_is_one_line(capsys):
    assert race(["serve", "--camera", "mocap"]) == 2
    assert capsys.readouterr().err.startswith("race serve: mocap: expected a set of sensors with")


@pytest.mark.parametrize("host", ["", "a..b", 70 * "x", "::1", "0.0.0.0", "224.0.0.1"])
def test_a_client_without_an_address_is_one_line(host, capsys):
    """An empty text, as of a variable that is not set, opened the simulator to the network."""
    assert race(["serve", "figure8", "--camera", "none", "--client", host]) == 2
    err = capsys.readouterr().err
    assert err.startswith(
        "race serve: --client: expected the name or the IPv4 address of a machine"
    )
    assert err.count("\n") == 1


def test_loopback_is_an_address():
    assert address_of("localhost") == "127.0.0.1"
