"""A vehicle from a few numbers: it has them, the rest follows the laws of its comments."""

from math import hypot, sqrt

import pytest

from quadsim.cli.cli import race
from quadsim.files.values import SettingError
from quadsim.vehicle import GRAVITY, load_vehicle, parse_vehicle
from quadsim.vehicle.scaling import PROPELLERS, KnownNumbers, diameter, scaled_vehicle
from tests.small import flags

GIVEN = {"mass": 0.6, "thrust_to_weight": 5.0, "arm": 0.11, "propeller": 0.127}


def scaled(**changes):
    """Return the vehicle of the given numbers with changes of some."""
    return scaled_vehicle(KnownNumbers(**GIVEN | changes), "myquad").vehicle


def test_it_has_the_given_numbers_and_every_number_has_a_source():
    made = scaled_vehicle(KnownNumbers(**GIVEN), "myquad")
    vehicle = made.vehicle
    assert vehicle.mass == 0.6
    assert vehicle.thrust_to_weight == pytest.approx(5.0, rel=1e-3)
    assert hypot(*vehicle.rotors.positions[0]) == pytest.approx(0.11)
    text = made.to_yaml()
    assert parse_vehicle(text, "myquad.yaml") == vehicle
    for line in text.splitlines():
        if line not in ("rotors:",) and not line.startswith("source:"):
            assert "  # " in line, line


def test_inertia_thrust_and_torque_follow_their_laws():
    one = scaled()
    heavy = scaled(mass=0.9)
    wide = scaled(arm=0.132)
    large = scaled(propeller=0.1524)
    for axis in range(3):
        assert heavy.inertia[axis] == pytest.approx(1.5 * one.inertia[axis], rel=1e-3)
        assert wide.inertia[axis] == pytest.approx(1.2**2 * one.inertia[axis], rel=1e-3)
    assert large.rotors.thrust_map[0] == pytest.approx(1.2**4 * one.rotors.thrust_map[0], rel=1e-3)
    assert large.rotors.kappa == pytest.approx(1.2 * one.rotors.kappa, rel=1e-3)
    # Larger propellers turn more slowly for the same thrust.
    assert large.rotors.motor_omega_max == pytest.approx(
        one.rotors.motor_omega_max / 1.2**2, rel=1e-3
    )
    assert scaled(thrust_to_weight=2.5).rotors.motor_omega_max == pytest.approx(
        one.rotors.motor_omega_max / sqrt(2.0), rel=1e-3
    )


@pytest.mark.parametrize("name", PROPELLERS)
def test_a_shipped_vehicle_that_is_scaled_to_itself_is_that_vehicle(name):
    base = load_vehicle(name)
    known = KnownNumbers(
        mass=base.mass,
        thrust_to_weight=base.thrust_to_weight,
        arm=hypot(*base.rotors.positions[0]),
        propeller=PROPELLERS[name],
    )
    vehicle = scaled_vehicle(known, name).vehicle
    assert vehicle.rotors.thrust_map == pytest.approx(base.rotors.thrust_map, rel=1e-3)
    assert vehicle.rotors.motor_omega_max == pytest.approx(base.rotors.motor_omega_max, rel=1e-3)
    assert vehicle.rate_tau == base.rate_tau
    # Rotors stand on a square: inertia about x and y are one.
    mean = 0.5 * (base.inertia[0] + base.inertia[1])
    assert vehicle.inertia == pytest.approx((mean, mean, base.inertia[2]), rel=1e-3)


def test_the_thrust_of_propellers_of_one_vehicle_predicts_the_others():
    """The claim of the fourth power: 12 % and 7 % off, over a factor of 2.8 in the diameter."""
    kingfisher, kolibri, crazyflie = (load_vehicle(name).rotors for name in PROPELLERS)
    sizes = PROPELLERS

    def predicted(name):
        return kingfisher.thrust_map[0] * (sizes[name] / sizes["kingfisher"]) ** 4

    assert predicted("kolibri") == pytest.approx(kolibri.thrust_map[0], rel=0.13)
    assert predicted("crazyflie") == pytest.approx(crazyflie.thrust_map[0], rel=0.08)


def test_two_numbers_are_enough():
    for mass in (0.027, 0.1, 0.22, 0.6, 1.2):
        vehicle = scaled_vehicle(KnownNumbers(mass=mass, thrust_to_weight=3.0), "two").vehicle
        assert vehicle.thrust_max == pytest.approx(3.0 * GRAVITY, rel=1e-3)
        assert 0.02 < hypot(*vehicle.rotors.positions[0]) < 0.2


@pytest.mark.parametrize(
    ("text", "metres"),
    [("5in", 0.127), ("5 inch", 0.127), ('3"', 0.0762), ("127mm", 0.127), (".127m", 0.127)],
)
def test_a_diameter_is_written_with_its_unit(text, metres):
    assert diameter(text) == pytest.approx(metres)


@pytest.mark.parametrize("text", ["5", "in", "", "5 furlongs", "5.5.5in"])
def test_a_diameter_without_unit_is_refused(text):
    with pytest.raises(SettingError, match="prop: expected the diameter"):
        diameter(text)


def test_the_command_writes_a_file_once(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    known = {"mass": 0.6, "thrust_to_weight": 5, "arm": 0.11, "prop": "5in", "name": "myquad"}
    words = ["vehicle", *flags(known)]
    assert race(words) == 0
    assert load_vehicle("myquad.yaml") == scaled()
    assert race(["check", "myquad.yaml"]) == 0
    out, _ = capsys.readouterr()
    for line in out.splitlines():
        assert "thrust-to-weight 5.00, hovers at 45 % of full rotor speed" in line
        assert "top speed 120 m/s by its linear drag" in line
    assert race(words) == 2
    assert race(["vehicle", *flags(known | {"mass": 60})]) == 2
    refused, out_of_range = capsys.readouterr().err.splitlines()
    assert refused.startswith("race vehicle: 'myquad.yaml': expected the name of a new file")
    assert out_of_range.startswith("race vehicle: --mass: expected a number [kg]")
