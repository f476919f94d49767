"""The fit of a vehicle: known numbers are found again, and what a log cannot tell is said."""

from dataclasses import replace

import numpy as np
import pytest

import quadsim
from quadsim.files.values import SettingError
from quadsim.identify import fit_vehicle
from quadsim.identify.numbers import FitNumbers
from quadsim.identify.plausible import expect_plausible
from quadsim.identify.stages import is_rotor
from quadsim.identify.to_vehicle import FittedNumber, FoundNumbers, fitted_vehicle
from quadsim.vehicle import load_vehicle, parse_vehicle
from tests.identify.fit_cases import LATE, TRUE, flight, noisy

OTHER = load_vehicle("swift")
# Moments of a flat body, jz = jx + jy, which are not one's after each was rounded to five digits
FLAT = (0.002728745, 0.0009463649, 0.0036751099)
THRUST_MAP = tuple(f"rotors.thrust_map.{c}" for c in ("c2", "c1", "c0"))


def fitted(log, **settings):
    return fit_vehicle([log], base=OTHER, mass=TRUE.mass, name="mine", **settings)


@pytest.fixture(scope="module")
def known():
    """Return the fit of a flight whose vehicle is known."""
    return fitted(noisy(flight()))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("key", "true", "share"),
    [
        ("thrust_max", TRUE.thrust_max, 0.01),
        ("rotors.motor_tau", TRUE.rotors.motor_tau, 0.02),
        ("motor_delay", LATE, 0.02),
        ("latency", LATE, 0.05),
        ("drag.x", TRUE.drag[0], 0.05),
        ("drag.y", TRUE.drag[1], 0.05),
        ("drag.z", TRUE.drag[2], 0.05),
        ("inertia_over_arm.x", TRUE.inertia[0] / (TRUE.mass * 0.1), 0.03),
        ("inertia_over_arm.y", TRUE.inertia[1] / (TRUE.mass * 0.0775), 0.03),
        ("inertia_over_arm.z", TRUE.inertia[2] / (TRUE.mass * TRUE.rotors.kappa), 0.05),
        ("rate_tau.x", TRUE.rate_tau[0], 0.05),
        ("rate_tau.y", TRUE.rate_tau[1], 0.05),
        ("rate_tau.z", TRUE.rate_tau[2], 0.05),
    ],
)
def test_the_numbers_of_a_known_vehicle_are_found(known, key, true, share):
    assert known[key].value == pytest.approx(true, rel=share)
    assert known[key].source == "log"
    assert OTHER.mass != TRUE.mass, "the prior is another vehicle's"


def test_the_file_is_the_vehicle_and_says_where_each_number_comes_from(known, tmp_path):
    text = known.to_yaml(tmp_path / "mine.yaml")
    again = load_vehicle(tmp_path / "mine.yaml")
    assert again == known.vehicle
    (drag,) = (line for line in text.splitlines() if line.startswith("drag:"))
    assert f"{known['drag.x'].low:.4g} to {known['drag.x'].high:.4g}" in drag
    (mass,) = (line for line in text.splitlines() if line.startswith("mass:"))
    assert mass.endswith("# [kg] given")
    assert 0.0 < again.uncertainty.drag < 0.1


def test_predictions_with_the_fitted_vehicle_beat_constant_velocity(known):
    after = {row.seconds: row for row in known.predictions}
    assert set(after) == {0.1, 0.25, 0.5, 1.0}
    assert after[0.5].measured_attitude < 0.2 * after[0.5].constant_velocity
    assert after[0.5].simulated_attitude < 0.5 * after[0.5].constant_velocity


@pytest.mark.slow
def test_a_log_without_yaw_keeps_the_yaw_inertia_of_the_prior():
    calm = noisy(flight(yaw=0.0))
    found = fitted(calm)
    assert found["inertia_over_arm.z"].source == "prior"
    assert any("inertia about z" in remark for remark in found.remarks)
    assert found["inertia_over_arm.x"].source == "log"


@pytest.mark.regression
def test_rotors_that_turn_the_other_way_round_are_noticed(known):
    log = noisy(flight())
    turned = replace(log, motor_commands=log.motor_commands[:, [2, 3, 0, 1]], **mirrored(log))
    found = fitted(turned)
    assert any("the other way round" in remark for remark in found.remarks)
    assert not any("the other way round" in remark for remark in known.remarks)
    key = "inertia_over_arm.z"
    assert found[key].value == pytest.approx(known[key].value, rel=0.1)


def mirrored(log):
    """Return the signals with left and right swapped, but for the yaw, which stays."""
    flip = {"body_rates": log.body_rates, "rate_setpoints": log.rate_setpoints}
    turned = {name: values * (-1.0, 1.0, 1.0) for name, values in flip.items()}
    return {
        **turned,
        "specific_force": log.specific_force * (1.0, -1.0, 1.0),
        "position": None,
        "velocity": None,
        "quaternion": None,
    }


@pytest.mark.slow
def test_a_log_of_gyro_accelerometer_and_motors_tells_thrust_and_inertia():
    log = replace(noisy(flight()), position=None, velocity=None, quaternion=None)
    found = fitted(log)
    assert found["thrust_max"].value == pytest.approx(TRUE.thrust_max, rel=0.05)
    assert found["drag.x"].source == "prior"
    assert found.predictions == ()


@pytest.mark.regression
def test_a_log_of_thrust_setpoints_does_not_tell_full_thrust():
    found = fitted(replace(noisy(flight()), motor_commands=None))
    assert found["drag.x"].source == "log"
    assert found["thrust_max"].source == "prior"
    assert found.vehicle.thrust_max == pytest.approx(OTHER.thrust_max, rel=1e-4)
    assert found["thrust_ratio"].value == pytest.approx(1.0, abs=0.02)
    assert found["rotors.thrust_map.c2"].source == "derived", "the mass is another one"
    assert found.vehicle.uncertainty.thrust == pytest.approx(0.05 / np.sqrt(3), abs=1e-4), (
        "as for any vehicle"
    )


def test_a_number_that_was_changed_is_not_called_the_priors():
    """Inertia and thrust map of the prior vehicle are those of another mass."""
    without = dict.fromkeys(("position", "velocity", "quaternion", "body_rates"))
    found = fitted(replace(noisy(flight()), **without))
    own = {"inertia.x": OTHER.inertia[0], "drag.x": OTHER.drag[0]}
    assert found["drag.x"].source == "prior"
    assert found["drag.x"].value == own["drag.x"]
    assert found["inertia.x"].source == "derived"
    assert found["inertia.x"].value == pytest.approx(own["inertia.x"] * TRUE.mass / OTHER.mass)


@pytest.mark.regression
def test_an_inertia_without_an_arm_has_an_interval_for_it(known):
    true = TRUE.inertia[0]
    assert known["inertia.x"].low < true < known["inertia.x"].high
    x, y = TRUE.rotors.positions[2]
    measured = fitted(noisy(flight()), arm=float(np.hypot(x, y)))
    assert measured["inertia.x"].std < 0.1 * known["inertia.x"].std
    assert measured["inertia_over_arm.x"].value == pytest.approx(known["inertia_over_arm.x"].value)


def test_a_log_of_what_never_flew_is_refused():
    log = flight()
    rng = np.random.default_rng(0)
    n = len(log.t)
    still = replace(
        log,
        **dict.fromkeys(("position", "velocity", "quaternion", "rate_setpoints")),
        body_rates=0.004 * rng.standard_normal((n, 3)),
        specific_force=(0.0, 0.0, 9.81) + 0.04 * rng.standard_normal((n, 3)),
    )
    with pytest.raises(SettingError, match="logs: expected a free flight in which the thrust"):
        fitted(still)


@pytest.mark.regression
def test_lags_that_were_found_leave_none_of_the_prior_vehicle_beside_them():
    other = load_vehicle("cf21b_500")
    assert other.rotors.motor_response
    assert any(other.rate_lead)
    found = fit_vehicle([noisy(flight())], base=other, mass=TRUE.mass)
    assert found["rotors.motor_tau"].source == found["rate_tau.x"].source == "log"
    assert found.vehicle.rotors.motor_response is None
    assert not any(found.vehicle.rate_lead)


def test_a_vehicle_that_cannot_be_is_refused():
    climbs = OTHER.but(rotors={"motor_omega_min": 1000.0})
    with pytest.raises(SettingError, match="climbs at its least command"):
        expect_plausible(climbs)
    strong = OTHER.but(rotors={"motor_omega_max": 9000.0})
    with pytest.raises(SettingError, match="thrust-to-weight ratio of 5"):
        expect_plausible(strong)
    expect_plausible(OTHER)


def test_a_flat_body_is_possible_after_its_inertia_is_rounded():
    rotors = OTHER.rotors
    told = {
        **{f"inertia.{axis}": j for axis, j in zip("xyz", FLAT, strict=True)},
        **{f"rate_tau.{axis}": tau for axis, tau in zip("xyz", OTHER.rate_tau, strict=True)},
        **{f"drag.{axis}": drag for axis, drag in zip("xyz", OTHER.drag, strict=True)},
        **dict(zip(THRUST_MAP, rotors.thrust_map, strict=True)),
        "rotors.motor_tau": rotors.motor_tau,
        "rotors.kappa": rotors.kappa,
        "thrust_max": OTHER.thrust_max,
        "mass": OTHER.mass,
        "latency": 0.0,
    }
    numbers = tuple(FittedNumber(key, "", j, j, j, "prior") for key, j in told.items())
    zeros = FitNumbers(*np.zeros(len(FitNumbers._fields)))
    found = FoundNumbers(
        numbers=zeros,
        covariance=np.zeros((0, 0)),
        searched=(),
        untold=(),
        drive="motor_commands",
        dt=0.005,
        lowest=0.1,
        speed_scale=None,
        loop=None,
    )
    jx, jy, jz = fitted_vehicle("mine", found, numbers, OTHER).inertia
    assert jz == jx + jy


@pytest.mark.parametrize(
    ("c2", "c1", "c0", "expected"),
    [
        (10.0, 0.0, 0.0, True),
        (10.0, 2.0, -1.0, True),
        (40.0, -40.0, 10.0, True),  # commands whose zero is at a half
        (4.0, -2.0, 8.0, False),
        (1.0, 2.0, 3.0, False),
    ],
)
def test_a_rotor_has_about_no_thrust_at_its_lowest_command(c2, c1, c0, expected):
    numbers = FitNumbers(*np.zeros(len(FitNumbers._fields)))._replace(c2=c2, c1=c1, c0=c0)
    assert is_rotor(numbers) is expected


def test_a_log_tells_ratios_to_the_mass_alone():
    with pytest.raises(SettingError, match="mass: expected the mass by a scale"):
        fit_vehicle([flight()])


def test_a_flight_of_seconds_is_refused():
    with pytest.raises(SettingError, match="logs: expected at least 5 s of flight"):
        fitted(flight(seconds=3.0))


@pytest.mark.regression
def test_drag_of_a_vehicle_that_hardly_moves_is_kept_at_the_prior():
    """Noise of a velocity near zero would be taken for motion without drag."""
    log = noisy(flight())
    found = fitted(replace(log, velocity=0.02 * log.velocity, position=None))
    assert {found[f"drag.{axis}"].source for axis in "xyz"} == {"prior"}
    assert any(remark.startswith("drag_x: the flights are too slow") for remark in found.remarks)


def test_a_log_without_a_flight_has_nothing_to_fit():
    log = replace(flight(), motor_commands=None, thrust_setpoint=None)
    with pytest.raises(SettingError, match="logs: expected a flight of a second or more"):
        fitted(log)


@pytest.mark.compiled
def test_a_fitted_vehicle_flies(known):
    run = quadsim.fly("figure8", vehicle=known.vehicle, laps=1, samples=512, timeout=0.2)
    assert run.spec["vehicle"]["uncertainty"]["mass"] == known.vehicle.uncertainty.mass


def test_the_uncertainty_of_a_vehicle_file_is_kept_and_may_be_missing():
    text = OTHER.but(uncertainty=None).to_yaml()
    assert "uncertainty" not in text
    wide = OTHER.but(
        uncertainty={"mass": 0.01, "thrust": 0.02, "rate_lag": 0.1, "motor_lag": 0.2, "drag": 0.3}
    )
    again = parse_vehicle(wide.to_yaml(), "swift.yaml")
    assert again == wide
    assert np.isclose(again.uncertainty.drag, 0.3)
