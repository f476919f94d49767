"""RotorPy's multirotor as the plant (Folk, Paulos and Kumar 2023); only this file imports RotorPy.

RotorPy provides the rate controller, the allocation, which clips each rotor command by itself, the
rotor lag, the integrator, and aerodynamics that the planner does not model. With the airspeed v in
the body frame the aerodynamic forces are

    rotor drag            -k_d W v for each rotor, in proportion to its speed W
    parasitic drag        -c |v| v of the body
    translational lift    k_h (v_x^2 + v_y^2) for each rotor, along its axis

The vehicle's file gives mass, inertia, rotors with their lag, limits, rate loop and latency.
RotorPy's thrust map is k W^2, with the file's thrust at full speed. k_d is chosen such that four
rotors at full speed have the file's linear drag. This plant reports no contacts; the referee finds
contacts by its swept test.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from quadsim.course import Course, Start
from quadsim.dynamics.allocation import mixer
from quadsim.dynamics.first_order import response
from quadsim.dynamics.quadrotor import Control, State
from quadsim.files.extras import needs_extra
from quadsim.physics.actuators import angular_acceleration, clamp_command
from quadsim.physics.faults import FaultOfVehicle
from quadsim.physics.link import HOVER
from quadsim.physics.plant_state import PlantState, start_state
from quadsim.rotation import Vec3
from quadsim.vehicle import GRAVITY, Rotors, Vehicle

# c / m [1/m], along the body's axes: 2.4 m/s^2 at 20 m/s.
PARASITIC = (0.006, 0.006, 0.012)
# 4 k_h / m [1/m]: 1.8 m/s^2 at 20 m/s.
LIFT = 0.0046
# [s] RotorPy divides by the rotors' lag.
LEAST_LAG = 1e-3


class RotorpyPlant:
    """One vehicle in RotorPy's world.

    Raises ValueError if RotorPy is not installed, and for a vehicle without rotors.
    """

    def __init__(
        self,
        course: Course,
        vehicle: Vehicle,
        dt: float = 1 / 400,
        start: Start | None = None,
        body: Vehicle | None = None,
        gusts: Iterator[Vec3] | None = None,
        faults: Sequence[FaultOfVehicle] = (),
    ):
        """Start at rest; for the arguments see quadsim.physics.plant.RigidPlant.

        Raises:
            ValueError: the vehicle has no rotors or a rate loop with a derivative, or there are
                faults of rotors, which RotorPy does not support.
        """
        if faults:
            raise ValueError(f"plant: 'rotorpy' has no faults of rotors, got {faults[0]}")
        if vehicle.rotors is None:
            raise ValueError(
                f"plant: 'rotorpy' needs a vehicle with rotors, got {vehicle.name!r}: fly 'rigid'"
            )
        if any(vehicle.rate_lead):
            raise ValueError(
                "plant: 'rotorpy' has no derivative in its rate loop, got rate_lead of"
                f" {vehicle.name!r}: fly 'rigid'"
            )
        self.dt = dt
        self._vehicle = vehicle
        self._rotors = _quadratic(vehicle.rotors)
        self._gusts = gusts
        # collective and torque of the rotors' thrusts  (4, 4)
        self._mixer = np.array(mixer(self._rotors))
        self._model = _multirotor(vehicle, self._rotors, body or vehicle, dt)
        self._delayed: deque[Control] = deque([HOVER] * round(vehicle.latency / dt))
        x = start_state(start or course.start, vehicle.radius)
        hover = self._rotors.speed(0.25 * vehicle.mass * GRAVITY)
        self._now: dict[str, np.ndarray] = {
            "x": np.array(x.position),
            "v": np.zeros(3),
            # RotorPy's quaternions are xyzw.
            "q": np.array([x.qx, x.qy, x.qz, x.qw]),
            "w": np.zeros(3),
            "wind": np.zeros(3),
            "rotor_speeds": np.full(4, hover),
        }
        self._steps = 0
        self.state = self._read()

    def step(self, u: Sequence[float]) -> PlantState[State]:
        """Advance by one physics step under a command in the order of Control  (4,)."""
        self._delayed.append(clamp_command(u, self._vehicle))
        acting = self._delayed.popleft()
        command = {
            "cmd_thrust": self._vehicle.mass * acting.thrust,
            "cmd_w": np.array(acting.body_rates),
        }
        self._now = self._model.step(self._now, command, self.dt)
        if self._gusts:
            self._now["v"] = self._now["v"] + self.dt * np.array(next(self._gusts))
        self._steps += 1
        self.state = self._read()
        return self.state

    def _read(self) -> PlantState[State]:
        """Return the state, with thrust and torque from the rotors' speeds, as in other plants."""
        now = self._now
        body_rates: Vec3 = tuple(now["w"].tolist())
        thrusts = self._rotors.thrust_map[0] * now["rotor_speeds"] ** 2
        force, tx, ty, tz = (self._mixer @ thrusts).tolist()
        qx, qy, qz, qw = now["q"].tolist()
        x = State.of(
            position=now["x"].tolist(),
            velocity=now["v"].tolist(),
            attitude=(qw, qx, qy, qz),
            body_rates=body_rates,
            thrust=force / self._vehicle.mass,
            angular_acceleration=angular_acceleration(
                body_rates, (tx, ty, tz), self._vehicle.inertia
            ),
        )
        return PlantState(self._steps * self.dt, x, ())

    def close(self) -> None:
        """Do nothing, as there are no resources to release."""


def _quadratic(rotors: Rotors) -> Rotors:
    """Return the rotors with a thrust map k W^2 that gives the same thrust at full speed."""
    k = rotors.thrust(rotors.motor_omega_max) / rotors.motor_omega_max**2
    return replace(rotors, thrust_map=(k, 0.0, 0.0))


def _multirotor(vehicle: Vehicle, rotors: Rotors, body: Vehicle, dt: float) -> Any:
    """Return RotorPy's multirotor, with parameters named as in RotorPy's files.

    Args:
        vehicle: vehicle with the flight controller's numbers.
        rotors: rotors with a thrust map k W^2.
        body: vehicle with the true mass and inertia.
        dt: physics step [s].
    """
    try:
        from rotorpy.vehicles.multirotor import Multirotor
    except ImportError:
        raise ValueError(f"plant: 'rotorpy': {needs_extra('rotorpy', 'rotorpy')}") from None
    k = rotors.thrust_map[0]
    mass = vehicle.mass
    jx, jy, jz = body.inertia
    # rotor drag of one rotor per its speed and the vehicle's linear drag
    per_drag = mass / (4 * rotors.motor_omega_max)
    parameters = {
        "mass": body.mass,
        "Ixx": jx,
        "Iyy": jy,
        "Izz": jz,
        "Ixy": 0.0,
        "Ixz": 0.0,
        "Iyz": 0.0,
        "num_rotors": 4,
        "rotor_pos": {
            f"r{i}": np.array([x, y, 0.0]) for i, (x, y) in enumerate(rotors.positions, start=1)
        },
        "rotor_directions": np.array(rotors.spin),
        "c_Dx": mass * PARASITIC[0],
        "c_Dy": mass * PARASITIC[1],
        "c_Dz": mass * PARASITIC[2],
        "k_eta": k,
        "k_m": k * rotors.kappa,
        "k_d": per_drag * (vehicle.drag[0] + vehicle.drag[1]) / 2,
        "k_z": per_drag * vehicle.drag[2],
        "k_h": mass * LIFT / 4,
        "tau_m": max(rotors.motor_tau, LEAST_LAG),
        "rotor_speed_min": rotors.motor_omega_min,
        "rotor_speed_max": rotors.motor_omega_max,
        "k_w": np.array([response(tau, dt) / dt for tau in vehicle.rate_tau]),
    }
    # One step of third order, whose error is small: 0.01 mm in 2 s, in half the time of RotorPy's
    # default integrator.
    integrator = {"method": "RK23", "rtol": 1e-3, "atol": 1e-4, "first_step": dt}
    return Multirotor(parameters, control_abstraction="cmd_ctbr", integrator_kwargs=integrator)
