"""The least-squares problem: signals as the numbers predict them, against the logged ones.

    speed of a rotor      s = lag(command (voltage / reference)^power)
    thrust over mass      a = sum of c2 s^2 + c1 s + c0 over the rotors
    accelerometer         a (tilt_x - flapping w_y, tilt_y + flapping w_x, 1) - d v_body + bias
    body rates            omega' = (signs a + offset sum a) / inertia - gyroscopic
    velocity              v' = R(q) (a (pose_tilt_x, pose_tilt_y, 1) - d v_body) - g e_z

Body rates and velocity are predicted over short open-loop pieces (multiple shooting). Each piece
has an initial value of its own, and in body rates a constant torque of the air of its own, too. The
flight controller answers that torque by its motors: without it, the inertia would come out too
large and the lag of the rotors too short. As the pieces follow the measured attitude and rates,
both enter linearly, and leave with the line that fits the residuals of a piece best.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from quadsim.dynamics.rate_torque import gyroscopic
from quadsim.identify.geometry import Geometry
from quadsim.identify.numbers import FitNumbers
from quadsim.identify.prepared import Prepared
from quadsim.identify.rotors import rotor_speeds, thrusts
from quadsim.identify.stretches import Stretch
from quadsim.rotation import to_world
from quadsim.vehicle import GRAVITY

RATE_PIECE = 0.2  # duration of a piece of body rates, and of accelerations [s]
VELOCITY_PIECE = 1.0  # and of velocities [s]
CLUSTER = 1.0  # residuals within this time are taken as one reading for the intervals [s]
# Numbers from which the thrusts of the rotors follow, and with them all else
ROTOR_NUMBERS = ("delay", "tau", "c2", "c1", "c0", "voltage_power")
DRAG = ("drag_x", "drag_y", "drag_z")
INERTIA = (
    "inertia_x",
    "inertia_y",
    "inertia_z",
    "offset_x",
    "offset_y",
    "offset_z",
    "yaw_lead",
    "flatness",
)


class Channel(NamedTuple):
    """A measured signal and its prediction."""

    name: str
    measured: Callable[[Prepared], np.ndarray | None]  # (n, 3)
    # from the stretch, the numbers, the geometry and the thrusts of the rotors (n, 4)
    predicted: Callable[[Prepared, FitNumbers, Geometry, np.ndarray], np.ndarray]  # (n, 3)
    piece: float  # duration of an open-loop piece [s]
    # What each piece has of its own: nothing (0), an initial value (1), a constant slope, too (2)
    free: int
    numbers: tuple[str, ...]  # that the prediction needs, besides the numbers of the rotors
    # whether the signal is later than the rotors' answer by force_lag
    is_late: bool = False


def predicted_force(
    part: Prepared, numbers: FitNumbers, geometry: Geometry, single: np.ndarray
) -> np.ndarray:
    """Return what the accelerometer measures [m/s^2]  (n, 3)."""
    total = single.sum(axis=1)
    axis = np.array([numbers.tilt_x, numbers.tilt_y, 1.0])
    force = total[:, None] * axis + (numbers.bias_x, numbers.bias_y, numbers.bias_z)
    if part.v_body is not None:
        force += drag_acceleration(part.v_body, numbers)
    if part.rates is not None:
        side = numbers.flapping * total
        force[:, 0] -= side * part.rates[:, 1]
        force[:, 1] += side * part.rates[:, 0]
    return force


def predicted_rates(
    part: Prepared, numbers: FitNumbers, geometry: Geometry, single: np.ndarray
) -> np.ndarray:
    """Return what the gyro measures minus the rates at a piece's start [rad/s]  (n, 3)."""
    assert part.rates is not None
    beta = angular_accelerations(
        part.rates, torques(part, single, numbers, geometry), numbers, geometry
    )
    return integrated(beta, part.stretch)


def predicted_velocity(
    part: Prepared, numbers: FitNumbers, geometry: Geometry, single: np.ndarray
) -> np.ndarray:
    """Return the velocity minus its value at a piece's start [m/s]  (n, 3)."""
    assert part.v_body is not None
    assert part.attitude is not None
    total = single.sum(axis=1)
    acceleration = world_acceleration(total, part.attitude, part.v_body, numbers)
    return integrated(acceleration, part.stretch) - numbers.velocity_lag * acceleration


def integrated(slope: np.ndarray, part: Stretch) -> np.ndarray:
    """Return the integral from the first row on  (n, 3).

    As in the plants, the value after a step is the one before it and the slope after the step times
    its duration. In a row of several steps, the slopes between are on the line from row to row.
    """
    newer = 0.5 + 0.5 * part.plant_step / part.dt
    steps = newer * slope[1:] + (1.0 - newer) * slope[:-1]
    return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0) * part.dt])


def drag_acceleration(v_body: np.ndarray, numbers: FitNumbers) -> np.ndarray:
    """Return the acceleration by the drag, in the body's axes [m/s^2]  (n, 3)."""
    return -v_body * np.array([numbers.drag_x, numbers.drag_y, numbers.drag_z])


def torques(
    part: Prepared, single: np.ndarray, numbers: FitNumbers, geometry: Geometry
) -> np.ndarray:
    """Return the torques of the rotors over mass and lever arm [m/s^2]  (n, 3).

    Args:
        part: the stretch.
        single: thrusts of the rotors over the mass [m/s^2]  (n, 4).
        numbers: with the centre of mass and the lead of the yaw.
        geometry: signs of the thrusts in the torques.
    """
    offset = np.array([numbers.offset_x, numbers.offset_y, numbers.offset_z])
    # einsum: a product of a long and a small matrix gains nothing from threads
    torque = np.einsum("nr,kr->nk", single, geometry.signs)
    torque[:, 2] += numbers.yaw_lead * np.gradient(torque[:, 2], part.stretch.dt)
    return torque + single.sum(axis=1)[:, None] * offset


def angular_accelerations(
    rates: np.ndarray, torque: np.ndarray, numbers: FitNumbers, geometry: Geometry
) -> np.ndarray:
    """Return the angular accelerations by the rotors [rad/s^2]  (n, 3).

    Args:
        rates: body rates [rad/s]  (n, 3).
        torque: of the rotors, over mass and lever arm [m/s^2]  (n, 3).
        numbers: with the inertia.
        geometry: what is not fitted.
    """
    over_arm = np.array([numbers.inertia_x, numbers.inertia_y, numbers.inertia_z])
    inertia = geometry.inertia(numbers)
    x, y, z = rates.T
    gyro = np.stack(gyroscopic((x, y, z), inertia), axis=1) / np.array(inertia)
    return torque / over_arm - gyro


def world_acceleration(
    total: np.ndarray, attitude: np.ndarray, v_body: np.ndarray, numbers: FitNumbers
) -> np.ndarray:
    """Return the acceleration in the world [m/s^2]  (n, 3).

    Args:
        total: thrust over mass [m/s^2]  (n,).
        attitude: measured quaternions  (n, 4).
        v_body: velocity in the body's axes [m/s]  (n, 3).
        numbers: with drag and the direction of the thrust.
    """
    axis = np.array([numbers.pose_tilt_x, numbers.pose_tilt_y, 1.0])
    body = total[:, None] * axis + drag_acceleration(v_body, numbers)
    world = np.stack(to_world(attitude.T, body.T), axis=1)
    world[:, 2] -= GRAVITY
    return world


CHANNELS = (
    Channel(
        "force",
        lambda part: part.stretch.specific_force,
        predicted_force,
        RATE_PIECE,
        0,
        (*DRAG, "bias_x", "bias_y", "bias_z", "tilt_x", "tilt_y", "flapping", "force_lag"),
        is_late=True,
    ),
    Channel(
        "rate",
        lambda part: part.stretch.body_rates if part.has_single else None,
        predicted_rates,
        RATE_PIECE,
        2,
        INERTIA,
    ),
    Channel(
        "velocity",
        lambda part: part.stretch.velocity if part.v_body is not None else None,
        predicted_velocity,
        VELOCITY_PIECE,
        1,
        (*DRAG, "pose_tilt_x", "pose_tilt_y", "velocity_lag"),
    ),
)


class Block(NamedTuple):
    """The usable pieces of one channel in one stretch."""

    part: Prepared
    channel: Channel
    axes: tuple[int, ...]  # that are compared
    rows: slice  # of the stretch, a whole number of pieces
    shape: tuple[int, int, int]  # pieces, averages of a piece, rows of an average
    whole: np.ndarray  # which pieces are usable  (pieces,)
    measured: np.ndarray  # averages  (usable pieces, averages, axes)
    cluster: np.ndarray  # of each residual  (m,)

    def residuals(self, numbers: FitNumbers, geometry: Geometry, single: np.ndarray) -> np.ndarray:
        """Return measured minus predicted, axis after axis  (m,)."""
        predicted = self.channel.predicted(self.part, numbers, geometry, single)
        missing = self.measured - self._averages(predicted)
        return self._without_free(missing).transpose(2, 0, 1).ravel()

    def variances(self) -> np.ndarray:
        """Return the variance of what is measured in the pieces, along each axis  (axes,)."""
        return np.var(self._without_free(self.measured), axis=(0, 1))

    def _without_free(self, values: np.ndarray) -> np.ndarray:
        """Return averages minus each piece's own line or constant  (pieces, averages, axes)."""
        if not self.channel.free:
            return values
        # Polynomials over a piece, orthonormal  (averages, free)
        times = np.linspace(-1.0, 1.0, self.shape[1])
        basis, _ = np.linalg.qr(np.vander(times, self.channel.free))
        own = np.einsum("nb,pna->pba", basis, values)
        return values - np.einsum("nb,pba->pna", basis, own)

    def _averages(self, values: np.ndarray) -> np.ndarray:
        """Return a signal's averages in the usable pieces  (usable pieces, averages, axes)."""
        return averages(values[self.rows, self.axes], self.shape, self.whole)


def averages(values: np.ndarray, shape: tuple[int, int, int], whole: np.ndarray) -> np.ndarray:
    """Return the averages of neighbouring rows in the usable pieces.

    Args:
        values: signal  (n, axes).
        shape: pieces, averages of a piece, rows of an average.
        whole: which pieces are usable  (pieces,).

    Returns:
        (usable pieces, averages, axes)
    """
    chosen = values.reshape(*shape, values.shape[1])[whole]
    return chosen[:, :, 0] if shape[2] == 1 else chosen.mean(axis=2)


def blocks_of(parts: Sequence[Prepared], turning: Sequence[int]) -> list[Block]:
    """Return the blocks of residuals of some stretches.

    Args:
        parts: the stretches.
        turning: axes of the body rates that are compared.
    """
    found = []
    first = 0
    for part in parts:
        mine = [_block(part, channel, first, turning) for channel in CHANNELS]
        found += [block for block in mine if block is not None]
        first += int(part.stretch.duration / CLUSTER) + 1
    return found


def _block(part: Prepared, channel: Channel, first: int, turning: Sequence[int]) -> Block | None:
    """Return the block of a channel, None without a usable piece.

    Args:
        part: the stretch.
        channel: its channel.
        first: number of the first cluster.
        turning: axes of the body rates that are compared.
    """
    measured = channel.measured(part)
    # Without a velocity the drag is not known, and the sides of the accelerometer tell nothing.
    is_upright = channel.name == "force" and part.v_body is None
    axes = (2,) if is_upright else tuple(turning) if channel.name == "rate" else (0, 1, 2)
    if measured is None or not axes:
        return None
    dt = part.stretch.dt
    rows = part.mean_rows
    each = max(round(channel.piece / dt / rows), 2)
    pieces = len(measured) // (each * rows)
    shape = (pieces, each, rows)
    used = slice(0, pieces * each * rows)
    usable = part.usable & np.all(np.isfinite(measured), axis=1)
    if part.v_body is not None and channel.name != "rate":
        usable &= part.has_pose
    whole = usable[used].reshape(pieces, each * rows).all(axis=1)
    if not np.any(whole):
        return None
    begins = np.flatnonzero(whole) * each * rows * dt
    cluster = first + np.repeat((begins / CLUSTER).astype(int), each)
    return Block(
        part=part,
        channel=channel,
        axes=axes,
        rows=used,
        shape=shape,
        whole=whole,
        measured=averages(measured[used, axes], shape, whole),
        cluster=np.tile(cluster, len(axes)),
    )


def single_thrusts(part: Prepared, numbers: FitNumbers, lag: float = 0.0) -> np.ndarray:
    """Return the thrusts of the rotors over the mass, some time late [m/s^2]  (n, 4)."""
    return thrusts(rotor_speeds(part, numbers, lag), numbers)
