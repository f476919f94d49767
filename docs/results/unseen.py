"""Courses that nobody tuned the planner for: drawn from a seed, written as files, and flown.

    python -m docs.results.unseen --number 12 --seed 2027 --out unseen
    python -m docs.results.unseen --number 12 --seed 2027 --out unseen --fly
    python -m docs.results.unseen --number 12 --seed 2027 --out unseen --limits

A course is a row of the elements that racers build: turns, hairpins, the Split-S, ladders and
vertical gates. Thrust-to-weight ratio and size of the openings differ from course to course. The
first command writes the files, the second flies each race by every variant and writes a row for
each flight into flights.csv, and the runs into runs/. The third one searches the least time of each
race that a variant has finished, from its fastest flight on, and writes it into limits.csv, or 0 if
it finds none; it needs the extra limit. What has a row is not flown or searched again.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np

import quadsim
from quadsim import Run
from quadsim.course import Course, parse_course
from quadsim.files.extras import needs_extra
from quadsim.files.strict_yaml import FileError
from quadsim.limit.limits import LimitProblem
from quadsim.value import value_of_course

VEHICLE = "swift"
THRUST_TO_WEIGHT = (3.0, 8.0)
GATES = (3, 12)
OPENING = (0.6, 2.4)  # [m]
FRAME = 0.15  # width of the bars [m]
GAP = (0.1, 0.8)  # between the frames of two gates that stand one above the other [m]
HIGHEST = 7.0  # of the centre of a gate [m]
ABOVE_GROUND = 0.4  # least height of the lower edge of an opening [m]
CLEAR = 0.3  # least distance from a straight leg to the frame of another gate [m]
POINTS = 25  # of a leg at which that is checked
INTERVALS = 20  # of a limit's solution on the way to a gate, on average

VARIANTS = ("colored", "gaussian")  # the samplers that fly, with the preset


class Pose(NamedTuple):
    """A gate: the middle of its opening [m], and the direction of its passage [deg]."""

    x: float
    y: float
    z: float
    yaw: float
    pitch: float = 0.0  # positive down


@dataclass(frozen=True)
class UnseenRace:
    """A course, and the vehicle that flies it."""

    course: Course
    thrust_to_weight: float
    text: str  # the course as YAML


def unseen_races(number: int, seed: int) -> Iterator[UnseenRace]:
    """Yield races drawn from a seed; a larger number begins with the same ones."""
    for k in range(1, number + 1):
        yield _race(f"unseen_{seed}_{k}", np.random.default_rng([seed, k]))


def _race(name: str, rng: np.random.Generator) -> UnseenRace:
    """Return the first valid race among those drawn."""
    thrust_to_weight = round(float(rng.uniform(*THRUST_TO_WEIGHT)), 2)
    opening = round(float(rng.uniform(*OPENING)), 2)
    number = int(rng.integers(GATES[0], GATES[1] + 1))
    while True:
        text = _text(_gates(rng, number, opening), opening)
        try:
            course = parse_course(text, f"{name}.yaml")
        except FileError:
            continue
        if _legs_are_free(course):
            return UnseenRace(course, thrust_to_weight, text)


def _gates(rng: np.random.Generator, number: int, opening: float) -> list[Pose]:
    """Draw elements until there are enough gates."""
    low = opening / 2.0 + ABOVE_GROUND
    gates = [Pose(0.0, 0.0, round(float(rng.uniform(low, low + 2.0)), 2), 0.0)]
    while len(gates) < number:
        element = ELEMENTS[rng.integers(len(ELEMENTS))]
        gates += [_within(gate, low) for gate in element(rng, gates[-1], opening)]
    return gates[:number]


def _ahead(rng: np.random.Generator, last: Pose, turn: float, distance: float) -> Pose:
    """Return a gate behind a turn [deg], a distance [m] away, somewhat higher or lower."""
    along = np.radians(last.yaw + turn / 2.0)
    return Pose(
        x=last.x + distance * np.cos(along),
        y=last.y + distance * np.sin(along),
        z=last.z + rng.uniform(-1.5, 1.5),
        yaw=last.yaw + turn,
    )


def turn(rng: np.random.Generator, last: Pose, opening: float) -> list[Pose]:
    """Draw a gate ahead, to the left or to the right."""
    return [_ahead(rng, last, rng.uniform(-80.0, 80.0), rng.uniform(5.0, 16.0))]


def hairpin(rng: np.random.Generator, last: Pose, opening: float) -> list[Pose]:
    """Draw a gate beside the last one that faces back."""
    side = rng.choice((-1.0, 1.0))
    return [_ahead(rng, last, side * rng.uniform(150.0, 175.0), rng.uniform(4.0, 8.0))]


def split_s(rng: np.random.Generator, last: Pose, opening: float) -> list[Pose]:
    """Draw a gate, and one below it that is flown in the opposite direction."""
    upper = _ahead(rng, last, rng.uniform(-60.0, 60.0), rng.uniform(7.0, 14.0))
    apart = opening + 2.0 * FRAME + rng.uniform(*GAP)
    base = opening / 2.0 + ABOVE_GROUND
    upper = upper._replace(z=base + apart + rng.uniform(0.0, 1.0))
    return [upper, upper._replace(z=upper.z - apart, yaw=upper.yaw + 180.0)]


def ladder(rng: np.random.Generator, last: Pose, opening: float) -> list[Pose]:
    """Draw a gate, and one above it that is flown in the same direction."""
    lower = _ahead(rng, last, rng.uniform(-60.0, 60.0), rng.uniform(6.0, 12.0))
    lower = lower._replace(z=opening / 2.0 + ABOVE_GROUND + rng.uniform(0.0, 0.6))
    apart = opening + 2.0 * FRAME + rng.uniform(*GAP)
    return [lower, lower._replace(z=lower.z + apart)]


def dive(rng: np.random.Generator, last: Pose, opening: float) -> list[Pose]:
    """Draw a gate that is flown straight down, and one behind it near the ground."""
    top = _ahead(rng, last, rng.uniform(-40.0, 40.0), rng.uniform(6.0, 10.0))
    top = top._replace(z=rng.uniform(4.0, 6.0), pitch=90.0)
    low = _ahead(rng, top, rng.uniform(-40.0, 40.0), rng.uniform(5.0, 9.0))
    return [top, low._replace(z=opening / 2.0 + ABOVE_GROUND + rng.uniform(0.0, 0.8), pitch=0.0)]


# A turn is twice as likely as the others.
ELEMENTS: tuple[Callable[..., list[Pose]], ...] = (turn, turn, hairpin, split_s, ladder, dive)


def _within(gate: Pose, low: float) -> Pose:
    """Return a gate at an allowed height, with rounded numbers."""
    z = min(max(gate.z, low), HIGHEST)
    yaw = (gate.yaw + 180.0) % 360.0 - 180.0
    return Pose(*(round(float(number), 2) for number in (gate.x, gate.y, z, yaw, gate.pitch)))


def _text(gates: Sequence[Pose], opening: float) -> str:
    """Return a course as YAML; it need not be valid."""
    x = [gate.x for gate in gates]
    y = [gate.y for gate in gates]
    bounds = f"[[{min(x) - 12:.0f}, {max(x) + 12:.0f}], [{min(y) - 12:.0f}, {max(y) + 12:.0f}]"
    lines = [
        "source: drawn by docs/results/unseen.py",
        "loop: false\nlaps: 1",
        f"opening: [{opening:g}, {opening:g}]",
        f"frame_width: {FRAME:g}",
        f"bounds: {bounds}, [0, {HIGHEST + 4:g}]]",
        "start: {position: [-6, 0, 0.5], yaw_deg: 0}",
        "gates:",
    ]
    for gate in gates:
        place = f"position: [{gate.x:g}, {gate.y:g}, {gate.z:g}], yaw_deg: {gate.yaw:g}"
        pitch = f", pitch_deg: {gate.pitch:g}" if gate.pitch else ""
        lines.append(f"  - {{{place}{pitch}}}")
    return "\n".join(lines) + "\n"


def _legs_are_free(course: Course) -> bool:
    """Return whether straight legs keep clear of the frames of other gates."""
    places = [course.start.position, *(gate.position for gate in course.gates)]
    for k in range(len(course.gates)):
        leg = np.linspace(places[k], places[k + 1], POINTS).tolist()
        # Gate k - 1 is where the leg begins, gate k where it ends.
        others = [gate for n, gate in enumerate(course.gates) if n not in (k - 1, k)]
        if any(gate.frame_distance((x, y, z)) < CLEAR for gate in others for x, y, z in leg):
            return False
    return True


class UnseenFlight(NamedTuple):
    """A row of flights.csv."""

    course: str
    gates: int
    opening: float  # [m]
    thrust_to_weight: float
    point_mass: float  # its time to the finish [s]
    variant: str
    outcome: str
    time: float  # of the race, 0 for a flight that has not finished [s]
    thrust_tv: float  # total variation of the commanded thrust [m/s^2/s]
    run: str  # folder of the run


def fly(race: UnseenRace, variant: str, runs: Path) -> UnseenFlight:
    """Fly a race by a variant, seed 0, and store the run in a folder of runs."""
    course = race.course
    run = quadsim.fly(
        course,
        vehicle=VEHICLE,
        thrust_to_weight=race.thrust_to_weight,
        preset="race",
        sampler=variant,
        seed=0,
    )
    spec = quadsim.Spec.of(course, vehicle=VEHICLE, thrust_to_weight=race.thrust_to_weight)
    value = value_of_course(course, spec.vehicle, 1)
    return UnseenFlight(
        course=course.name,
        gates=len(course.gates),
        opening=course.gates[0].opening[0],
        thrust_to_weight=race.thrust_to_weight,
        point_mass=round(value.time, 3),
        variant=variant,
        outcome=str(run.outcome),
        time=round(sum(run.laps), 3) if run.outcome == "finished" else 0.0,
        thrust_tv=round(run.metrics.thrust_tv, 1),
        run=run.save(runs).name,
    )


class UnseenLimit(NamedTuple):
    """A row of limits.csv."""

    course: str
    limit: float  # best known time of the race, 0 if none is known [s]


def limit(race: UnseenRace, flown: Run) -> float | None:
    """Return the least time of a race, None if no time below that of a flight is found.

    The search begins with the flight alone, so it takes a fifth of the time of `race limit`, which
    begins with straight lines, too, and finds times that are up to 0.2 % less.

    Args:
        race: the race.
        flown: a run that has finished it.
    """
    # Imported here, as it loads the optimiser
    from quadsim.limit.guess import FlownRun
    from quadsim.limit.search import Search, best

    vehicle = quadsim.Spec.of(
        race.course, vehicle=VEHICLE, thrust_to_weight=race.thrust_to_weight
    ).vehicle
    search = Search(LimitProblem.of(race.course, vehicle, 1))
    start = FlownRun("flight", flown.telemetry, [gate["t"] for gate in flown.gates])
    for attempt in search.attempts([start], INTERVALS, _unheard):
        if not attempt.start.startswith(start.name):
            return None
        found = best([attempt])
        if found and found.time and found.time < sum(flown.laps):
            return round(found.time, 4)
    return None


def _unheard(guess: str, nodes: int) -> Callable[[int, float], None]:
    """Return a function that shows no iteration of a search."""
    return lambda iteration, seconds: None


def rows_of(table: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV file, none if there is no file."""
    if not table.exists():
        return []
    with table.open(newline="") as file:
        return list(csv.DictReader(file))


def add_row(table: Path, row: UnseenFlight | UnseenLimit) -> None:
    """Add a row to a CSV file, and print it."""
    is_new = not table.exists()
    with table.open("a", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        if is_new:
            writer.writerow(row._fields)
        writer.writerow(row)
    print(*row, flush=True)


def fastest_run(flights: Sequence[dict[str, str]], course: str) -> str | None:
    """Return the folder of the fastest finished run of a course, None if there is none."""
    finished = [row for row in flights if row["course"] == course and row["outcome"] == "finished"]
    fastest = min(finished, key=lambda row: float(row["time"]), default=None)
    return fastest["run"] if fastest else None


def main() -> int:
    """Write the courses, fly them and search their limits if asked for; return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--number", type=int, default=12, help="number of courses")
    parser.add_argument("--seed", type=int, default=2027, help="seed of the courses")
    parser.add_argument("--out", type=Path, default=Path("unseen"), help="folder of the files")
    parser.add_argument("--fly", action="store_true", help="fly each race by every variant")
    parser.add_argument("--variants", default=",".join(VARIANTS), help="those that fly")
    parser.add_argument("--limits", action="store_true", help="search the limit of each race")
    given = parser.parse_args()
    variants = given.variants.split(",") if given.fly else []
    unknown = [variant for variant in variants if variant not in VARIANTS]
    if unknown:
        parser.error(f"--variants {unknown[0]}: expected some of {', '.join(VARIANTS)}")
    if given.limits and find_spec("casadi") is None:
        parser.error(f"--limits: {needs_extra('casadi', 'limit')}")
    given.out.mkdir(parents=True, exist_ok=True)
    flights, limits = given.out / "flights.csv", given.out / "limits.csv"
    flown = {(row["course"], row["variant"]) for row in rows_of(flights)}
    known = {row["course"] for row in rows_of(limits)}
    for race in unseen_races(given.number, given.seed):
        course = race.course.name
        (given.out / f"{course}.yaml").write_text(race.text)
        for variant in variants:
            if (course, variant) not in flown:
                add_row(flights, fly(race, variant, given.out / "runs"))
        run = fastest_run(rows_of(flights), course)
        if given.limits and run and course not in known:
            found = limit(race, quadsim.load_run(given.out / "runs" / run))
            add_row(limits, UnseenLimit(course, found or 0.0))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
