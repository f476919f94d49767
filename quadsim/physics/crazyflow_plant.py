"""Crazyflow's quadrotor as the plant (learnsyslab/crazyflow); only this file imports Crazyflow.

Crazyflow is the simulator of the Learning Systems Lab's drone racing class. It provides the
body-rate controller, which follows the Crazyflie's firmware, the allocation, which clips each rotor
command by itself, the rotors' equation, the gyroscopic torques of the propellers, which the planner
does not model, and the integrator. The model is Crazyflow's `first_principles`.

The vehicle's file gives mass, inertia, drag, rotors with their equation, limits, rate loop and
latency. The firmware's controller also levels the vehicle; these gains are zero here, and the gains
of the body rates follow from the lags in the file. With the vehicle `cf21b_500` all other numbers
are Crazyflow's own. This plant reports no contacts; the referee finds contacts by its swept test.
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from functools import lru_cache
from io import StringIO
from math import pi
from typing import Any, NamedTuple

import numpy as np

from quadsim.course import Course, Start
from quadsim.dynamics.allocation import mixer
from quadsim.dynamics.quadrotor import Control, State
from quadsim.files.extras import needs_extra
from quadsim.physics.actuators import angular_acceleration, clamp_command
from quadsim.physics.faults import FaultOfVehicle
from quadsim.physics.link import CommandNoise, Link
from quadsim.physics.plant_state import PlantState, start_state
from quadsim.rotation import Vec3
from quadsim.vehicle import GRAVITY, Rotors, Vehicle

# [rad/s] one revolution per minute, the unit of Crazyflow's rotor speeds
RPM = 2.0 * pi / 60.0
# Full scale of the firmware's commands to a rotor
PWM_MAX = 65535.0
NO_FORCE = (0.0, 0.0, 0.0)
SCIPY_FLAG = "SCIPY_ARRAY_API"


def before_scipy() -> None:
    """Let SciPy accept JAX arrays, which Crazyflow passes to it; call this before importing SciPy.

    SciPy reads the environment variable once, when it is imported.
    """
    if "scipy" not in sys.modules:
        os.environ.setdefault(SCIPY_FLAG, "1")


class Simulator(NamedTuple):
    """Crazyflow's simulator of one vehicle, compiled for one physics step."""

    # its data at rest, with the numbers of its own vehicle
    data: Any
    # (data, command (4,), force (3,)) -> data after one physics step
    step: Callable[[Any, np.ndarray, np.ndarray], Any]
    # data -> position, velocity, quaternion xyzw, body rates and rotor speeds [rpm]  (17,)
    read: Callable[[Any], Any]


class CrazyflowPlant:
    """One vehicle in Crazyflow's world.

    Raises ValueError if Crazyflow is not installed, or if it cannot simulate the vehicle.
    """

    def __init__(
        self,
        course: Course,
        vehicle: Vehicle,
        dt: float = 1 / 500,
        start: Start | None = None,
        body: Vehicle | None = None,
        gusts: Iterator[Vec3] | None = None,
        faults: Sequence[FaultOfVehicle] = (),
        noise: CommandNoise | None = None,
    ):
        """Start at rest; for the arguments see quadsim.physics.plant.RigidPlant.

        Args:
            noise: noise that is added to the commands; None: no noise.

        Raises:
            ValueError: the vehicle has no rotors, or rotors that are not on a square's diagonals;
                the step is not a whole number of Hz; or there are faults of rotors, which Crazyflow
                does not support.
        """
        if faults:
            raise ValueError(f"plant: 'crazyflow' has no faults of rotors, got {faults[0]}")
        rotors = _expect_square(vehicle)
        rate = round(1.0 / dt)
        if abs(rate * dt - 1.0) > 1e-9:
            wanted = "expected a physics step of 1 s over a whole number for 'crazyflow'"
            raise ValueError(f"plant_dt: {wanted}, got {dt:g}")
        body = body or vehicle
        self.dt = dt
        self._vehicle = vehicle
        self._rotors = rotors
        self._body_mass = body.mass
        self._gusts = gusts
        # collective and torque of the rotors' thrusts  (4, 4)
        self._mixer = np.array(mixer(rotors))
        self._link = Link(dt, vehicle.latency, noise=noise)
        self._simulator = _simulator(rate)
        x = start_state(start or course.start, vehicle.radius)
        data = _with_numbers(self._simulator.data, vehicle, rotors, body)
        self._data = _at_rest(data, x, rotors.speed(0.25 * vehicle.mass * GRAVITY) / RPM)
        self._steps = 0
        self.state = self._read()

    def step(self, u: Sequence[float]) -> PlantState[State]:
        """Advance by one physics step under a command in the order of Control  (4,)."""
        command = clamp_command(self._link.carry(Control(*u)).command, self._vehicle)
        wx, wy, wz, thrust = command
        theirs = np.array((wx, wy, wz, self._vehicle.mass * thrust), np.float32)
        push = np.array(next(self._gusts) if self._gusts else NO_FORCE) * self._body_mass
        self._data = self._simulator.step(self._data, theirs, push.astype(np.float32))
        self._steps += 1
        self.state = self._read()
        return self.state

    def _read(self) -> PlantState[State]:
        """Return the state, with thrust and torque from the rotors' speeds, as in other plants."""
        now = np.asarray(self._simulator.read(self._data), float)
        body_rates: Vec3 = tuple(now[10:13].tolist())
        thrusts = np.array([self._rotors.thrust(RPM * speed) for speed in now[13:].tolist()])
        force, tx, ty, tz = (self._mixer @ thrusts).tolist()
        qx, qy, qz, qw = now[6:10].tolist()
        x = State.of(
            position=now[:3].tolist(),
            velocity=now[3:6].tolist(),
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


def _expect_square(vehicle: Vehicle) -> Rotors:
    """Return the rotors of a vehicle. Raises ValueError if Crazyflow cannot simulate them."""
    if vehicle.rotors is None:
        raise ValueError(
            f"plant: 'crazyflow' needs a vehicle with rotors, got {vehicle.name!r}: fly 'rigid'"
        )
    arms = np.abs(vehicle.rotors.positions)
    if not np.allclose(arms, arms[0, 0]):
        raise ValueError(
            "plant: 'crazyflow' needs rotors on the diagonals of a square, got"
            f" {vehicle.name!r}: fly 'rigid'"
        )
    return vehicle.rotors


@lru_cache(maxsize=4)
def _simulator(rate: int) -> Simulator:
    """Return Crazyflow's simulator at a rate of physics steps [Hz].

    Raises:
        ValueError: Crazyflow is not installed.
    """
    try:
        # Its libraries print which of their own options are not installed.
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            import jax
            import jax.numpy as jnp
            import mujoco
            from crazyflow.control import Control as ControlMode
            from crazyflow.dynamics import Dynamics
            from crazyflow.sim import Sim
            from crazyflow.sim.functional import body_rate_control
    except ImportError:
        raise ValueError(f"plant: 'crazyflow': {needs_extra('crazyflow', 'crazyflow')}") from None
    except RuntimeError:
        raise ValueError(
            "plant: 'crazyflow': expected SciPy to be loaded for JAX's arrays, and it is loaded"
            f" already without them: start Python with {SCIPY_FLAG}=1"
        ) from None
    with _without_warnings(mujoco):
        sim = Sim(
            dynamics=Dynamics.first_principles,
            control=ControlMode.body_rate,
            freq=rate,
            body_rate_freq=rate,
            force_torque_freq=rate,
        )
    advance: Any = sim.build_step_fn()

    @jax.jit
    def step(data: Any, command: Any, force: Any) -> Any:
        data = body_rate_control(data, command[None, None])
        data = data.replace(states=data.states.replace(force=force[None, None]))
        return advance(data, n_steps=1)

    @jax.jit
    def read(data: Any) -> Any:
        states = data.states
        parts = (states.pos, states.vel, states.quat, states.ang_vel, states.rotor_vel)
        return jnp.concatenate([part[0, 0] for part in parts])

    return Simulator(sim.data, step, read)


@contextmanager
def _without_warnings(mujoco: Any) -> Iterator[None]:
    """Suppress MuJoCo's warnings, which it prints and writes to a file in the current folder.

    They say that the model cannot be stored, which this plant never does.
    """
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(_ignore)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            yield
    finally:
        mujoco.set_mju_user_warning(before)


def _ignore(message: str) -> None:
    """Discard a warning of MuJoCo."""


def _with_numbers(data: Any, vehicle: Vehicle, rotors: Rotors, body: Vehicle) -> Any:
    """Return Crazyflow's data with the numbers of a vehicle, under Crazyflow's names.

    Args:
        data: the simulator's data.
        vehicle: vehicle with the flight controller's numbers.
        rotors: rotors of the vehicle.
        body: vehicle with the true mass and inertia.
    """
    c2, c1, c0 = rotors.thrust_map
    thrust_map = np.array([c0, c1 * RPM, c2 * RPM**2])
    lag = 1.0 / max(rotors.motor_tau, 1.0 / data.core.freq)
    rise, rise_squared, fall, fall_squared = rotors.motor_response or (lag, 0.0, lag, 0.0)
    response = np.array([rise, rise_squared * RPM, fall, fall_squared * RPM])
    arm = abs(rotors.positions[0][0])
    xs, ys = np.sign(rotors.positions).T
    mixing = np.array([ys, -xs, rotors.spin])
    thrust_min = rotors.thrust(rotors.motor_omega_min)
    thrust_max = rotors.thrust(rotors.motor_omega_max)

    # The firmware asks for half of its roll and pitch, and all of its yaw, from each rotor.
    torque = np.array(vehicle.inertia) / np.maximum(vehicle.rate_tau, 1.0 / data.core.freq)
    share = np.array([2.0 / arm, 2.0 / arm, 1.0 / rotors.kappa]) / 4.0
    gains = torque * share * PWM_MAX / thrust_max

    of_rotors = {
        "L": arm,
        "thrust2torque": rotors.kappa,
        "mixing_matrix": mixing,
        "thrust_max": thrust_max,
    }
    of_rates = {
        "kR": np.zeros(3),
        "kw": gains,
        "ki_m": np.zeros(3),
        "kd_omega": gains * vehicle.rate_lead,
        "pwm_min": PWM_MAX * thrust_min / thrust_max,
        "pwm_max": PWM_MAX,
    }
    of_allocation = {"thrust_min": thrust_min, "rpm2thrust": thrust_map}
    controls = data.controls
    rates = controls.body_rate
    allocation = controls.force_torque
    controls = controls.replace(
        body_rate=rates.replace(params=_changed(rates.params, {**of_rotors, **of_rates})),
        force_torque=allocation.replace(
            params=_changed(allocation.params, {**of_rotors, **of_allocation})
        ),
    )
    inertia = np.diag(body.inertia)
    physics = {
        "mass": [body.mass],
        "L": [arm],
        "J": inertia,
        "J_inv": np.linalg.inv(inertia),
        "rpm2thrust": [thrust_map],
        "rpm2torque": [rotors.kappa * thrust_map],
        "mixing_matrix": mixing,
        "drag_matrix": -vehicle.mass * np.diag(vehicle.drag),
        "rotor_dyn_coef": [response],
    }
    params = data.params.replace(**{name: _like(value) for name, value in physics.items()})
    return data.replace(controls=controls, params=params)


def _like(value: Any) -> np.ndarray:
    """Return numbers as an array in Crazyflow's precision."""
    return np.asarray(value, np.float32)


def _changed(params: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Return a controller's parameters with the named ones changed."""
    return {**params, **{name: _like(value) for name, value in changes.items()}}


def _at_rest(data: Any, x: State, speed: float) -> Any:
    """Return Crazyflow's data with the vehicle at rest, all rotors at one speed [rpm]."""
    states = data.states.replace(
        pos=_like([[x.position]]),
        # its quaternions are xyzw
        quat=_like([[[x.qx, x.qy, x.qz, x.qw]]]),
        rotor_vel=np.full((1, 1, 4), speed, np.float32),
    )
    return data.replace(states=states)
