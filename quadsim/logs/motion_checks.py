"""Checks of signals against each other: a vehicle moves by the forces that its log has.

The acceleration in the world is what the accelerometer measures, turned by the attitude, without
gravity: dv/dt = R f - g. Signals in another unit or frame, or late ones, contradict this. The
error names the change of the log after which the signals agree, if one is known.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from quadsim.logs.frames import from_ned, from_ned_and_frd, products
from quadsim.logs.raw_log import LogError
from quadsim.rotation import product, to_body, to_world

GRAVITY = 9.81  # [m/s^2]
OVER = 0.2  # accelerations are averaged over this time [s]
FEWEST = 20  # averages that say something
LEAST_MOTION = 1.0  # root mean square of accelerations that say something [m/s^2]
# Motion is contradicted by forces that are less alike (a cosine), or by forces that are alike but
# larger or smaller by a factor.
LEAST_LIKENESS = 0.1
ALIKE = 0.5
MOST = 2.5
TINY = 1e-9
# A change is the cause if more than this share of the motion was left without it, less than this
# share is left with it, and what is left is smaller by this factor.
NOT_EXPLAINED = 0.3
AGREES = 0.6
FAR_BETTER = 0.6
UNKNOWN_CAUSE = "correct unit, frame or time of position, velocity, attitude and accelerometer"
# An accelerometer reads this many times the true force.
LEAST_SCALE = 0.85
LARGEST_SCALE = 1.15
# Time over which gravity is found with a gyro alone, and what may be found in place of 1 g: the
# velocity changes in this time, too.
TURN_TIME = 6.0  # [s]
MOST_KNOWN = 0.7  # share of readings that are known in this time
LEAST_GRAVITY = 0.7
LARGEST_GRAVITY = 1.35
# A pose may be this much later than the gyro [s].
LATEST_POSE = 0.06
LAGS = 0.3  # lags that are tried [s]
CLEAR = 0.7  # correlation at the best lag from which it says something


class Motion(NamedTuple):
    """The signals that are compared."""

    t: np.ndarray  # [s]  (n,)
    velocity: np.ndarray  # [m/s]  (n, 3)
    quaternion: np.ndarray  # (n, 4)
    force: np.ndarray | None  # of the accelerometer [m/s^2]  (n, 3)


class Change(NamedTuple):
    """A possible mistake in a log or its mapping, and its correction."""

    cause: str
    apply: Callable[[Motion], Motion]


def expect_motion(name: str, t: np.ndarray, signals: Mapping[str, np.ndarray]) -> None:
    """Raise LogError if the signals contradict each other.

    Args:
        name: name of the log.
        t: time, rising [s]  (n,).
        signals: the signals that the log has, by key of SIGNALS.
    """
    step = float(np.median(np.diff(t)))
    if {"body_rates", "quaternion"} <= signals.keys():
        late = _lateness(t, signals["quaternion"], signals["body_rates"], step)
        if abs(late) > LATEST_POSE:
            wanted = f"expected an attitude at most {LATEST_POSE:g} s later than the gyro"
            raise LogError(f"{name}: quaternion: {wanted}, got {late:.2g} s: correct its time")
    velocity = signals.get("velocity")
    if velocity is None and "position" in signals:
        velocity = _slope(t, signals["position"], step)
    if velocity is not None and "quaternion" in signals:
        motion = Motion(t, velocity, signals["quaternion"], signals.get("specific_force"))
        _expect_forces(name, motion, step)
    if {"body_rates", "specific_force"} <= signals.keys():
        _expect_one_g(name, t, signals["body_rates"], signals["specific_force"], step)


def _expect_forces(name: str, motion: Motion, step: float) -> None:
    """Raise LogError if the velocity does not change as the forces say."""
    moved, forced = _accelerations(motion, step)
    if len(moved) < FEWEST:
        return
    if motion.force is not None:
        _expect_scale(name, moved, forced)
    cause = _cause(motion, step, _left(moved, forced))
    if not cause and not _contradicted(moved, forced, has_vertical=motion.force is not None):
        return
    signals = "accelerometer and attitude" if motion.force is not None else "the attitude"
    wanted = f"expected a velocity that changes by {signals} (dv/dt = R f - g)"
    raise LogError(f"{name}: velocity: {wanted}, got one that does not: {cause or UNKNOWN_CAUSE}")


def _expect_scale(name: str, moved: np.ndarray, forced: np.ndarray) -> None:
    """Raise LogError if another scale of the accelerometer explains the motion."""
    up = (0.0, 0.0, GRAVITY)
    force = forced + up
    scale = float(np.mean((moved + up) * force) / np.mean(force**2))
    is_off = scale > 0.0 and not LEAST_SCALE <= scale <= LARGEST_SCALE
    explained = _left(moved, scale * force - up) < AGREES * max(_rms(moved), LEAST_MOTION)
    if is_off and explained:
        wanted = "expected an accelerometer that agrees with the velocity (dv/dt = R f - g)"
        advice = "correct its unit or scale"
        raise LogError(
            f"{name}: specific_force: {wanted}, got {1.0 / scale:.3g} times that: {advice}"
        )


def _contradicted(moved: np.ndarray, forced: np.ndarray, *, has_vertical: bool) -> bool:
    """Return whether the motion is another one than the forces say, sideways or vertically.

    Args:
        moved: accelerations of the velocity [m/s^2]  (m, 3).
        forced: accelerations by the forces  (m, 3).
        has_vertical: whether the force along the vertical is measured.
    """
    for axes in (slice(0, 2), slice(2, 3)) if has_vertical else (slice(0, 2),):
        m, f = moved[:, axes], forced[:, axes]
        if _rms(f) < LEAST_MOTION:
            continue
        # The cosine between the two: noise lowers it, and another frame leaves nothing of it.
        likeness = float(np.mean(m * f)) / max(_rms(m) * _rms(f), TINY)
        ratio = _rms(m) / _rms(f)
        if likeness < LEAST_LIKENESS or (likeness > ALIKE and not 1 / MOST < ratio < MOST):
            return True
    return False


def _cause(motion: Motion, step: float, left: float) -> str:
    """Return what is wrong, "" if no change makes the signals agree far better.

    Args:
        motion: the signals.
        step: time between two rows [s].
        left: root mean square of the motion that is not explained without a change [m/s^2].
    """
    best = ""
    least = FAR_BETTER * left
    for change in CHANGES:
        moved, forced = _accelerations(change.apply(motion), step)
        size = _rms(moved)
        after = _left(moved, forced)
        # A change that is not needed explains nothing that was left.
        if after < least and after < AGREES * size and left > NOT_EXPLAINED * size:
            best = change.cause
            least = after
    return best


def _swapped(motion: Motion) -> Motion:
    return motion._replace(velocity=motion.velocity[:, [1, 0, 2]])


def _from_body(motion: Motion) -> Motion:
    turned = to_world(motion.quaternion.T, motion.velocity.T)
    return motion._replace(velocity=np.stack(turned, axis=1))


def _turned(turn: tuple[float, float, float, float]) -> Callable[[Motion], Motion]:
    """Return a change that turns the world of the attitude."""

    def turned(motion: Motion) -> Motion:
        return motion._replace(quaternion=products(np.array(turn), motion.quaternion))

    return turned


def _inverse(motion: Motion) -> Motion:
    return motion._replace(quaternion=motion.quaternion * (1.0, -1.0, -1.0, -1.0))


def _reordered(motion: Motion) -> Motion:
    return motion._replace(quaternion=motion.quaternion[:, [3, 0, 1, 2]])


def _with_gravity(motion: Motion) -> Motion:
    if motion.force is None:
        return motion
    up = np.stack(to_body(motion.quaternion.T, (0.0, 0.0, GRAVITY)), axis=1)
    return motion._replace(force=motion.force + up)


def _ned(motion: Motion) -> Motion:
    force = None if motion.force is None else motion.force * (1.0, -1.0, -1.0)
    return Motion(motion.t, from_ned(motion.velocity), from_ned_and_frd(motion.quaternion), force)


HALF = 0.5**0.5
CHANGES = (
    Change("x and y of the velocity are exchanged: name the column of east first", _swapped),
    Change("the velocity is in the body's axes: turn it into the world's", _from_body),
    Change("the attitude is turned by -90 deg about the vertical", _turned((HALF, 0, 0, HALF))),
    Change("the attitude is turned by 90 deg about the vertical", _turned((HALF, 0, 0, -HALF))),
    Change("the attitude is turned by 180 deg about the vertical", _turned((0.0, 0, 0, 1.0))),
    Change("the quaternion turns the world into the body: change the signs of x, y, z", _inverse),
    Change("the quaternion is x, y, z, w: name the column of w first", _reordered),
    Change("the accelerometer is without gravity: log what it measures itself", _with_gravity),
    Change("the log is in NED and FRD: write world: NED and body: FRD", _ned),
)


def _accelerations(motion: Motion, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the accelerations of the velocity and of the forces, averaged over OVER  (m, 3)."""
    lag = max(1, round(OVER / step))
    time = motion.t[lag:] - motion.t[:-lag]
    moved = (motion.velocity[lag:] - motion.velocity[:-lag]) / time[:, None]
    up = (0.0, 0.0, GRAVITY)
    if motion.force is not None:
        forced = _mean(_world(motion.quaternion, motion.force), lag) - up
    else:
        # The thrust is along the body's z, and as large as the motion needs.
        along_z = np.tile((0.0, 0.0, 1.0), (len(motion.t), 1))
        axis = _mean(_world(motion.quaternion, along_z), lag)
        forced = axis * np.linalg.norm(moved + up, axis=1, keepdims=True) - up
    known = np.all(np.isfinite(moved), axis=1) & np.all(np.isfinite(forced), axis=1)
    # Not across gaps
    known &= time < 2.0 * lag * step
    return moved[known], forced[known]


def _world(quaternion: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return vectors of the body in the world  (n, 3)."""
    return np.stack(to_world(quaternion.T, vectors.T), axis=1)


def _mean(values: np.ndarray, lag: int) -> np.ndarray:
    """Return the mean of the known readings of each `lag` rows, NaN without any  (n - lag, 3)."""
    known = np.isfinite(values)
    total = np.cumsum(np.where(known, values, 0.0), axis=0)
    count = np.cumsum(known, axis=0)
    number = count[lag:] - count[:-lag]
    return np.where(number > 0, (total[lag:] - total[:-lag]) / np.maximum(number, 1), np.nan)


def _slope(t: np.ndarray, position: np.ndarray, step: float) -> np.ndarray:
    """Return the velocity by the positions half of OVER before and after  (n, 3)."""
    half = max(1, round(0.5 * OVER / step))
    found = np.full(position.shape, np.nan)
    time = t[2 * half :] - t[: -2 * half]
    found[half:-half] = (position[2 * half :] - position[: -2 * half]) / time[:, None]
    return found


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _left(moved: np.ndarray, forced: np.ndarray) -> float:
    """Return the root mean square of the motion that the forces do not explain [m/s^2]."""
    return _rms(moved - forced)


def _expect_one_g(
    name: str, t: np.ndarray, rates: np.ndarray, force: np.ndarray, step: float
) -> None:
    """Raise LogError if accelerometer and gyro together do not find gravity.

    The forces of some seconds, turned into the axes of the first row by the gyro, have gravity as
    their mean, but for the change of the velocity.
    """
    length = round(TURN_TIME / step)
    known = np.all(np.isfinite(rates), axis=1) & np.all(np.isfinite(force), axis=1)
    rates = np.nan_to_num(rates)
    found = []
    for first in range(0, len(t) - length, length):
        rows = slice(first, first + length)
        if known[rows].mean() < MOST_KNOWN or t[rows][-1] - t[rows][0] > 1.5 * TURN_TIME:
            continue
        found.append(float(np.linalg.norm(_mean_force(rates[rows], force[rows], step))))
    if not found:
        return
    share = float(np.median(found)) / GRAVITY
    if not LEAST_GRAVITY <= share <= LARGEST_GRAVITY:
        wanted = "expected forces whose mean, turned by the gyro, is 1 g"
        advice = "correct unit or scale of the accelerometer or the gyro"
        raise LogError(f"{name}: specific_force: {wanted}, got {share:.2g} g: {advice}")


def _mean_force(rates: np.ndarray, force: np.ndarray, step: float) -> np.ndarray:
    """Return the mean force in the axes of the first row  (3,)."""
    turns = _small_turns(rates * step).tolist()
    q = (1.0, 0.0, 0.0, 0.0)
    attitudes = np.empty((len(rates), 4))
    for k in range(len(rates)):
        attitudes[k] = q
        q = product(q, turns[k])
    return np.nanmean(_world(attitudes, force), axis=0)


def _small_turns(turns: np.ndarray) -> np.ndarray:
    """Return the quaternions of some turns [rad]  (n, 4)."""
    half = 0.5 * np.linalg.norm(turns, axis=1, keepdims=True)
    return np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * turns], axis=1)


def _lateness(t: np.ndarray, quaternion: np.ndarray, rates: np.ndarray, step: float) -> float:
    """Return the time by which the attitude turns later than the gyro says, 0 if unclear [s]."""
    turned = _turn_rates(t, quaternion)
    most = round(LAGS / step)
    known = np.all(np.isfinite(turned), axis=1) & np.all(np.isfinite(rates[1:]), axis=1)
    if most < 1 or known.sum() < 10 * most:
        return 0.0
    x = np.where(known[:, None], rates[1:], 0.0)
    y = np.where(known[:, None], turned, 0.0)
    size = float(np.linalg.norm(x) * np.linalg.norm(y))
    if not size:
        return 0.0
    padded = 2 ** int(np.ceil(np.log2(2 * len(x))))
    spectrum = np.conj(np.fft.rfft(x, padded, axis=0)) * np.fft.rfft(y, padded, axis=0)
    likeness = np.fft.irfft(spectrum, padded, axis=0).sum(axis=1) / size
    shifts = np.arange(-most, most + 1)
    best = int(shifts[np.argmax(likeness[shifts])])
    return best * step if likeness[best] > CLEAR else 0.0


def _turn_rates(t: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the body rates by the turns from row to row [rad/s]  (n - 1, 3)."""
    back = q[:-1] * (1.0, -1.0, -1.0, -1.0)
    w, x, y, z = products(back, q[1:]).T
    sign = np.where(w < 0.0, -1.0, 1.0)
    return 2.0 * np.stack([x, y, z], axis=1) * (sign / np.diff(t))[:, None]
