"""A rate loop with a derivative is faster than one without at the same damping."""

import numpy as np
import pytest
from plant_cases import SKY

from quadsim.dynamics.quadrotor import ModelParams
from quadsim.files.values import SettingError
from quadsim.physics.domain_randomization import Randomization
from quadsim.physics.plant import RigidPlant
from quadsim.vehicle import GRAVITY, load_vehicle, parse_vehicle

# without an equation of its own for its rotors, whose lag is then that of the model
LED = load_vehicle("cf21b_500").but(rotors={"motor_response": None})
DT = 0.0005


def rates(vehicle, seconds=0.15, roll=0.5):
    """Return the roll rate in each step after a small step of its command [rad/s]."""
    plant = RigidPlant(SKY, vehicle, DT)
    found = []
    for _ in range(round(seconds / DT)):
        found.append(plant.step((roll, 0.0, 0.0, GRAVITY)).x.wx)
    return np.array(found) / roll


def of_the_model(vehicle, seconds=0.15):
    """Return the same of the model's second-order response, integrated finely."""
    model = ModelParams.of(vehicle)
    tau, lag = model.rate_tau[0], model.rate_lags[0]
    w = b = 0.0
    found = []
    for _ in range(round(seconds / DT)):
        for _ in range(10):
            b += DT / 10 * ((1.0 - w) / tau - b) / lag
            w += DT / 10 * b
        found.append(w)
    return np.array(found)


def test_the_plant_follows_as_the_planners_model_of_it_does():
    assert abs(rates(LED) - of_the_model(LED)).max() < 0.08
    # the negative control: the same gain without the lead swings twice as far
    without = LED.but(rate_lead=[0, 0, 0])
    assert rates(without).max() > rates(LED).max() + 0.2
    assert abs(rates(without) - of_the_model(LED)).max() > 0.2


def test_a_vehicle_without_a_lead_has_the_model_of_its_lag():
    swift = load_vehicle("swift")
    assert ModelParams.of(swift).rate_lag is None
    assert ModelParams.of(swift).rate_tau == swift.rate_tau


def test_a_file_keeps_its_lead_and_randomized_lags_too():
    assert parse_vehicle(LED.to_yaml(), "cf21b_500.yaml") == LED
    assert Randomization(rate_lag=0.2).vehicle(LED).rate_lead == LED.rate_lead


def test_a_lead_without_rotors_is_refused():
    with pytest.raises(SettingError, match="rate_lead: expected none without rotors"):
        LED.but(rotors=None)
