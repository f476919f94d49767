"""The functions of the public interface, which `import quadsim` loads on first use."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from quadsim.config.build import flight_frames, with_threads
from quadsim.config.spec import Spec
from quadsim.files.values import SettingError
from quadsim.racing.events import Frame
from quadsim.record.archive import find_run, read_run
from quadsim.results.run import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from quadsim.campaign.flights.compare import Comparison
    from quadsim.campaign.flights.sweep import Sweep
    from quadsim.campaign.heats.compare import HeatComparison
    from quadsim.config.keywords import CourseLike, Keywords
    from quadsim.heat.line_up import Entrants
    from quadsim.identify import VehicleFit
    from quadsim.logs.flight_log import FlightLog
    from quadsim.results.heat import Heat
    from quadsim.results.stored_runs import StoredRuns
    from quadsim.vehicle import Vehicle


def fly(
    course: CourseLike | Spec | Mapping[str, Any] | None = None, **settings: Unpack[Keywords]
) -> Run:
    """Simulate one flight and return it as a Run, with laps, events and telemetry.

    Args:
        course: name of a course ("split_s_swift"), path of a YAML file or Course; or a complete
            Spec, which `settings` change as `Spec.but` does; or `run.spec` of a run, which repeats
            the run. Your own objects that took part in the run must be given again.
        settings: every flight, planner, cost and model option of `race fly`, with `_` for `-`;
            `print(quadsim.settings())` lists them with units, ranges and defaults. For example
            sampler="gaussian", seed=3, horizon=120, sigma=(1, 1, 1, 4) [rad/s, rad/s, rad/s,
            m/s^2], vehicle="swift", laps=1, model_drag=0.0. sampler, terms, cost, plant, controller
            and referee may be your own objects, see docs/library.md.

    Returns:
        The Run. The same arguments on the same machine give the same run to the last bit, for any
        number of threads.

    Raises:
        SettingError: a setting is invalid; the message has its name, the expected and the found
            value (a ValueError).
        FileError: a course, vehicle or preset cannot be read, or a file or an object that took part
            in a stored run is missing or differs (a ValueError).

    Examples:
        >>> import quadsim
        >>> run = quadsim.fly("figure8", sampler="gaussian", laps=1, samples=256)
        >>> run.outcome, len(run.laps)
        ('finished', 1)
        >>> again = quadsim.fly(run.spec)
        >>> again.digest() == run.digest()
        True
    """
    spec = spec_of(course, settings)
    return Run.from_frames(spec.record(), flight_frames(spec))


def frames(
    course: CourseLike | Spec | Mapping[str, Any] | None = None, **settings: Unpack[Keywords]
) -> Iterator[Frame]:
    """Simulate step by step and yield a Frame for each control period; the last has the outcome.

    Arguments and errors are those of `fly`. The simulation advances only when the next frame is
    requested; closing the iterator ends the flight.

    Examples:
        >>> import quadsim
        >>> for frame in quadsim.frames("figure8", laps=1, samples=256):
        ...     if frame.passed == 3:
        ...         break
        >>> frame.gate
        4
    """
    return flight_frames(spec_of(course, settings))


def race(
    entrants: Entrants | Mapping[str, Any],
    course: CourseLike | None = None,
    rotation: int = 0,
    parts: Mapping[str, Mapping[str, Any]] | None = None,
    **settings: Any,
) -> Heat:
    """Race several vehicles in one world and return the Heat, with runs, order and events.

    Each entrant flies with its own planner or pilot and perceives the others. A race with a single
    entrant is the flight of `fly`.

    Args:
        entrants: one to eight entrants. An entrant is a text as for `race heat --entrants`
            ("colored", "fast=race+target-ess=100", "pilot=split_s_swift"), a dictionary of settings
            of `fly`, a Spec, or a `quadsim.Entrant`. A dictionary {name: settings} names the
            entrants. `heat.spec` of a Heat repeats that race, with another `seed` if one is given.
        course: name of a course, path of a YAML file or Course; split_s_swift by default.
        rotation: number of places by which each entrant moves on around the start grid.
        parts: {entrant: {role: object}} with your own objects that took part in `heat.spec`, such
            as {"mine": {"controller": Mine()}}.
        settings: settings of the race (rules, expect, downwash, spacing, ...; `race heat --help`
            lists them), and settings of `fly` for all entrants.

    Returns:
        The Heat. The same arguments on the same machine give the same race to the last bit, for any
        number of threads.

    Raises:
        SettingError: a setting is invalid, or the entrants do not fit together (a ValueError).
        FileError: a file cannot be read (a ValueError).

    Examples:
        >>> import quadsim
        >>> line_up = {"first": {}, "careful": {"margin": 0.4}}
        >>> heat = quadsim.race(line_up, "figure8", laps=1, samples=256, expect="velocity")
        >>> sorted(heat.names)
        ['careful', 'first']
        >>> heat.order[0].rank
        1
    """
    from quadsim.config.build import use_threads_of
    from quadsim.heat.archive import is_record_of_heat, recorded_heat
    from quadsim.heat.line_up import line_up
    from quadsim.heat.spec import HeatSpec
    from quadsim.results.heat import fly_heat

    use_threads_of(settings.pop("threads", None))
    if is_record_of_heat(entrants):
        # The record has the course and the places on the grid.
        if course is not None:
            settings["course"] = course
        if rotation:
            settings["rotation"] = rotation
        return fly_heat(recorded_heat(entrants, parts, settings))
    if parts is not None:
        raise SettingError("parts", "expected parts only beside heat.spec of a recorded race")
    made, of_heat = line_up(course, entrants, settings)
    seed = made[0].spec.seed if made else 0
    return fly_heat(HeatSpec(made, of_heat, seed, rotation))


def load_heat(heat: str | Path = "last", runs_dir: str = "runs") -> Heat:
    """Read a stored race of several vehicles.

    Args:
        heat: path of the race's folder, a unique part of its name, or "last".
        runs_dir: the folder of runs.

    Raises:
        RunError: there is no such race, or it cannot be read.

    Examples:
        >>> import quadsim
        >>> heat = quadsim.race(["colored", "gaussian"], "figure8", laps=1, samples=256)
        >>> folder = heat.save("flights")
        >>> quadsim.load_heat(folder).digest() == heat.digest()
        True
    """
    from quadsim.heat.archive import find_heat
    from quadsim.results.heat import Heat

    return Heat.load(find_heat(str(heat), runs_dir))


def spec_of(course: CourseLike | Spec | Mapping[str, Any] | None, settings: Keywords) -> Spec:
    """Return the Spec that `fly` flies, and use its number of threads."""
    if isinstance(course, Mapping):
        spec = Spec.of_record(course, **settings)
    elif isinstance(course, Spec):
        spec = course.but(**settings) if settings else course
    else:
        spec = Spec.of(course, **settings)
    return with_threads(spec) if spec.threads else spec


def load_run(run: str | Path = "last", runs_dir: str = "runs") -> Run:
    """Read a stored run.

    Args:
        run: path of the run's folder, a unique part of its name, or "last".
        runs_dir: the folder of runs.

    Raises:
        RunError: there is no such run, or it cannot be read.

    Examples:
        >>> import quadsim
        >>> folder = quadsim.save_run(quadsim.fly("figure8", laps=1, samples=256))
        >>> quadsim.load_run("last").outcome
        'finished'
    """
    return Run.of(read_run(find_run(str(run), runs_dir)))


def save_run(run: Run, runs_dir: str | Path = "runs") -> Path:
    """Store a run as `race fly` does, and return its folder.

    The folder has run.json, telemetry.npz and events.csv.

    Args:
        run: the flight.
        runs_dir: folder of runs, in which the run gets its own folder.

    Returns:
        The run's folder.

    Raises:
        RunError: the run cannot be written.

    Examples:
        >>> import quadsim
        >>> run = quadsim.fly("figure8", laps=1, samples=256)
        >>> folder = quadsim.save_run(run, "flights")
        >>> quadsim.load_run(folder).digest() == run.digest()
        True
    """
    return run.save(runs_dir)


def runs(  # noqa: PLR0913 (a keyword for each pattern)
    runs_dir: str | Path = "runs",
    *,
    course: str | None = None,
    vehicle: str | None = None,
    sampler: str | None = None,
    preset: str | None = None,
    pilot: str | None = None,
    controller: str | None = None,
    seed: int | None = None,
    outcome: str | None = None,
) -> StoredRuns:
    """Return the stored runs and races of a folder, oldest first; only their records are read.

    Texts are patterns as in a shell: course="split_s*". A race of several vehicles is listed if any
    of its entrants fits. Unreadable runs are not listed; their problems are in `.damaged`.

    Args:
        runs_dir: the folder of runs.
        course: name of the course.
        vehicle: name of the vehicle.
        sampler: name of the sampler, or the class of your own controller.
        preset: name of the preset; flights of learned pilots have none.
        pilot: name of a learned pilot; "*" for all flights of learned pilots.
        controller: class of your own controller; "*" for all flights of such controllers.
        seed: the seed.
        outcome: finished, crashed, stuck, timeout or interrupted.

    Returns:
        A sequence of rows, which `print` shows as a table and `.to_pandas()` converts; `.load()` of
            a row reads the whole Run, or the Heat of a race. `.flights` has only runs, `.races`
            only races.

    Examples:
        >>> import quadsim
        >>> for seed in (0, 1):
        ...     folder = quadsim.fly("figure8", laps=1, samples=256, seed=seed).save()
        >>> stored = quadsim.runs(course="figure8", outcome="finished")
        >>> [row.seed for row in stored]
        [0, 1]
        >>> run = stored[-1].load()
    """
    from quadsim.results.stored_runs import stored_runs

    return stored_runs(
        runs_dir,
        course=course,
        vehicle=vehicle,
        sampler=sampler,
        preset=preset,
        pilot=pilot,
        controller=controller,
        seed=seed,
        outcome=outcome,
    )


def read_logs(path: str | Path, mapping: str | Path | None = None) -> list[FlightLog]:
    """Return the flights of a log; only a blackbox file has more than one.

    Args:
        path: the folder of a stored run, or a file: CSV, Betaflight's blackbox, PX4's .ulg, the log
            of the Crazyflie's SD card, or a run as MCAP.
        mapping: meaning of the columns of a CSV file, by the name or path of a mapping; None: the
            project's mapping that fits.

    Returns:
        FlightLogs, whose signals have common units and frames.

    Raises:
        FileError: the log or the mapping cannot be used (a ValueError).

    Examples:
        >>> import quadsim
        >>> folder = quadsim.fly(excite=True, plant="rigid", timeout=1.0).save()
        >>> (log,) = quadsim.read_logs(folder)
        >>> log.has("body_rates", "rate_setpoints"), log.has("motor_commands")
        (True, False)
    """
    from quadsim.logs.read import read_logs as read

    return read(path, mapping)


def fit(
    logs: str | Path | FlightLog | Sequence[str | Path | FlightLog],
    *,
    test: str | Path | FlightLog | Sequence[str | Path | FlightLog] = (),
    name: str = "fitted",
    mass: float | None = None,
    arm: float | None = None,
    like: str | Path | Vehicle | None = None,
    mapping: str | Path | None = None,
) -> VehicleFit:
    """Fit a vehicle to flight logs, with a 95 % interval for each number.

    Args:
        logs: one or several logs, as arguments or results of `read_logs`.
        test: logs on which predictions of the fitted vehicle are evaluated; without any, the
            fitted logs are used.
        name: name of the vehicle.
        mass: weighed mass of the vehicle with its battery [kg], because a log determines only
            ratios to it; None: the mass of `like`.
        arm: distance from the centre to a rotor [m], because a log determines only the ratio of the
            inertia to it; None: the arm of `like`, and wide intervals of the inertia.
        like: similar vehicle, by name, path or as a Vehicle. The search starts from its numbers,
            and numbers that the logs do not determine are taken from it; None: the project's
            vehicle with the nearest mass.
        mapping: meaning of the columns of CSV logs, see `read_logs`.

    Returns:
        A VehicleFit: `.vehicle`, which `fly` flies, `.numbers` with intervals and sources,
            `.remarks` on numbers that the logs do not determine, `.to_yaml(path)`.

    Raises:
        FileError: a log cannot be used (a ValueError).
        SettingError: neither mass nor like is given, the logs have nothing to fit, or what fits
            them is no vehicle that can fly (a ValueError).

    Examples:
        >>> import quadsim
        >>> brief = {"plant": "rigid", "timeout": 20.0}
        >>> flight = quadsim.fly(excite=True, vehicle="kingfisher", **brief).save()
        >>> found = quadsim.fit(flight, mass=0.75, like="swift", name="mine")
        >>> drag = found["drag.x"]
        >>> drag.low < 0.4 < drag.high
        True
        >>> run = quadsim.fly("figure8", vehicle=found.vehicle, laps=1, samples=256)
    """
    from quadsim.identify import fit_vehicle
    from quadsim.vehicle import Vehicle, load_vehicle

    base = like if like is None or isinstance(like, Vehicle) else load_vehicle(like)
    flights = _flights(logs, mapping)
    tested = _flights(test, mapping)
    return fit_vehicle(flights, test=tested, name=name, base=base, mass=mass, arm=arm)


def _flights(
    logs: str | Path | FlightLog | Sequence[str | Path | FlightLog], mapping: str | Path | None
) -> list[FlightLog]:
    """Return the flights of all logs; logs that are given as files are read."""
    given = [logs] if isinstance(logs, str | Path) or not isinstance(logs, Sequence) else logs
    found: list[FlightLog] = []
    for one in given:
        found += read_logs(one, mapping) if isinstance(one, str | Path) else [one]
    return found


def plot(run: Run, path: str | Path | None = None) -> Figure:
    """Draw a run in one figure: path, controls over time, spectrum of the thrust.

    Args:
        run: run of a quadrotor.
        path: file to write, with the suffix .png, .svg or .pdf; None writes nothing.

    Returns:
        The matplotlib Figure.

    Examples:
        >>> import quadsim
        >>> run = quadsim.fly("figure8", laps=1, samples=256)
        >>> figure = quadsim.plot(run, "flight.png")
    """
    return run.plot(path)


def compare(
    courses: CourseLike | Sequence[CourseLike],
    variants: Mapping[str, Keywords | str] | Sequence[str] | str = ("gaussian", "colored"),
    attempts: int = 10,
    jobs: int | None = None,
    campaign: str | Path | None = None,
    baseline: str | None = None,
    **settings: Unpack[Keywords],
) -> Comparison:
    """Compare variants over many flights, paired by seed.

    The comparison has lap times, finish rates and thrust chatter with 95 % intervals.

    Args:
        courses: one course or several.
        variants: {name: settings}, with the settings as a mapping or as a text such as
            "race_informed+samples=512"; or texts, such as ("gaussian", "colored"). Attempt i of
            each variant has the seed `seed` + i.
        attempts: flights of each variant on each course.
        jobs: worker processes; None: all flights in this process, one after the other. With workers
            a script needs `if __name__ == "__main__":`, and the workers must be able to import your
            own objects.
        campaign: SQLite file that stores finished attempts; the same call resumes from it.
        baseline: name of the variant with which every other variant is compared, with p-values
            that are corrected for the number of variants; None: all pairs of variants are compared.
        settings: settings of all variants, as for `fly`; randomize=1.0 randomizes vehicle, start
            and wind by seed.

    Returns:
        A Comparison: `.variants` and `.pairs` with the numbers, `print(comparison)` for tables,
            `.attempts` for each flight, `.plot(path)`.

    Raises:
        ValueError: as for `fly`.

    Examples:
        >>> import quadsim
        >>> variants = {"gaussian": {"sampler": "gaussian"}, "colored": {}}
        >>> comparison = quadsim.compare("figure8", variants, attempts=2, laps=1, samples=256)
        >>> [variant.finished for variant in comparison.variants]
        [2, 2]
    """
    from quadsim.campaign.flights.compare import compare as run_comparison

    return run_comparison(courses, variants, attempts, jobs, campaign, baseline, settings)


def sweep(
    courses: CourseLike | Sequence[CourseLike],
    over: Mapping[str, Sequence[Any]],
    variants: Mapping[str, Keywords | str] | Sequence[str] | str = ("gaussian", "colored"),
    attempts: int = 10,
    jobs: int | None = None,
    campaign: str | Path | None = None,
    **settings: Unpack[Keywords],
) -> Sweep:
    """Fly several values of settings, one setting at a time, paired by seed.

    The sweep has the finished flights at each value, and the differences of lap times to the
    flights with the same seeds at the first value, with 95 % intervals.

    Args:
        courses: one course or several.
        over: two or more values of each setting by its name; the first value is the reference. A
            name may also be a number of the vehicle or of a sensor, such as "vehicle.mass" or
            "sensing.camera.noise". Several names joined by "+" have the same value. None stands
            for the setting's default.
        variants: variants that fly at each value, as for `compare`.
        attempts: flights of each variant at each value; attempt i has the seed `seed` + i.
        jobs: worker processes, see `compare`.
        campaign: SQLite file that stores finished attempts; the same call resumes from it, and
            other sweeps and comparisons share its flights.
        settings: settings of all variants, as for `fly`; randomize=1.0 randomizes vehicle, start
            and wind by seed.

    Returns:
        A Sweep: `.points` with the numbers, `print(sweep)` for tables, `.attempts` for each
            flight, `.plot(path)`.

    Raises:
        ValueError: as for `fly`.

    Examples:
        >>> import quadsim
        >>> small = {"attempts": 1, "laps": 1, "samples": 256}
        >>> swept = quadsim.sweep("figure8", {"link_latency": [0, 0.04]}, "colored", **small)
        >>> [point.value for point in swept.points]
        ['0', '0.04']
    """
    from quadsim.campaign.flights.sweep import sweep as run_sweep

    return run_sweep(courses, over, variants, attempts, jobs, campaign, settings)


def compare_heats(
    entrants: Entrants,
    course: CourseLike | None = None,
    variants: Mapping[str, Mapping[str, Any]] | str | None = None,
    starts: int = 10,
    rotate: bool = True,
    jobs: int | None = None,
    campaign: str | Path | None = None,
    **settings: Any,
) -> HeatComparison:
    """Compare settings of races of several vehicles, with the same starts for each setting.

    Args:
        entrants: the entrants, as for `race`.
        course: name of a course, path of a YAML file or Course; split_s_swift by default.
        variants: {name: settings}, or a text such as "expect=own,expect=velocity", with settings
            of the race and of all its flights; None: a single variant.
        starts: number of races of each variant; race i has the seed `seed` + i.
        rotate: whether each entrant starts one place further on the grid in each next race.
        jobs: worker processes, see `compare`.
        campaign: SQLite file that stores finished races; the same call resumes from it.
        settings: settings of all variants, as for `race`; randomize=1.0 randomizes vehicles, starts
            and wind by seed.

    Returns:
        A HeatComparison: `.settings` and `.differences` with the numbers, `print(comparison)` for
            tables, `.plot(path)`.

    Raises:
        ValueError: as for `race`.

    Examples:
        >>> import quadsim
        >>> variants = {"aware": {"expect": "velocity"}, "blind": {"expect": "nothing"}}
        >>> small = {"laps": 1, "samples": 256, "timeout": 1.0}
        >>> found = quadsim.compare_heats(
        ...     ["colored", "gaussian"], "figure8", variants, starts=2, **small
        ... )
        >>> [(change.a, change.b) for change in found.differences]
        [('aware', 'blind')]
    """
    from quadsim.campaign.heats.compare import compare_heats as run_comparison

    return run_comparison(entrants, course, variants, starts, rotate, jobs, campaign, settings)
