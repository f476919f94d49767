"""Random streams by name, all derived here from one seed.

Every random number of the project comes from one of these streams.

A stream is a `numpy.random.SeedSequence`. Streams of the same seed differ in their spawn keys, so
that numbers drawn from different streams are independent. A stream depends only on the seed and its
own key: drawing from one stream changes no other stream, and a new stream with a new key changes
none of the streams below.

Flights of a seed are compared across versions, so the keys are never changed:

    flight of a quadrotor   planner (0), vehicle (1, 0), gusts (1, 1), forces (1, 1, 0), sensors
                            (2), gates (3), their heights and turns, and obstacles (3, 0), faults
                            (4); fault k, counted from 0, (4, k); link (5), noise of commands (5, 0)
    race of several         seed of entrant k, counted from 0, (6, k), but for the first one, whose
                            seed is the race's; perception of others by vehicle k (7, k); its plan
                            for vehicle m (8, k, m)
    its sensors             imu (2, 0), rotors (2, 1), pose (2, 2), camera (2, 3), its dropouts
                            (2, 3, 0), its bursts of misses (2, 3, 1); the flight controller's own
                            imu (2, 4); drawn pictures (2, 5): noise (2, 5, 0), look (2, 5, 1) to
                            (2, 5, 3), banners (2, 5, 4); barometer (2, 6)
    off-road vehicle        planner (0), gusts (1); vehicle (2), sensors (3), gates (4), faults (5),
                            link (6) are not used
    double integrator       planner (); vehicle (0), gusts (1), sensors (2), gates (3), faults (4),
                            link (5) are not used
    environments            starts of course k (k), vehicle of its row i (k, i), in a race of
                            several the vehicle of racer j (k, i, j)
    generated courses       course number k, counted from 1, (k - 1)

The entropy of pictures and training has two numbers instead of a key, see `pose_stream`,
`look_streams` and `training_stream`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.random import SeedSequence

# The look of picture k has k + LOOKS as the second word of its entropy; its pose has k itself.
LOOKS = 1 << 20
# Second word of the entropy of training.
TRAINING = 1
# Second word of the key of the noise on observations.
OBSERVATION_NOISE = 0x0B5E


class Streams(NamedTuple):
    """The random streams of one flight."""

    planner: SeedSequence  # perturbations of the sampled trajectories
    vehicle: SeedSequence  # domain randomization: start pose, mass, thrust, lags, drag
    gusts: SeedSequence  # disturbance of every physics step
    sensors: SeedSequence  # noise of all sensors, see `sensor_streams`
    gates: SeedSequence  # how far the gates stand off the map
    faults: SeedSequence  # numbers that the texts of faults leave open, see `fault_stream`
    link: SeedSequence  # which frames of the link are lost


class SensorStreams(NamedTuple):
    """The random streams of the sensors of one flight."""

    imu: SeedSequence  # noise and walking biases
    rotors: SeedSequence  # noise of the rotor speeds
    pose: SeedSequence  # noise, drift, spikes and dropouts of the pose sensor
    camera: SeedSequence  # noise, misses, outliers and false associations of corners
    flight_controller: SeedSequence  # noise of its own inertial measurement unit
    pixels: SeedSequence  # noise of drawn pictures, and what they show beside the course
    barometer: SeedSequence  # noise of its heights


class LookStreams(NamedTuple):
    """The random streams of the look of one picture.

    A part that is not varied draws no numbers, which does not change the other streams.
    """

    textures: SeedSequence  # paint of ground, obstacles and gates
    light: SeedSequence  # direction, colour and strength of the sun
    background: SeedSequence  # colours and clouds of the sky


class PictureStreams(NamedTuple):
    """The random streams of the pictures of one flight."""

    noise: SeedSequence  # noise of the pixels
    look: LookStreams  # paint, light and sky
    banners: SeedSequence  # places and sizes of sheets beside the course


def quadrotor_streams(seed: int) -> Streams:
    """Return the streams of a quadrotor's flight.

    Every planner that flies with a seed has the same vehicle and the same gusts.
    """
    root = SeedSequence(seed)
    return Streams(
        planner=_child(root, 0),
        vehicle=_child(root, 1, 0),
        gusts=_child(root, 1, 1),
        sensors=_child(root, 2),
        gates=_child(root, 3),
        faults=_child(root, 4),
        link=_child(root, 5),
    )


def entrant_seed(seed: int, entrant: int) -> int:
    """Return the seed of one entrant's flight; the first entrant has the seed of the race.

    Args:
        seed: seed of the race.
        entrant: index of the entrant, from 0.
    """
    if entrant == 0:
        return seed
    (drawn,) = _child(SeedSequence(seed), 6, entrant).generate_state(1)
    return int(drawn) % (10**9 + 1)


def sighting_stream(seed: int, vehicle: int) -> SeedSequence:
    """Return the stream of the noise in a vehicle's perception of other vehicles in a race.

    Args:
        seed: seed of the race.
        vehicle: index of the vehicle, from 0.
    """
    return _child(SeedSequence(seed), 7, vehicle)


def opponent_stream(seed: int, vehicle: int, other: int) -> SeedSequence:
    """Return the stream of the samples with which a vehicle plans another vehicle's flight.

    Args:
        seed: seed of the race.
        vehicle: index of the vehicle that plans, from 0.
        other: index of the other vehicle.
    """
    return _child(SeedSequence(seed), 8, vehicle, other)


def fault_stream(faults: SeedSequence, index: int) -> SeedSequence:
    """Return the stream of one fault of a flight.

    Args:
        faults: the stream `faults` of the flight.
        index: index of the fault, from 0.
    """
    return _child(faults, index)


def force_stream(gusts: SeedSequence) -> SeedSequence:
    """Return the stream of the forces on the vehicle, derived from the stream `gusts`."""
    return _child(gusts, 0)


def tilt_stream(gates: SeedSequence) -> SeedSequence:
    """Return the stream of the heights and turns of gates and of the places of obstacles.

    Args:
        gates: the stream `gates` of the flight.
    """
    return _child(gates, 0)


def command_noise_stream(link: SeedSequence) -> SeedSequence:
    """Return the stream of the noise on commands, derived from the stream `link`."""
    return _child(link, 0)


def sensor_streams(sensors: SeedSequence) -> SensorStreams:
    """Return the streams of single sensors, derived from the stream `sensors` of a flight."""
    return SensorStreams(
        imu=_child(sensors, 0),
        rotors=_child(sensors, 1),
        pose=_child(sensors, 2),
        camera=_child(sensors, 3),
        flight_controller=_child(sensors, 4),
        pixels=_child(sensors, 5),
        barometer=_child(sensors, 6),
    )


def dropout_stream(camera: SeedSequence) -> SeedSequence:
    """Return the stream of a camera's dropouts, derived from the camera's stream."""
    return _child(camera, 0)


def miss_stream(camera: SeedSequence) -> SeedSequence:
    """Return the stream of the bursts in which corners are missed, from the camera's stream."""
    return _child(camera, 1)


def alignment_stream(imu: SeedSequence) -> SeedSequence:
    """Return the stream of the scale factors and the misalignment of an inertial unit.

    The errors do not change the noise of the unit.

    Args:
        imu: the stream of the unit.
    """
    return _child(imu, 0)


def offroad_streams(seed: int) -> Streams:
    """Return the streams of an off-road drive.

    `gusts` is the stream of the disturbance; vehicle, sensors, gates and faults are not used.
    """
    root = SeedSequence(seed)
    return Streams(
        planner=_child(root, 0),
        gusts=_child(root, 1),
        vehicle=_child(root, 2),
        sensors=_child(root, 3),
        gates=_child(root, 4),
        faults=_child(root, 5),
        link=_child(root, 6),
    )


def double_integrator_streams(seed: int) -> Streams:
    """Return the streams of the double integrator, of which only the planner's is used."""
    root = SeedSequence(seed)
    return Streams(
        planner=root,
        vehicle=_child(root, 0),
        gusts=_child(root, 1),
        sensors=_child(root, 2),
        gates=_child(root, 3),
        faults=_child(root, 4),
        link=_child(root, 5),
    )


def start_stream(seed: int, course: int) -> SeedSequence:
    """Return the stream of the states in which episodes on a course start.

    Args:
        seed: seed of the environment.
        course: index of the course, from 0.
    """
    return _child(SeedSequence(seed), course)


def start_vehicle_streams(starts: SeedSequence, row: int, racers: int) -> list[SeedSequence]:
    """Return the streams of the domain randomization of one row of starts, one for each racer.

    Args:
        starts: the course's `start_stream`.
        row: index of the row, from 0.
        racers: number of vehicles that race together.
    """
    if racers == 1:
        return [_child(starts, row)]
    return [_child(starts, row, racer) for racer in range(racers)]


def observation_noise_key(seed: int) -> np.ndarray:
    """Return the key of the counter-based generator of the noise on observations.  (2,) uint32"""
    return np.array([seed & 0xFFFFFFFF, OBSERVATION_NOISE], np.uint32)


def fresh_seed() -> int:
    """Return a seed from the operating system, for environments that are reset without a seed."""
    return int(SeedSequence().generate_state(1)[0])


def training_stream(seed: int) -> SeedSequence:
    """Return the stream of training: initial weights, explored actions, order of minibatches."""
    return SeedSequence([seed, TRAINING])


def batch_stream(seed: int) -> SeedSequence:
    """Return the stream of the order and the variation of pictures in a network's training."""
    return _child(training_stream(seed), 0)


def venue_stream(seed: int, venue: int) -> SeedSequence:
    """Return the stream of noise and banners in the training pictures of a venue.

    Args:
        seed: seed of all pictures.
        venue: number of the venue, from 0.
    """
    return SeedSequence([seed, venue])


def identification_streams() -> tuple[SeedSequence, SeedSequence]:
    """Return the streams of the commands for identifying a rate loop and for checking it."""
    root = SeedSequence(0)
    return _child(root, 0), _child(root, 1)


def pose_stream(seed: int, picture: int) -> SeedSequence:
    """Return the stream of the pose from which a picture is taken.

    Args:
        seed: seed of all pictures.
        picture: number of the picture, from 0.
    """
    return SeedSequence([seed, picture])


def look_streams(seed: int, picture: int) -> LookStreams:
    """Return the streams of the look of a picture.

    Args:
        seed: seed of all pictures.
        picture: number of the picture, from 0.
    """
    look = SeedSequence([seed, LOOKS + picture])
    return LookStreams(
        textures=_child(look, 0),
        light=_child(look, 1),
        background=_child(look, 2),
    )


def picture_streams(pixels: SeedSequence) -> PictureStreams:
    """Return the streams of the pictures of one flight, derived from the stream `pixels`."""
    return PictureStreams(
        noise=_child(pixels, 0),
        look=LookStreams(
            textures=_child(pixels, 1),
            light=_child(pixels, 2),
            background=_child(pixels, 3),
        ),
        banners=_child(pixels, 4),
    )


def texture_stream() -> SeedSequence:
    """Return the stream of the noise in the textures, the same for every seed."""
    return SeedSequence(0)


def course_stream(seed: int, number: int) -> SeedSequence:
    """Return the stream of a generated course.

    Args:
        seed: seed of all generated courses.
        number: number of the course, from 1.
    """
    return _child(SeedSequence(seed), number - 1)


def _child(parent: SeedSequence, *key: int) -> SeedSequence:
    """Return the stream that `parent.spawn` gives for this key, without counting it as spawned."""
    return SeedSequence(
        entropy=parent.entropy,
        spawn_key=(*parent.spawn_key, *key),
        pool_size=parent.pool_size,
    )
