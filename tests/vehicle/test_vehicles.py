"""Every vehicle that comes with the project can fly; a file that describes none says where and
why."""

from dataclasses import fields, replace

import numpy as np
import pytest

from quadsim.cli.cli import race
from quadsim.course import FRAME_DEPTH
from quadsim.course.checks import ROOM
from quadsim.files.strict_yaml import FileError
from quadsim.files.values import SettingError
from quadsim.vehicle import (
    GRAVITY,
    load_vehicle,
    parse_vehicle,
    vehicle_names,
    with_thrust_to_weight,
)
from quadsim.vehicle.vehicle import RotorChanges, Rotors, VehicleChanges, VehicleFile

BARE = """\
mass: 1
inertia: [0.01, 0.01, 0.02]
radius: 0.15
rate_tau: [0.25, 0.25, 0.25]
omega_max: [6, 6, 6]
"""
SIMPLE = BARE + "thrust_max: 36\n"
ROTORS = (
    BARE
    + """\
rotors:
  arm_l: 0.1414213562373095
  motor_omega_min: 100
  motor_omega_max: 2000
  motor_tau: 0.03
  thrust_map: [2e-6, 0, 0]
  kappa: 0.02
"""
)
BAD = [
    (SIMPLE, "mass: 1", "mass: 0", "1:7: mass: expected"),
    (
        SIMPLE,
        "0.02]",
        "-0.02]",
        "2:23: inertia[2]: expected",
    ),
    (
        SIMPLE,
        "rate_tau: [0.25",
        "rate_tau: [-1",
        "4:12: rate_tau[0]: expected",
    ),
    (SIMPLE, "mass: 1", "weight: 1", "1:1: weight: unknown key"),
    (
        SIMPLE,
        "mass: 1",
        "motor_tau: 0.03\nmass: 1",
        "1:1: motor_tau: unknown key, it belongs under 'rotors'",
    ),
    (SIMPLE, "radius: 0.15\n", "", "1:1: radius: missing"),
    (
        SIMPLE,
        "mass: 1",
        "mass: 1\nlatency: 0.6",
        "2:10: latency: expected",
    ),
    (
        SIMPLE,
        "thrust_max: 36",
        "thrust_max: 9.8",
        "6:13: thrust_max: cannot hover",
    ),
    (
        SIMPLE,
        "thrust_max: 36\n",
        "",
        "1:1: thrust_max: missing",
    ),
    (
        SIMPLE,
        "0.02]",
        "0.021]",
        "2:10: inertia: expected",
    ),
    (
        ROTORS,
        "mass: 1",
        "thrust_max: 36\nmass: 1",
        "1:13: thrust_max: expected",
    ),
    (
        ROTORS,
        "mass: 1",
        "mass: 4",
        "7:3: rotors: cannot hover",
    ),
    (
        ROTORS,
        "motor_omega_min: 100",
        "motor_omega_min: 1200",
        "7:3: rotors: cannot descend",
    ),
    (
        ROTORS,
        "motor_omega_max: 2000",
        "motor_omega_max: 90",
        "9:20: rotors.motor_omega_max: expected",
    ),
    (
        ROTORS,
        "  arm_l: 0.1414213562373095\n",
        "  rotor_x: 0.1\n",
        "7:3: rotors: expected",
    ),
    (
        ROTORS,
        "  arm_l",
        "  rotor_x: 0.1\n  arm_l",
        "7:3: rotors: expected",
    ),
    (
        ROTORS,
        "[2e-6, 0, 0]",
        "[2e-6, -0.1, 0]",
        "11:15: rotors.thrust_map: expected",
    ),
    (
        ROTORS,
        "[2e-6, 0, 0]",
        "[2e-6, 0]",
        "11:15: rotors.thrust_map: expected",
    ),
    (
        ROTORS,
        "motor_tau: 0.03",
        "motor_tau: -1",
        "10:14: rotors.motor_tau: expected",
    ),
    (
        ROTORS,
        "kappa: 0.02",
        "kappa: 0",
        "12:10: rotors.kappa: expected",
    ),
]
ALL = [load_vehicle(name) for name in vehicle_names()]


def test_each_fault_of_a_vehicle_is_one_line_with_its_place_and_key():
    for text, old, new, message in BAD:
        assert old in text
        with pytest.raises(FileError) as error:
            parse_vehicle(text.replace(old, new, 1), "mine.yaml")
        assert str(error.value).startswith(f"mine.yaml:{message}")
        assert "\n" not in str(error.value)


def test_a_vehicle_without_rotors_has_the_numbers_of_its_file():
    vehicle = parse_vehicle(SIMPLE, "folder/mine.yaml")
    assert (vehicle.name, vehicle.mass, vehicle.inertia, vehicle.radius) == (
        "mine",
        1.0,
        (0.01, 0.01, 0.02),
        0.15,
    )
    assert (vehicle.rate_tau, vehicle.omega_max, vehicle.thrust_max) == (
        (0.25,) * 3,
        (6.0,) * 3,
        36.0,
    )
    assert (vehicle.drag, vehicle.latency, vehicle.rotors) == ((0.0,) * 3, 0.0, None)


def test_thrust_max_of_rotors_is_four_times_the_map_at_full_speed_over_mass():
    assert parse_vehicle(
        ROTORS.replace("mass: 1", "mass: 2"), "mine.yaml"
    ).thrust_max == pytest.approx(4 * 8.0 / 2)


def test_arm_l_is_the_diagonal_of_a_square():
    square = parse_vehicle(ROTORS, "mine.yaml").rotors
    oblong = parse_vehicle(
        ROTORS.replace("arm_l: 0.1414213562373095", "rotor_x: 0.1\n  rotor_y: 0.1"), "mine.yaml"
    ).rotors
    assert square is not None
    assert oblong is not None
    np.testing.assert_allclose(square.positions, oblong.positions)


def test_a_misspelt_name_gets_the_nearest_vehicle():
    with pytest.raises(FileError) as error:
        load_vehicle("kingfischer")
    assert (
        str(error.value)
        == "no vehicle 'kingfischer': did you mean 'kingfisher'? (race vehicles lists them)"
    )


def test_the_folder_holds_the_vehicles_that_are_named_elsewhere():
    assert {"cpc", "flightmare", "kingfisher", "paper", "swift"} <= set(vehicle_names())


def test_every_vehicle_hovers_with_thrust_to_spare():
    for vehicle in ALL:
        assert vehicle.source, vehicle.name
        assert vehicle.thrust_max > 1.5 * GRAVITY, vehicle.name


def test_every_vehicle_stands_free_at_every_start():
    for vehicle in ALL:
        assert vehicle.radius + FRAME_DEPTH / 2 <= ROOM, vehicle.name


def test_every_vehicles_inertia_is_that_of_a_body():
    for vehicle in ALL:
        small, middle, large = sorted(vehicle.inertia)
        assert 0.0 < large <= small + middle, vehicle.name


def test_an_inertia_that_no_such_body_has_is_remarked_on(tmp_path, capsys):
    file = tmp_path / "mine.yaml"
    text = SIMPLE.replace("mass: 1", "mass: 0.65").replace("0.15", "0.2")
    file.write_text(text.replace("[0.01, 0.01, 0.02]", "[3, 3, 5]"))
    assert race(["check", str(file)]) == 0
    err = capsys.readouterr().err
    assert "expected at most 0.104 kg m^2 (mass 0.65 kg x (2 x radius 0.2 m)^2)" in err
    assert err.endswith(", got [3, 3, 5]\n")
    file.write_text(text)
    assert race(["check", str(file), *vehicle_names()]) == 0
    assert capsys.readouterr().err == ""


def test_rotors_balance_in_hover_and_turn_every_way():
    """Equal thrusts give no torque; the map from thrusts to (collective, torque) is invertible."""
    assert [vehicle.name for vehicle in ALL if vehicle.rotors is None] == ["paper"]
    for rotors in filter(None, (vehicle.rotors for vehicle in ALL)):
        x, y = np.transpose(rotors.positions)
        # (4, 4)
        mixer = np.array([np.ones(4), y, -x, rotors.kappa * np.array(rotors.spin)])
        np.testing.assert_allclose(mixer @ np.ones(4), [4, 0, 0, 0], atol=1e-12)
        assert np.linalg.matrix_rank(mixer) == 4


def test_full_thrust_is_the_published_one():
    for name, newton_per_rotor, ratio in (
        ("flightmare", 11.22, 6.27),
        ("kingfisher", 8.5, 4.62),
        ("swift", 8.75, 4.1),
        ("cpc", 6.88, 3.3),
    ):
        vehicle = load_vehicle(name)
        assert vehicle.thrust_max * vehicle.mass / 4 == pytest.approx(newton_per_rotor, abs=0.005)
        assert vehicle.thrust_max / GRAVITY == pytest.approx(ratio, abs=0.005), name


def test_flightmares_inertia_is_its_formula():
    vehicle = load_vehicle("flightmare")
    formula = vehicle.mass / 12 * 0.17**2 * np.array([4.5, 4.5, 7])
    np.testing.assert_allclose(vehicle.inertia, formula, rtol=1e-5)


def test_rotor_speed_inverts_a_thrust_map_that_is_negative_at_idle():
    rotors = load_vehicle("flightmare").rotors
    assert rotors.thrust(150.0) < 0
    for thrust in (0.0, 1.79, 11.22):
        assert rotors.thrust(rotors.speed(thrust)) == pytest.approx(thrust, abs=1e-12)


def test_a_vehicle_written_as_yaml_reads_back_equal(tmp_path):
    for vehicle in ALL:
        file = tmp_path / f"{vehicle.name}.yaml"
        assert parse_vehicle(vehicle.to_yaml(file), file.name) == vehicle
        assert load_vehicle(file) == vehicle
        assert vehicle.but() == vehicle


@pytest.mark.slow
def test_a_changed_vehicle_reads_back_equal():
    rng = np.random.default_rng(0)
    for number in range(20):
        arm = rng.uniform(0.05, 0.3)
        square, oblong = {"arm_l": arm}, {"rotor_x": arm, "rotor_y": rng.uniform(0.05, 0.3)}
        rotors = {"motor_tau": rng.uniform(0, 0.1), "kappa": rng.uniform(0.01, 0.1)}
        vehicle = load_vehicle("swift").but(
            name="drawn",
            source='a "source": \\ with # signs, \n two lines and é',
            mass=rng.uniform(0.5, 2.0),
            drag=rng.uniform(0, 1, 3),
            latency=np.float32(0.1),
            rotors=rotors | (square if number % 2 else oblong),
        )
        assert parse_vehicle(vehicle.to_yaml(), "drawn.yaml") == vehicle
        assert vehicle.but(rotors=vehicle.rotors) == vehicle


def test_a_heavier_vehicle_has_the_thrust_of_its_rotors():
    swift = load_vehicle("swift")
    heavy = swift.but(mass=2 * swift.mass, name="heavy")
    assert heavy.rotors == swift.rotors
    assert heavy.thrust_to_weight == pytest.approx(swift.thrust_to_weight / 2)
    assert (heavy.name, swift.but(mass=1).name) == ("heavy", "swift")
    bare = swift.but(rotors=None)
    assert (bare.rotors, bare.thrust_max) == (None, swift.thrust_max)
    assert bare.but(mass=2 * swift.mass).thrust_max == swift.thrust_max
    assert bare.but(rotors=swift.rotors) == swift


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"mass": -1}, r"mass: expected a number \[kg\] > 0"),
        ({"mass": "heavy"}, r"mass: expected a number \[kg\], got the quoted text 'heavy'"),
        ({"mass": object()}, "mass: expected"),
        ({"mass": np.nan}, "mass: expected a number"),
        ({"mass": 5.0}, "rotors: cannot hover"),
        ({"mas": 1}, "mas: unknown key, did you mean 'mass'"),
        ({"drag": 0.3}, "drag: expected 3 numbers"),
        ({"rate_max": (1, 2, 3)}, "rate_max: unknown key, did you mean"),
        ({"rotors": {"tau": 1}}, r"rotors\.tau: unknown key"),
        ({"rotors": {"motor_taus": 1}}, r"rotors\.motor_taus: unknown key, did you mean"),
        ({"rotors": 3}, "rotors: expected a mapping"),
        ({"thrust_max": 20}, "thrust_max: expected none beside rotors"),
    ],
)
def test_a_change_that_cannot_be_used_is_one_line_with_its_key(changes, problem):
    with pytest.raises(SettingError, match=f"^{problem}") as caught:
        load_vehicle("swift").but(**changes)
    assert "\n" not in str(caught.value)


def test_a_vehicle_that_no_file_holds_is_not_written(tmp_path):
    swift = load_vehicle("swift")
    inconsistent = replace(swift, mass=0.9)
    with pytest.raises(SettingError, match=r"^thrust_max: expected 38\.8"):
        inconsistent.to_yaml(tmp_path / "mine.yaml")
    odd = replace(swift.rotors, rotor_x=0.1)
    with pytest.raises(SettingError, match=r"^rotors: expected either arm_l"):
        replace(swift, rotors=odd).to_yaml(tmp_path / "mine.yaml")
    assert not list(tmp_path.iterdir())
    with pytest.raises(FileError, match="no such file"):
        swift.to_yaml(tmp_path / "none" / "mine.yaml")


def test_the_keywords_of_a_change_are_the_keys_of_a_file():
    assert VehicleChanges.__optional_keys__ == {"name", *(f.name for f in fields(VehicleFile))}
    assert RotorChanges.__optional_keys__ == {f.name for f in fields(Rotors)}


def test_the_name_of_a_vehicle_with_another_thrust_stands_for_it():
    scaled = with_thrust_to_weight(load_vehicle("swift"), 6.4)
    assert scaled.name == "swift-twr6.4"
    assert load_vehicle("swift-twr6.4") == scaled
    with pytest.raises(FileError, match="no vehicle 'none'"):
        load_vehicle("none-twr6.4")
    with pytest.raises(FileError, match=r"no vehicle 'swift-twr0\.5'"):
        load_vehicle("swift-twr0.5")
