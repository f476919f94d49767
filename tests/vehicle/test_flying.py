"""What the numbers of a vehicle mean in flight."""

from math import cos, inf, sin, sqrt

import pytest

from quadsim.physics.actuators import drag_force
from quadsim.vehicle import GRAVITY, load_vehicle
from quadsim.vehicle.flying import flying_numbers, top_speed

SWIFT = load_vehicle("swift")


def test_at_hover_speed_the_rotors_carry_the_weight():
    hover = flying_numbers(SWIFT).hover
    rotors = SWIFT.rotors
    thrust = 4.0 * rotors.thrust(hover * rotors.motor_omega_max)
    assert thrust == pytest.approx(SWIFT.mass * GRAVITY)
    paper = load_vehicle("paper")
    assert flying_numbers(paper).hover * paper.thrust_max == pytest.approx(GRAVITY)


@pytest.mark.parametrize("drag", [(0.4, 0.4, 0.4), (0.3, 0.4, 0.9), (0.9, 0.4, 0.2)])
def test_at_top_speed_the_forces_of_the_plant_balance(drag):
    vehicle = SWIFT.but(drag=drag)
    v = top_speed(vehicle)
    # For some tilt, thrust, the plant's drag and weight sum to zero along x and z of the world.
    residuals = []
    for k in range(1, 9000):
        theta = 0.5 * 3.14159265 * k / 9000
        fx, _, fz = drag_force(vehicle, (v * cos(theta), 0.0, v * sin(theta)))
        fz += vehicle.mass * vehicle.thrust_max
        along = fx * cos(theta) + fz * sin(theta)
        up = -fx * sin(theta) + fz * cos(theta) - vehicle.mass * GRAVITY
        residuals.append(abs(along) + abs(up))
    assert min(residuals) < 1e-3 * vehicle.mass * vehicle.thrust_max


def test_equal_drag_has_a_closed_form_and_no_drag_no_top_speed():
    known = sqrt(SWIFT.thrust_max**2 - GRAVITY**2) / 0.4
    assert top_speed(SWIFT) == pytest.approx(known, rel=1e-9)
    for drag in ((0, 0, 0), (0, 0.4, 0.4), (0.4, 0.4, 0)):
        assert top_speed(SWIFT.but(drag=drag)) == inf
    assert "no top speed" in flying_numbers(SWIFT.but(drag=(0, 0, 0))).text()
