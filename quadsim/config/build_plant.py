"""Build the plant of a Spec, its start and its model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from math import sqrt
from pathlib import Path
from typing import TYPE_CHECKING, cast

from quadsim.config.checks import expect_new_log
from quadsim.config.own import OwnPlant, made
from quadsim.config.spec import Spec
from quadsim.dynamics import System
from quadsim.dynamics.quadrotor import Delivered, LearnedModel, State, quadrotor
from quadsim.firmware.actuators import (
    BetaflightActuators,
    FirmwareLog,
    ImuNoise,
    motors_reversed,
)
from quadsim.firmware.configuration import eeprom_with_log
from quadsim.firmware.identified import firmware_for
from quadsim.physics.actuators import Actuators
from quadsim.physics.crazyflow_plant import CrazyflowPlant
from quadsim.physics.domain_randomization import Randomization, forces, gusts
from quadsim.physics.faults import FaultOfVehicle
from quadsim.physics.link import CommandNoise, Link
from quadsim.physics.plant import (
    PLANTS,
    Arena,
    Plant,
    PlantName,
    SharedPlant,
    start_state,
)
from quadsim.physics.rotorpy_plant import RotorpyPlant
from quadsim.rotation import Vec3
from quadsim.sensing.config import ImuConfig
from quadsim.streams import command_noise_stream, force_stream, sensor_streams
from quadsim.vehicle import Vehicle

if TYPE_CHECKING:
    pass


def system_of(spec: Spec) -> System:
    """Return the planner's model of the vehicle; one step of it is one control period.

    If the output of the rotors is learned in flight, the model includes it from the start, so that
    only one loop is compiled for the whole flight.
    """
    model = spec.model
    if learns_rotors(spec):
        model = LearnedModel.of_model(model, Delivered())
    return quadrotor(model, spec.planner.mppi.dt)


def learns_rotors(spec: Spec) -> bool:
    """Return whether the planner learns the output of the rotors in flight.

    Firmware and other simulators have their own rate loops and mixers, so the commands to the
    rotors are not known. A pilot has no model that could be adapted.
    """
    has_lag = spec.vehicle.rotors is not None and spec.model.motor_tau > 0.0
    is_followed = spec.flight_controller == "ideal" and spec.plant in ("bullet", "rigid")
    return adapts(spec) and has_lag and is_followed


def adapts(spec: Spec) -> bool:
    """Return whether the planner uses the vehicle parameters that are estimated in flight."""
    return spec.planner.mppi.adapt and spec.pilot is None


def start_of(spec: Spec) -> State:
    """Return the nominal state at the start."""
    return start_state(spec.start or spec.course.start, spec.vehicle.radius)


def plant_of(spec: Spec, arena: Arena | None = None) -> Plant:
    """Return the plant of one flight, the user's own or a named one. The caller closes it.

    The seed randomizes the vehicle, the start and the gusts of a named plant.

    Args:
        spec: specification of the flight.
        arena: world that the vehicle shares with others; None: the vehicle's own world.
    """
    if not isinstance(spec.plant, str):
        return OwnPlant(made("plant", spec.plant, spec))
    plant = partial(SharedPlant, arena) if arena else PLANTS[cast(PlantName, spec.plant)]
    course = spec.flown_course
    faults = [fault for fault in spec.drawn_faults if isinstance(fault, FaultOfVehicle)]
    if plant is CrazyflowPlant:
        plant = partial(plant, noise=_command_noise(spec))
    elif plant is not RotorpyPlant:
        plant = partial(plant, actuators=partial(actuators_of, spec))
    if spec.randomize == 0:
        return plant(course, spec.vehicle, spec.plant_dt, start=spec.start, faults=faults)
    varied = spec.variation
    body = varied.body(spec.vehicle)
    return plant(
        course,
        varied.vehicle(spec.vehicle),
        spec.plant_dt,
        start=varied.start(spec.start or spec.course.start),
        body=body,
        gusts=_disturbances(spec, varied, body.mass),
        faults=faults,
    )


def _disturbances(spec: Spec, varied: Randomization, mass: float) -> Iterator[Vec3]:
    """Return the accelerations by gusts and random forces in each physics step [m/s^2].

    Args:
        spec: specification of the flight.
        varied: changes of the vehicle that the seed has drawn.
        mass: mass of the body [kg].
    """
    stream = spec.streams.gusts
    wind = gusts(stream, varied.gust, spec.plant_dt)
    if not varied.force:
        return wind
    pushed = forces(force_stream(stream), varied.force, mass)
    pairs = zip(wind, pushed, strict=False)  # both are endless
    return ((ax + bx, ay + by, az + bz) for (ax, ay, az), (bx, by, bz) in pairs)


def actuators_of(
    spec: Spec, vehicle: Vehicle, dt: float, faults: Sequence[FaultOfVehicle]
) -> Actuators | BetaflightActuators:
    """Return the actuators of a vehicle with the spec's link and flight controller.

    A link to the firmware interpolates, so that each command is reached within a control period.

    Args:
        spec: specification of the flight.
        vehicle: the flown vehicle, which the seed may have changed.
        dt: physics step [s].
        faults: faults of the vehicle.

    Raises:
        FirmwareError: the firmware is not built, or does not arm.
        FileError: the firmware does not accept its configuration.
        SettingError: the file of the firmware's log exists already.
    """
    stream = spec.streams.link
    if spec.betaflight is None:
        link = Link(dt, vehicle.latency, spec.link, stream=stream, noise=_command_noise(spec))
        return Actuators(vehicle, dt, faults, link)
    if spec.blackbox is not None:
        expect_new_log(spec.blackbox)
    period = spec.planner.mppi.dt
    link = Link(dt, vehicle.latency, spec.link, period, stream, _command_noise(spec))
    built, configuration = firmware_for(vehicle, spec.betaflight)
    log = None
    if spec.blackbox is not None:
        text, reversed_ = spec.betaflight, motors_reversed(vehicle)
        log = FirmwareLog(Path(spec.blackbox), eeprom_with_log(built.program, text, reversed_))
    noise = _imu_noise(spec, spec.sensing.imu, dt) if spec.sensing and spec.sensing.imu else None
    return BetaflightActuators(vehicle, dt, built, configuration, faults, link, log, noise)


def _command_noise(spec: Spec) -> CommandNoise | None:
    """Return the noise on the commands of a flight, None if there is none."""
    std = spec.variation.command_noise
    if not any(std):
        return None
    steps = round(spec.planner.mppi.dt / spec.plant_dt)
    return CommandNoise(std, steps, command_noise_stream(spec.streams.link))


def _imu_noise(spec: Spec, imu: ImuConfig, dt: float) -> ImuNoise:
    """Return the noise of the firmware's inertial unit, which samples every dt [s].

    Its noise density equals that of the unit that the estimator reads.
    """
    samples = 1.0 / (imu.rate * dt)  # of the firmware's to one of the estimator's
    stream = sensor_streams(spec.streams.sensors).flight_controller
    scale = sqrt(samples)
    return ImuNoise(scale * imu.gyro_noise, scale * imu.accelerometer_noise, stream)
