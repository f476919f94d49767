"""The best way of a point mass through all passages of a race, and the value of other ways.

The way is found by dynamic programming over random crossings of each passage, backwards from the
finish: the value of a crossing is the least sum of the time of a leg and of the value of a crossing
of the next passage. Some rounds draw their crossings around the best way so far. The best way then
converges to a local optimum by L-BFGS-B on all crossings at once.

Near that way the value of a crossing is a quadratic form. Backwards from the finish, with the
second derivatives of each leg in the crossings at both of its ends,

    V_k = min over z_(k+1) of  T(z_k, z_(k+1)) + V_(k+1)(z_(k+1))

is minimised in closed form, as in differential dynamic programming. An offset that the frame limits
stays at its limit.

The thrust of a real vehicle is limited at every instant, and it has to turn before it pushes
elsewhere. So the time to go is less than the least time of a race.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from quadsim.course import Course
from quadsim.value.leg import PointMass, States, leg_time
from quadsim.value.passages import CROSSING, Passages, passages_of
from quadsim.vehicle import Vehicle

# Number of random crossings of each passage, and of rounds
DRAWN = 60
ROUNDS = 3
# The largest speed that is drawn, as a multiple of the speed after a mean leg from rest
SPEED = 1.6
# Largest angle between velocity and passage in the first round [rad]
CONE = 1.3
# Standard deviations around the best way in the next rounds: of the velocity, as a share of the
# largest speed, and of the offset, as a share of the opening; both shrink with each round.
SPREAD_VELOCITY = 0.15
SPREAD_OFFSET = 0.4
SHRINK = 0.55
# Least speed along the passage, as a share of the largest one
SLOWEST = 0.02
# The most iterations of the last step
ITERATIONS = 200
# Steps of the differences: of an offset [m] and of a velocity [m/s]
STEP = np.array([1e-2, 1e-2, 5e-2, 5e-2, 5e-2])
FINE = 1e-5  # of first derivatives
# Least curvature relative to the largest, so that a leg along which nothing changes has a minimum
LEAST_CURVATURE = 1e-3
AT_LIMIT = 1e-6  # distance to the frame's limit at which an offset counts as limited [m]


@dataclass(frozen=True, eq=False)
class CourseValue:
    """The time to go of a point mass at each passage of a race.

    Examples:
        >>> import quadsim
        >>> from quadsim.value import value_of_course
        >>> spec = quadsim.Spec.of("figure8")
        >>> value = value_of_course(spec.course, spec.vehicle, laps=1)
        >>> 3.5 < value.time < 5.5  # of the whole race [s]
        True
    """

    passages: Passages
    mass: PointMass
    time: float  # time of the race [s]
    mean_speed: float  # straight from the start through all passages, over the time [m/s]
    crossings: np.ndarray  # the best way: its crossing of each passage, see CROSSING  (K, 5)
    to_go: np.ndarray  # time from each passage to the finish on the best way [s]  (K,)
    # First and second derivatives of the time to go by the crossing, without mixed ones
    slope: np.ndarray  # (K, 5)
    curvature: np.ndarray  # at least 0  (K, 5)

    @property
    def splits(self) -> np.ndarray:
        """The times at which the passages are crossed [s].  (K,)"""
        return self.time - self.to_go

    @property
    def speeds(self) -> np.ndarray:
        """The speeds at which the passages are crossed [m/s].  (K,)"""
        return np.linalg.norm(self.crossings[:, 2:], axis=1)

    def path(self, start: np.ndarray, points: int = 40) -> States:
        """Return positions and velocities along the best way.  (K * points + 1, 3) each

        Args:
            start: from which the race begins, at rest [m]  (3,).
            points: number of points of each leg.
        """
        # Here, as it takes a third of a second to load
        from scipy.interpolate import CubicHermiteSpline

        begin = States(np.asarray(start, float), np.zeros(3))
        at = self.passages.states(self.crossings)
        before = _before(begin, at)
        times = np.diff(self.splits, prepend=0.0)
        shares = np.arange(1, points + 1) / points
        positions = [begin.position]
        velocities = [begin.velocity]
        for k, T in enumerate(times):
            # A cubic of time, which is the way without drag
            leg = CubicHermiteSpline(
                (0.0, T),
                np.stack([before.position[k], at.position[k]]),
                np.stack([before.velocity[k], at.velocity[k]]),
            )
            positions.append(leg(shares * T))
            velocities.append(leg(shares * T, 1))
        return States(np.vstack(positions), np.vstack(velocities))


def value_of_course(course: Course, vehicle: Vehicle, laps: int) -> CourseValue:
    """Return the time to go of a race from a standing start, of the vehicle as a point mass.

    Args:
        course: the course.
        vehicle: the vehicle: its radius, largest thrust and drag.
        laps: number of laps.
    """
    passages = passages_of(course, vehicle.radius, laps)
    return value_of_passages(passages, course.start.position, PointMass.of(vehicle))


def value_of_passages(
    passages: Passages,
    start: Sequence[float] | np.ndarray,
    mass: PointMass,
    velocity: Sequence[float] = (0.0, 0.0, 0.0),
) -> CourseValue:
    """Return the time to go through passages.

    Args:
        passages: in the order of the flight, the last one is the finish.
        start: position at the start [m]  (3,).
        mass: the point mass.
        velocity: at the start; default: at rest [m/s]  (3,).
    """
    begin = States(np.array(start, float), np.array(velocity, float))
    crossings = best_way(passages, begin, drawn_way(passages, begin, mass), mass)
    at = passages.states(crossings)
    times = leg_time(_before(begin, at), at, mass)
    ways = np.diff(np.vstack([begin.position, passages.position]), axis=0)
    to_go = np.append(np.cumsum(times[:0:-1])[::-1], 0.0)
    slope, curvature = derivatives(passages, crossings, mass)
    return CourseValue(
        passages=passages,
        mass=mass,
        time=float(times.sum()),
        mean_speed=float(np.linalg.norm(ways, axis=1).sum() / times.sum()),
        crossings=crossings,
        to_go=to_go,
        slope=slope,
        curvature=curvature,
    )


def drawn_way(passages: Passages, begin: States, mass: PointMass) -> np.ndarray:
    """Return the best way over random crossings of each passage.  (K, 5)

    Args:
        passages: in the order of the flight.
        begin: state at the start  (3,) each.
        mass: the point mass.
    """
    rng = np.random.default_rng(0)
    places = np.vstack([begin.position, passages.position])
    leg = np.linalg.norm(np.diff(places, axis=0), axis=1).mean()
    fastest = SPEED * np.sqrt(2.0 * mass.thrust * leg)
    crossings = [_anywhere(rng, half, fastest) for half in passages.half]
    way = _best_of(passages, crossings, begin, mass)
    for round_ in range(1, ROUNDS):
        spread = SHRINK ** (round_ - 1)
        crossings = [
            _around(rng, centre, half, spread, fastest)
            for centre, half in zip(way, passages.half, strict=True)
        ]
        way = _best_of(passages, crossings, begin, mass)
    return way


def _anywhere(rng: np.random.Generator, half: np.ndarray, fastest: float) -> np.ndarray:
    """Return random crossings of an opening, forward within a cone.  (DRAWN, 5)"""
    offset = rng.uniform(-1.0, 1.0, (DRAWN, 2)) * half
    speed = rng.uniform(0.05, 1.0, DRAWN) * fastest
    cos = rng.uniform(np.cos(CONE), 1.0, DRAWN)
    sin = np.sqrt(1.0 - cos**2)
    angle = rng.uniform(0.0, 2.0 * np.pi, DRAWN)
    aside = speed * sin
    velocity = np.column_stack([speed * cos, aside * np.cos(angle), aside * np.sin(angle)])
    return np.hstack([offset, velocity])


def _around(
    rng: np.random.Generator, centre: np.ndarray, half: np.ndarray, spread: float, fastest: float
) -> np.ndarray:
    """Return the crossing `centre` and random ones around it.  (DRAWN, 5)"""
    offset = centre[:2] + rng.normal(size=(DRAWN, 2)) * SPREAD_OFFSET * spread * half
    velocity = centre[2:] + rng.normal(size=(DRAWN, 3)) * SPREAD_VELOCITY * spread * fastest
    velocity[:, 0] = np.maximum(velocity[:, 0], SLOWEST * fastest)
    found = np.hstack([np.clip(offset, -half, half), velocity])
    found[0] = centre
    return found


def _best_of(
    passages: Passages, crossings: list[np.ndarray], begin: States, mass: PointMass
) -> np.ndarray:
    """Return the best way over these crossings of each passage.  (K, 5)"""
    to_go = np.zeros(len(crossings[-1]))
    choices = []  # the best crossing of the next passage for each crossing
    states = [passages.states(each, k) for k, each in enumerate(crossings)]
    for here, there in zip(states[-2::-1], states[:0:-1], strict=True):
        from_each = States(here.position[:, None], here.velocity[:, None])
        through = leg_time(from_each, there, mass) + to_go
        choice = through.argmin(axis=1)
        to_go = through[np.arange(len(choice)), choice]
        choices.append(choice)
    chosen = int((leg_time(begin, states[0], mass) + to_go).argmin())
    way = [crossings[0][chosen]]
    for each, choice in zip(crossings[1:], choices[::-1], strict=True):
        chosen = int(choice[chosen])
        way.append(each[chosen])
    return np.array(way)


def best_way(passages: Passages, begin: States, way: np.ndarray, mass: PointMass) -> np.ndarray:
    """Return the local optimum near a way.  (K, 5)

    Args:
        passages: in the order of the flight.
        begin: state at the start  (3,) each.
        way: a crossing of each passage  (K, 5).
        mass: the point mass.
    """
    # Here, as it takes a third of a second to load
    from scipy.optimize import minimize

    K, n = way.shape
    steps = np.concatenate([np.zeros((1, n)), FINE * np.eye(n), -FINE * np.eye(n)])

    def time_and_slope(numbers: np.ndarray) -> tuple[float, np.ndarray]:
        # A change of one crossing changes the leg to it and the leg from it.
        varied = passages.states(numbers.reshape(K, n) + steps[:, None])
        at = States(varied.position[0], varied.velocity[0])
        to = leg_time(_before(begin, at), varied, mass)  # (11, K)
        out = States(varied.position[:, :-1], varied.velocity[:, :-1])
        onward = leg_time(out, States(at.position[1:], at.velocity[1:]), mass)  # (11, K - 1)
        both = to.copy()
        both[:, :-1] += onward
        slope = (both[1 : n + 1] - both[n + 1 :]) / (2.0 * FINE)
        return float(to[0].sum()), slope.T.ravel()

    slowest = SLOWEST * np.abs(way[:, 2]).max()
    low = np.full((K, n), -np.inf)
    high = np.full((K, n), np.inf)
    low[:, :2] = -passages.half
    high[:, :2] = passages.half
    low[:, 2] = slowest
    bounds = np.column_stack([low.ravel(), high.ravel()])
    found = minimize(
        time_and_slope,
        way.ravel(),
        jac=True,
        method="L-BFGS-B",
        bounds=bounds,
        options={"maxiter": ITERATIONS, "maxcor": 20},
    )
    return found.x.reshape(K, n)


def derivatives(
    passages: Passages, way: np.ndarray, mass: PointMass
) -> tuple[np.ndarray, np.ndarray]:
    """Return slope and curvature of the time to go in each crossing of the best way.

    Args:
        passages: in the order of the flight.
        way: its crossing of each passage  (K, 5).
        mass: the point mass.

    Returns:
        First derivatives, and second ones without mixed ones, at least 0.  (K, 5) each
    """
    n = len(CROSSING)
    slopes = np.zeros_like(way)
    curvatures = np.zeros_like(way)
    slope = np.zeros(n)
    hessian = np.zeros((n, n))
    for k in range(len(way) - 2, -1, -1):
        by_leg, leg_hessian = _leg_derivatives(passages, way, k, mass)
        # The crossing behind minimises the leg and what comes after it.
        limited = np.abs(way[k + 1][:2]) > passages.half[k + 1] - AT_LIMIT
        free = np.flatnonzero(np.append(~limited, [True] * 3))
        behind = _positive(leg_hessian[n:, n:] + hessian)[np.ix_(free, free)]
        mixed = leg_hessian[:n, n:][:, free]
        answer = np.linalg.solve(behind, mixed.T).T
        slope = by_leg[:n] - answer @ (by_leg[n:] + slope)[free]
        hessian = _positive(leg_hessian[:n, :n] - answer @ mixed.T)
        slopes[k] = slope
        curvatures[k] = np.diag(hessian)
    return slopes, curvatures


def _leg_derivatives(
    passages: Passages, way: np.ndarray, k: int, mass: PointMass
) -> tuple[np.ndarray, np.ndarray]:
    """Return first and second derivatives of the time of the leg behind passage k.

    Returns:
        By the crossing of passage k and of the next one.  (10,), (10, 10)
    """
    step = np.append(STEP, STEP)
    n = len(step)
    unit = np.diag(step)
    pairs = list(combinations(range(n), 2))
    both = np.array([unit[i] + unit[j] for i, j in pairs])
    varied = np.vstack([np.zeros(n), unit, -unit, both, -both])
    ends = np.append(way[k], way[k + 1]) + varied
    begins, ends = np.split(ends, 2, axis=1)
    times = leg_time(passages.states(begins, k), passages.states(ends, k + 1), mass)
    parts = np.cumsum([1, n, n, len(pairs)])
    centre, plus, minus, pair_plus, pair_minus = np.split(times, parts)
    slope = (plus - minus) / (2.0 * step)
    twice = plus + minus - 2.0 * centre  # second differences
    hessian = np.diag(twice / step**2)
    for (i, j), a, b in zip(pairs, pair_plus, pair_minus, strict=True):
        mixed = (a + b - 2.0 * centre[0] - twice[i] - twice[j]) / (2.0 * step[i] * step[j])
        hessian[i, j] = mixed
        hessian[j, i] = mixed
    return slope, hessian


def _positive(hessian: np.ndarray) -> np.ndarray:
    """Return the nearest symmetric matrix without negative curvature."""
    values, vectors = np.linalg.eigh((hessian + hessian.T) / 2.0)
    least = LEAST_CURVATURE * max(values.max(), 1e-9)
    return (vectors * np.maximum(values, least)) @ vectors.T


def _before(begin: States, at: States) -> States:
    """Return the states at the start of each leg: `begin`, then all but the last crossing."""
    position = np.vstack([begin.position, at.position[:-1]])
    velocity = np.vstack([begin.velocity, at.velocity[:-1]])
    return States(position, velocity)
