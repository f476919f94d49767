"""Domain randomization: start pose, vehicle and gusts of a flight, drawn from its seed.

All changes scale with a size: 0 changes nothing, 1 is a careful outdoor flight. The changes depend
only on seed and size, so that two planners with the same seed fly under the same disturbances. The
planner's model remains the model of the nominal vehicle.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import radians, sqrt
from typing import NamedTuple

import numpy as np

from quadsim.course import Course, Gate, Start
from quadsim.course.checks import misplaced_gates, start_problems
from quadsim.course.frames import frame_numbers
from quadsim.course.obstacles import Cylinder, Obstacle
from quadsim.dynamics.first_order import remaining
from quadsim.files.values import SettingError
from quadsim.physics.randomization_file import OUTDOOR, OUTDOOR_NAME, RandomizationRanges
from quadsim.rotation import Quaternion, Vec3, euler_angles, from_euler, product
from quadsim.streams import tilt_stream
from quadsim.vehicle import Vehicle, scale_thrust
from quadsim.vehicle.tolerances import VehicleTolerances

# Draws of a start, or of the places of gates, until they pass the checks of a course file
MOST_DRAWS = 100


@dataclass(frozen=True)
class Randomization:
    """Changes of the nominal start and vehicle; 0.03 increases a vehicle's number by 3 %."""

    # displacement of the start [m]
    offset: Vec3 = (0.0, 0.0, 0.0)
    # change of the start's yaw [rad]
    turn: float = 0.0
    mass: float = 0.0
    thrust: float = 0.0
    rate_lag: float = 0.0
    motor_lag: float = 0.0
    drag: float = 0.0
    # standard deviation of the gusts per axis [m/s^2]
    gust: float = 0.0
    # of each moment of inertia; None: they change with the mass
    inertia: Vec3 | None = None
    # half width of the force on each axis in each physics step [N]
    force: float = 0.0
    # standard deviation of the noise on each command, in the order of Control
    command_noise: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    def start(self, start: Start) -> Start:
        """Return the start, displaced and turned."""
        x, y, z = start.position
        dx, dy, dz = self.offset
        return Start((x + dx, y + dy, z + dz), start.yaw + self.turn)

    def vehicle(self, vehicle: Vehicle) -> Vehicle:
        """Return the vehicle for the actuators, with randomized lags, drag and full thrust."""
        lags = tuple(tau * (1 + self.rate_lag) for tau in vehicle.rate_tau)
        drag = tuple(d * (1 + self.drag) for d in vehicle.drag)
        rotors = vehicle.rotors
        if rotors:
            slower = 1 + self.motor_lag
            rates = tuple(rate / slower for rate in rotors.motor_response or ())
            rotors = replace(
                rotors, motor_tau=rotors.motor_tau * slower, motor_response=rates or None
            )
        varied = replace(vehicle, rate_tau=lags, rotors=rotors, drag=drag)
        return scale_thrust(varied, 1 + self.thrust)

    def body(self, vehicle: Vehicle) -> Vehicle:
        """Return the vehicle for the rigid body, with randomized mass and inertia.

        The flight controller uses the nominal mass and inertia.
        """
        changes = self.inertia or (self.mass,) * 3
        inertia = tuple(j * (1 + d) for j, d in zip(vehicle.inertia, changes, strict=True))
        return replace(vehicle, mass=vehicle.mass * (1 + self.mass), inertia=inertia)


class Widths(NamedTuple):
    """Half widths of the uniform distributions of a vehicle's numbers at size 1, relative."""

    mass: float
    thrust: float
    rate_lag: float
    motor_lag: float
    drag: float


def widths(ranges: RandomizationRanges, vehicle: Vehicle | None = None) -> Widths:
    """Return the half widths of a vehicle's numbers.

    The randomization gives the half widths. With the default randomization, a vehicle whose file
    has uncertainties is drawn from these: the half width of a uniform distribution is sqrt(3) times
    its standard deviation.

    Args:
        ranges: the randomization.
        vehicle: the nominal vehicle; None: a vehicle without uncertainties in its file.
    """
    known = vehicle.uncertainty if vehicle else None
    if known is None or ranges.name != OUTDOOR_NAME:
        return Widths(ranges.mass, ranges.thrust, ranges.lag, ranges.lag, ranges.drag)
    shares = (known.mass, known.thrust, known.rate_lag, known.motor_lag, known.drag)
    return Widths(*(sqrt(3) * share for share in shares))


def draw(
    seeds: np.random.SeedSequence,
    size: float,
    course: Course | None = None,
    start: Start | None = None,
    ranges: RandomizationRanges = OUTDOOR,
    vehicle: Vehicle | None = None,
) -> Randomization:
    """Return the changes of a flight, drawn from independent uniform distributions.

    The numbers are drawn in a fixed order, so that a seed keeps its meaning. A start in a frame, in
    an obstacle or out of bounds is drawn again, without the other numbers.

    Args:
        seeds: the stream of the vehicle.
        size: scale of all changes; 0: no changes.
        course: the course in which the vehicle starts; None: every start is valid.
        start: the nominal start; None: the course's start.
        ranges: half widths of the distributions at size 1.
        vehicle: the nominal vehicle, see `widths`; None: a vehicle without uncertainties.

    Raises:
        SettingError: none of MOST_DRAWS starts is valid (a ValueError).
    """
    if size == 0:
        return Randomization()
    rng = np.random.default_rng(seeds)
    dx, dy, dz, turn, mass, thrust, rate_lag, motor_lag, drag = (
        size * rng.uniform(-1, 1, 9)
    ).tolist()
    x, y, z = ranges.start
    offset = (x * dx, y * dy, z * dz)
    if course is not None:
        offset = _with_room(offset, ranges.start, size, rng, course, start or course.start)
    inertia = None
    if ranges.inertia is not None:
        # Drawn last, so that the numbers above are the same without it.
        jx, jy, jz = (size * rng.uniform(-1, 1, 3) * ranges.inertia).tolist()
        inertia = (jx, jy, jz)
    wx, wy, wz, a = (size * std for std in ranges.command_noise)
    width = widths(ranges, vehicle)
    return Randomization(
        offset=offset,
        turn=radians(ranges.start_turn_deg) * turn,
        mass=width.mass * mass,
        thrust=width.thrust * thrust,
        rate_lag=width.rate_lag * rate_lag,
        motor_lag=width.motor_lag * motor_lag,
        drag=width.drag * drag,
        gust=ranges.gust * size,
        inertia=inertia,
        force=ranges.force * size,
        command_noise=(wx, wy, wz, a),
    )


def _with_room(
    offset: Vec3,
    widths: Vec3,
    size: float,
    rng: np.random.Generator,
    course: Course,
    start: Start,
) -> Vec3:
    """Return a displacement [m] to a valid start: the given one, or else one that is drawn again.

    Args:
        offset: the displacement that was drawn [m].
        widths: half widths of the distributions along x, y, z at size 1 [m].
        size: scale of the half widths.
        rng: generator of further displacements.
        course: the course in which the vehicle starts.
        start: the nominal start.
    """
    problem = ""
    for _ in range(MOST_DRAWS):
        moved = Randomization(offset).start(start)
        problem = next(start_problems(course, moved.position), "")
        if not problem:
            return offset
        x, y, z = (np.array(widths) * size * rng.uniform(-1, 1, 3)).tolist()
        offset = (x, y, z)
    wanted = f"expected room for the vehicle in one of {MOST_DRAWS} starts that are drawn"
    raise SettingError("randomize", f"{wanted}, got none: the last: {problem}")


def gusts(seeds: np.random.SeedSequence, std: float, dt: float) -> Iterator[Vec3]:
    """Yield the acceleration by the wind [m/s^2] in each physics step, world frame.

    The gust is an Ornstein-Uhlenbeck process, exact for any dt and stationary from the first step:

        w <- exp(-dt / tau) w + std sqrt(1 - exp(-2 dt / tau)) N(0, 1)

    Args:
        seeds: the stream of the gusts.
        std: standard deviation per axis [m/s^2].
        dt: physics step [s].
    """
    keep = remaining(VehicleTolerances.gust_tau, dt)
    fresh = std * sqrt(1 - keep * keep)
    rng = np.random.default_rng(seeds)
    x, y, z = (std * rng.standard_normal(3)).tolist()
    while True:
        yield x, y, z
        a, b, c = rng.standard_normal(3).tolist()
        x = keep * x + fresh * a
        y = keep * y + fresh * b
        z = keep * z + fresh * c


def forces(seeds: np.random.SeedSequence, width: float, mass: float) -> Iterator[Vec3]:
    """Yield the acceleration by a random force [m/s^2] in each physics step, world frame.

    Args:
        seeds: the stream of the forces.
        width: half width of the uniform distribution of the force on each axis [N].
        mass: mass of the body [kg].
    """
    rng = np.random.default_rng(seeds)
    while True:
        x, y, z = (width / mass * rng.uniform(-1, 1, 3)).tolist()
        yield x, y, z


class Displacement(NamedTuple):
    """Half widths of the displacements of gates and obstacles from the map."""

    gates: float  # along x and y [m]
    height: float = 0.0  # of gates, along z [m]
    turn: Vec3 = (0.0, 0.0, 0.0)  # roll, pitch and yaw of gates [rad]
    obstacles: float = 0.0  # along x and y [m]
    obstacles_height: float = 0.0  # [m]

    @property
    def is_any(self) -> bool:
        """Whether any half width is above zero."""
        return any((self.gates, self.height, *self.turn, self.obstacles, self.obstacles_height))

    @classmethod
    def of(cls, ranges: RandomizationRanges, size: float, gates: float = 0.0) -> Displacement:
        """Return the half widths of a randomization's displacements.

        Args:
            ranges: the randomization.
            size: scale of the half widths.
            gates: the least half width of a gate's displacement along x and y [m].
        """
        roll, pitch, yaw = (size * turn for turn in ranges.gates_turn)
        return cls(
            gates=max(gates, size * ranges.gates),
            height=size * ranges.gates_height,
            turn=(roll, pitch, yaw),
            obstacles=size * ranges.obstacles,
            obstacles_height=size * ranges.obstacles_height,
        )


class Move(NamedTuple):
    """The displacement of one frame."""

    x: float  # [m]
    y: float
    z: float
    roll: float  # [rad]
    pitch: float
    yaw: float


def displaced(course: Course, seeds: np.random.SeedSequence, by: Displacement) -> Course:
    """Return the course with every gate and obstacle displaced by uniform random numbers.

    A frame that is flown through several times is moved once. A gate that would stand out of
    bounds, in the start or behind obstacles is drawn again, along x and y only.

    Args:
        course: the map.
        seeds: the stream of the gates.
        by: half widths of the distributions. If heights and turns are not drawn, a gate above
            another stays clear of it.

    Raises:
        SettingError: none of MOST_DRAWS draws gives a gate a valid place (a ValueError).
    """
    rng = np.random.default_rng(seeds)
    numbers = frame_numbers(course.gates)
    count = max(numbers) + 1
    moves = by.gates * rng.uniform(-1, 1, (count, 2))  # of each frame along x and y
    # A stream of their own, so that the places along x and y are the same without them.
    others = np.random.default_rng(tilt_stream(seeds))
    rises = by.height * others.uniform(-1, 1, (count, 1))
    turns = np.array(by.turn) * others.uniform(-1, 1, (count, 3))
    shifts = others.uniform(-1, 1, (len(course.obstacles), 3))
    shifts *= (by.obstacles, by.obstacles, by.obstacles_height)
    pairs = zip(course.obstacles, shifts.tolist(), strict=True)
    obstacles = tuple(_shifted(obstacle, *shift) for obstacle, shift in pairs)
    problems: dict[int, str] = {}
    for _ in range(MOST_DRAWS):
        of_frames = [Move(*row) for row in np.hstack([moves, rises, turns]).tolist()]
        gates = _moved_gates(course.gates, numbers, of_frames)
        moved = replace(course, gates=gates, obstacles=obstacles)
        problems = misplaced_gates(moved)
        if not problems:
            return moved
        for k in dict.fromkeys(numbers[i] for i in problems):
            moves[k] = by.gates * rng.uniform(-1, 1, 2)
    (i, problem), *_ = problems.items()
    wanted = f"expected a place for gate {i + 1} in one of {MOST_DRAWS} draws"
    raise SettingError("displace_gates", f"{wanted}, got none: the last: {problem}")


def stretched(course: Course, factor: float) -> Course:
    """Return the course with horizontal distances from the start multiplied by `factor`.

    Gates and obstacles keep their sizes, attitudes and heights. The bounds are stretched too.
    """
    sx, sy, _ = course.start.position

    def moved(place: Vec3) -> Vec3:
        x, y, z = place
        return (sx + factor * (x - sx), sy + factor * (y - sy), z)

    gates = tuple(replace(gate, position=moved(gate.position)) for gate in course.gates)
    obstacles = tuple(
        replace(one, base=moved(one.base))
        if isinstance(one, Cylinder)
        else replace(one, centre=moved(one.centre))
        for one in course.obstacles
    )
    (west, east), (south, north), height = course.bounds
    low_x, low_y, _ = moved((west, south, 0.0))
    high_x, high_y, _ = moved((east, north, 0.0))
    bounds = ((low_x, high_x), (low_y, high_y), height)
    return replace(course, gates=gates, obstacles=obstacles, bounds=bounds)


def _moved_gates(
    gates: Sequence[Gate], numbers: Sequence[int], moves: Sequence[Move]
) -> tuple[Gate, ...]:
    """Return the gates, each displaced with its frame.

    Args:
        gates: gates of the map.
        numbers: the frame of each gate.
        moves: displacement of each frame.
    """
    first = {number: gate for gate, number in reversed(list(zip(gates, numbers, strict=True)))}
    moved = []
    for gate, number in zip(gates, numbers, strict=True):
        move = moves[number]
        x, y, z = gate.position
        raised = z + move.z if move.z else z
        there = replace(gate, position=(x + move.x, y + move.y, raised))
        if move.roll or move.pitch or move.yaw:
            there = _turned(there, _turn_of(first[number], move))
        moved.append(there)
    return tuple(moved)


def _turn_of(frame: Gate, move: Move) -> Quaternion:
    """Return the rotation in the world that changes a frame's roll, pitch and yaw."""
    before = from_euler(frame.yaw, frame.pitch, frame.roll)
    after = from_euler(frame.yaw + move.yaw, frame.pitch + move.pitch, frame.roll + move.roll)
    w, x, y, z = before
    return product(after, (w, -x, -y, -z))


def _turned(gate: Gate, turn: Quaternion) -> Gate:
    """Return a gate that is turned about its centre by a rotation in the world frame."""
    yaw, pitch, roll = euler_angles(product(turn, from_euler(gate.yaw, gate.pitch, gate.roll)))
    return replace(gate, yaw=yaw, pitch=pitch, roll=roll)


def _shifted(obstacle: Obstacle, dx: float, dy: float, dz: float) -> Obstacle:
    """Return an obstacle that is displaced by dx, dy and dz [m]."""
    if isinstance(obstacle, Cylinder):
        x, y, z = obstacle.base
        return replace(obstacle, base=(x + dx, y + dy, z + dz))
    x, y, z = obstacle.centre
    return replace(obstacle, centre=(x + dx, y + dy, z + dz))
