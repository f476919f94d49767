"""Stages: the numbers that fit best, found from simple models to larger ones.

Delays come first: the time of the answer is known from the correlation of commands and answers.
Then thrust maps that are a square, then axes whose rotation the rotors do not explain are left out,
then whole thrust maps. What the logs tell worse than the prior stays at the prior.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from quadsim.identify.delays import answer_time
from quadsim.identify.geometry import Geometry
from quadsim.identify.intervals import covariances
from quadsim.identify.numbers import FitNumbers, Prior
from quadsim.identify.prepared import LEAST_SPREAD, SINGLE_DRIVES, VOLTAGE_DRIVES, Prepared, middle
from quadsim.identify.problem import DRAG, INERTIA
from quadsim.identify.search import COARSE_GAIN, Solution, solve

# How delay and lag of the rotors may share the time to the answer, which shows the fast part of a
# lag alone: starts of the search
SHARES = ((0.0, 1.5), (0.3, 0.9), (0.7, 0.3))
COARSE = 20.0  # time of flight from which the starts are searched [s]
# Thrust maps with more parts than a square have to fit better than this: the 99.9 % quantile of
# chi-square with as many degrees of freedom as there are more parts.
PAYS = {1: 10.8, 2: 13.8}
# Thrust at the lowest command, as a share of the full one: about none, or less by a dead zone
LEAST_IDLE = -0.3
LARGEST_IDLE = 0.08
LEAST_EXPLAINED = 0.3  # of the rotation about an axis: with less its inertia is not fitted
LEAST_SPEED = 0.3  # root mean square of the velocity along an axis whose drag is fitted [m/s]
COARSE_PIECE = 4.0  # of one flight, at least [s]
MAP = ("c2", "c1", "c0")
ROTORS = ("delay", "tau")
FORCE = ("bias_z",)
FORCE_ASIDE = ("bias_x", "bias_y", "tilt_x", "tilt_y", "flapping")
POSE = ("pose_tilt_x", "pose_tilt_y", "velocity_lag")


def _searchable(parts: Sequence[Prepared]) -> tuple[str, ...]:
    """Return the names of the numbers that the signals of the logs may determine."""
    drive = parts[0].drive
    has_force = any(part.stretch.specific_force is not None for part in parts)
    has_velocity = any(part.v_body is not None for part in parts)
    has_rates = drive in SINGLE_DRIVES and any(
        part.stretch.body_rates is not None for part in parts
    )
    names: list[str] = []
    if has_force or has_velocity:
        names += MAP
    if drive != "rotor_speeds":
        names += ROTORS
    if drive in VOLTAGE_DRIVES and _spread(parts) > LEAST_SPREAD:
        names.append("voltage_power")
    if has_velocity:
        names += [name for name in DRAG if name not in _slow_axes(parts)]
        names += POSE
    if has_force:
        names += FORCE if has_velocity else ()
        names += FORCE_ASIDE if has_velocity else ()
    if has_rates:
        names += INERTIA
        names += ("force_lag",) if has_force else ()
    return tuple(names)


def _slow_axes(parts: Sequence[Prepared]) -> dict[str, float]:
    """Return the root mean square of the velocity along the axes whose drag cannot be found [m/s].

    Noise of the velocity, some cm/s, would make the drag along them too small.
    """
    moving = [part.v_body[part.usable & part.has_pose] for part in parts if part.v_body is not None]
    if not moving:
        return {}
    speeds = np.sqrt(np.mean(np.concatenate(moving) ** 2, axis=0))
    pairs = zip(DRAG, map(float, speeds), strict=True)
    return {name: speed for name, speed in pairs if not speed >= LEAST_SPEED}


def _spread(parts: Sequence[Prepared]) -> float:
    """Return the standard deviation of the voltage over its mean."""
    return float(np.std(np.concatenate([part.ratio[part.usable] for part in parts])))


class Search(NamedTuple):
    """The best numbers, and those that the logs do not determine."""

    solution: Solution
    turning: tuple[int, ...]  # axes about which the rotors explain the rotation
    untold: tuple[str, ...]  # names of the numbers that stay at the prior
    remarks: tuple[str, ...]


def search_numbers(
    parts: Sequence[Prepared], geometry: Geometry, prior: Mapping[str, Prior]
) -> Search:
    """Return the numbers that fit best: delays first, then simple models before larger ones."""
    searched = _searchable(parts)
    start = FitNumbers(**{name: prior[name].mean for name in FitNumbers._fields})
    # The time of the answer is known from the correlation, how delay and lag share it is not.
    time = answer_time(parts, geometry)
    square = [name for name in searched if name not in MAP[1:]]
    starts = [
        start._replace(delay=delay * time, tau=tau * time, c1=0.0, c0=0.0) for delay, tau in SHARES
    ]
    solution = solve(_coarse(parts), geometry, prior, square, starts, least_gain=COARSE_GAIN)
    solution = solve(parts, geometry, prior, square, [solution.numbers])

    # Rotation that the rotors do not explain would only spoil the rest.
    remarks = [
        f"{name}: the flights are too slow along it, {speed:.2g} m/s RMS, and the prior is kept"
        for name, speed in _slow_axes(parts).items()
    ]
    turning = []
    for k, axis in enumerate("xyz"):
        share = solution.explained.get(f"rate_{axis}")
        if share is not None and share >= LEAST_EXPLAINED:
            turning.append(k)
        elif share is not None:
            remarks.append(
                f"inertia about {axis}: the motors' commands explain {100 * max(share, 0.0):.0f} % "
                "of the rotation, too little to tell it, and the prior is kept"
            )
    if solution.explained and not turning and parts[0].has_single:
        remarks.append(
            "no rotation is explained: the flight is too calm, or the motors are in another order "
            "than front right, rear left, front left, rear right"
        )
    lost = [
        f"{name}_{axis}"
        for k, axis in enumerate("xyz")
        if k not in turning
        for name in ("inertia", "offset")
    ]
    if not turning:
        lost += ["force_lag", "flatness"]
    if 2 not in turning:
        lost.append("yaw_lead")
    lost = [name for name in lost if name in searched]
    searched = [name for name in searched if name not in lost]
    if lost:
        square = [name for name in searched if name not in MAP[1:]]
        begin = solution.numbers._replace(**{name: getattr(start, name) for name in lost})
        solution = solve(parts, geometry, prior, square, [begin], turning)

    if MAP[0] in searched:
        solution, more = _with_map(parts, geometry, prior, searched, solution, turning)
        remarks += more

    # What the log tells worse than the prior stays at the prior.
    told = covariances(solution.linearized).log_alone
    pairs = zip(solution.searched, told, strict=True)
    untold = tuple(name for name, std in pairs if not std < prior[name].std)
    if untold:
        kept = [name for name in solution.searched if name not in untold]
        at_prior = {name: prior[name].mean for name in untold}
        begin = solution.numbers._replace(**at_prior)
        solution = solve(parts, geometry, prior, kept, [begin], turning)
    remarks += [_untold(name) for name in untold]
    return Search(solution, tuple(turning), (*lost, *untold), tuple(remarks))


def _coarse(parts: Sequence[Prepared]) -> list[Prepared]:
    """Return the middles of the flights, which suffice to choose the best start."""
    each = max(COARSE / len(parts), COARSE_PIECE)
    return [middle(part, each) for part in parts]


def _with_map(
    parts: Sequence[Prepared],
    geometry: Geometry,
    prior: Mapping[str, Prior],
    searched: Sequence[str],
    square: Solution,
    turning: Sequence[int],
) -> tuple[Solution, list[str]]:
    """Return the solution with the thrust map that the logs need, and remarks on it.

    A linear and a constant part have to pay, and the map has to be that of a rotor.

    Args:
        parts: what is fitted.
        geometry: what is not fitted.
        prior: of each number.
        searched: names of the numbers that are searched, with the whole map.
        square: solution with a map that is a square.
        turning: axes of the body rates that are compared.
    """
    whole = solve(parts, geometry, prior, searched, [square.numbers], turning)
    if not _pays(whole, MAP[1:]):
        return square, []
    if is_rotor(whole.numbers):
        return whole, []
    remark = (
        f"thrust map: the best fit has {_idle(whole.numbers):.0%} of the full thrust at the lowest "
        "command, as no rotor has, and a simpler map is taken"
    )
    names = [name for name in searched if name != MAP[2]]
    linear = solve(parts, geometry, prior, names, [square.numbers], turning)
    is_better = _pays(linear, MAP[1:2]) and is_rotor(linear.numbers)
    return linear if is_better else square, [remark]


def _pays(solution: Solution, parts_of_map: Sequence[str]) -> bool:
    """Return whether parts of the thrust map differ from 0 beyond doubt."""
    index = [solution.searched.index(name) for name in parts_of_map]
    covariance = covariances(solution.linearized).reported[np.ix_(index, index)]
    values = np.array([getattr(solution.numbers, name) for name in parts_of_map])
    return float(values @ np.linalg.solve(covariance, values)) > PAYS[len(values)]


def is_rotor(numbers: FitNumbers) -> bool:
    """Return whether a thrust map has about no thrust at the lowest command."""
    return LEAST_IDLE <= _idle(numbers) <= LARGEST_IDLE


def _idle(numbers: FitNumbers) -> float:
    """Return the least thrust of a rotor as a share of its thrust at full command."""
    c2, c1, c0 = numbers.c2, numbers.c1, numbers.c0
    lowest = min(max(-c1 / (2.0 * c2), 0.0), 1.0)
    return ((c2 * lowest + c1) * lowest + c0) / (c2 + c1 + c0)


def _untold(name: str) -> str:
    """Return the remark on a number that the logs do not determine."""
    return (
        f"{name}: the flights excite it too little to tell it better than the prior, which is kept"
    )
