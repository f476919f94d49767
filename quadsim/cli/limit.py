"""`race limit`: search the least time in which a vehicle can fly a course, by optimisation."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from importlib.util import find_spec
from typing import TYPE_CHECKING, Annotated

from msgspec import Meta, to_builtins
from rich.console import Console
from rich.markup import escape

from quadsim.cli.commands import EXIT
from quadsim.cli.flags import Help, Json, RunsDir, Stored, Switch, course_help, vehicle_help
from quadsim.config.spec import Spec
from quadsim.console import UsageError, complain, emit, emit_json, plain, uninterrupted
from quadsim.course import load_course
from quadsim.files.extras import needs_extra
from quadsim.files.strict_yaml import unit
from quadsim.limit.keeper import Keeper
from quadsim.limit.limits import LimitProblem, ModelName, StoredSolution, limits_folder
from quadsim.record.archive import RunFolder, find_run, read_run
from quadsim.record.whole_files import try_writing
from quadsim.vehicle import load_vehicle, with_thrust_to_weight

if TYPE_CHECKING:
    # Imported when a search begins, as these modules load the optimiser
    from quadsim.limit.guess import FlownRun
    from quadsim.limit.search import Progress, Search, SolveAttempt
    from quadsim.limit.solve import Show

Laps = Annotated[int, Meta(ge=1, le=20)]
Metres = Annotated[float, unit("m", ge=0, le=1)]
Share = Annotated[float, Meta(ge=0, le=0.2)]
Ratio = Annotated[float, Meta(gt=1, le=20)]


def limit(
    course: Annotated[str, course_help()] = "split_s_swift",
    /,
    *,
    vehicle: Annotated[str, vehicle_help()] = "swift",
    thrust_to_weight: Annotated[Ratio | None, Help("stronger or weaker propellers")] = None,
    laps: Annotated[
        Laps | None, Help("laps from the standing start; default: those of the course")
    ] = None,
    closed: Annotated[
        bool, Switch("one lap that ends as it begins, in place of a standing start")
    ] = False,
    model: Annotated[ModelName, Help("four rotors, or the planner's model")] = "rotors",
    margin: Annotated[
        Metres, Help("distance to frames within openings, for a path to be flown by race_informed")
    ] = 0.0,
    reserve: Annotated[
        Share, Help("share of the thrust left unused, for a path to be flown; with --model rates")
    ] = 0.0,
    nodes: Annotated[int, Meta(ge=8, le=200), Help("nodes on the way to a gate, on average")] = 20,
    start: Annotated[
        tuple[Stored, ...], Help("runs to start from, beside straight lines", consume_multiple=True)
    ] = (),
    known: Annotated[
        bool, Switch("no search: the best known solution, kept as a run to replay and to race")
    ] = False,
    runs_dir: RunsDir = "runs",
    json: Json = False,
) -> int:
    """Search the least time in which any controller could fly a vehicle through a course.

    The result is the best solution of a time-optimal control problem from several initial guesses.
    A solution counts if fine integration and the referee confirm it.

    race limit split_s_swift

    race limit mine.yaml --vehicle kingfisher --laps 2 --start last

    race limit split_s_swift --known, then race web last
    """
    problem = replace(
        _problem(course, vehicle, thrust_to_weight, 1 if closed else laps, model),
        closed=closed,
        margin=margin,
        reserve=reserve,
    )
    if closed and not problem.course.loop:
        raise UsageError(
            f"--closed: expected a course whose last gate leads to the first, "
            f"{problem.course.name} is open"
        )
    flights = [_flight(problem, name, runs_dir) for name in start]
    if known:
        return _show_known(problem, runs_dir, json)

    # Report a damaged solution or an unwritable folder before the search
    folder = limits_folder(runs_dir)
    keeper = Keeper(problem, folder, problem.best_known(folder))
    search = _search(problem)
    try_writing(folder)
    attempts: list[SolveAttempt] = []
    # The optimiser would treat Ctrl-C as a failure
    with suppress(KeyboardInterrupt), uninterrupted() as stopped:
        progress = _progress(stopped, quiet=json)
        for attempt in search.attempts(flights, nodes, progress):
            attempts.append(attempt)
            result = "; ".join(attempt.broken) or f"{attempt.time:.3f} s"
            complain(f"{attempt.start}, {attempt.nodes} nodes: {result}")
            # Store each improvement, as the search may be killed later
            keeper.keep(search.stored([attempt]))
    if json:
        emit_json(_summary(problem, keeper.best, attempts))
    else:
        emit(*_report(problem, keeper.best, keeper.found))
    keeper.finish()
    if stopped:
        return EXIT["interrupted"]
    return 0 if keeper.best else 1


def _show_known(problem: LimitProblem, runs_dir: str, json: bool) -> int:
    """Report the best known solution and store it as a run.

    Raises:
        RunError: the run cannot be stored.
    """
    best = problem.best_known(limits_folder(runs_dir))
    folder = None
    if best and not problem.closed:
        # Imported here, as it loads the referee
        from quadsim.limit.replay import replayed

        flown = Spec.of(problem.course, laps=problem.laps).record()
        run = replayed(best, problem, flown)
        with RunFolder.open(runs_dir, run.spec) as claimed:
            folder = claimed.save(run)
    if json:
        kept = {"run_dir": str(folder) if folder else None}
        emit_json(_summary(problem, best, []) | kept)
    else:
        emit(*_report(problem, best, best))
        if folder:
            emit(f"stored in {escape(str(folder))}")
    return 0 if best else 1


def _problem(
    course: str, vehicle: str, ratio: float | None, laps: int | None, model: ModelName
) -> LimitProblem:
    """Return the race that the flags describe.

    Raises:
        FileError: the course or the vehicle cannot be read.
    """
    place = load_course(course)
    flown = load_vehicle(vehicle)
    if ratio:
        flown = with_thrust_to_weight(flown, ratio)
    return LimitProblem(place, flown, laps or place.laps, model)


def _search(problem: LimitProblem) -> Search:
    """Return a search of this problem.

    Raises:
        UsageError: the optimiser is not installed, or the race cannot be flown: laps on an open
            course, a gate too small for the vehicle, a vehicle without rotors.
    """
    if find_spec("casadi") is None:
        raise UsageError(needs_extra("casadi", "limit"))
    from quadsim.limit.search import Search

    try:
        return Search(problem)
    except ValueError as error:
        raise UsageError(str(error)) from None


def _flight(problem: LimitProblem, name: str, runs_dir: str) -> FlownRun:
    """Return a stored run as an initial guess.

    Raises:
        UsageError: the run is not a finished flight of this race.
        RunError: the run cannot be read.
    """
    run = read_run(find_run(name, runs_dir))
    passes = [gate["t"] for gate in run.gates]
    race = problem.laps * len(problem.course.gates)
    same_course = run.course_name == problem.course.name
    if len(passes) != race or not same_course or problem.closed:
        raise UsageError(
            f"--start: expected a finished race of {problem.laps} laps on {problem.course.name}, "
            f"got {name}"
        )
    if find_spec("casadi") is None:
        raise UsageError(needs_extra("casadi", "limit"))
    from quadsim.limit.guess import FlownRun

    return FlownRun(f"run {name}", run.telemetry, passes)


def _progress(stopped: list[int], quiet: bool) -> Progress:
    """Return a progress line on stderr, which is overwritten if stderr is a terminal.

    It raises KeyboardInterrupt after a signal.
    """
    console = Console(stderr=True, highlight=False)

    def show(name: str, nodes: int) -> Show:
        def tell(iteration: int, time: float) -> None:
            if stopped:
                raise KeyboardInterrupt
            if console.is_terminal and not quiet:
                line = f"{escape(plain(name))}, {nodes} nodes: iteration {iteration}, {time:.3f} s"
                console.print(line, end="    \r")

        return tell

    return show


def _summary(
    problem: LimitProblem, known: StoredSolution | None, attempts: list[SolveAttempt]
) -> dict:
    """Return the result as JSON, in seconds and metres; time: null if nothing is known."""
    return {
        "course": problem.course.name,
        "vehicle": problem.vehicle.name,
        "laps": problem.laps,
        "closed": problem.closed,
        "model": problem.model,
        "margin": problem.margin,
        "margin_kept": _margin_kept(problem),
        "reserve": problem.reserve,
        "time": known.time if known else None,
        "lap_times": list(known.lap_times) if known else [],
        "nodes": len(known.solution.t) if known else None,
        "starts": [
            {"start": a.start, "nodes": a.nodes, "time": a.time, "broken": a.broken}
            for a in attempts
        ],
        "verified": to_builtins(known.verified) if known else None,
    }


def _margin_kept(problem: LimitProblem) -> float:
    """Return the margin to the frame in the narrowest opening [m]."""
    # Imported here, as the command's help does not need it
    from quadsim.limit.route import Route

    return Route.of(problem).least_margin


def _report(
    problem: LimitProblem, known: StoredSolution | None, found: StoredSolution | None
) -> Iterator[str]:
    """Yield the lines of the report; found: the solution of this search."""
    name = f"[bold]{escape(problem.course.name)}[/], {escape(problem.vehicle.name)}"
    if problem.closed:
        race = "a closed lap"
    else:
        plural = "s" if problem.laps > 1 else ""
        race = f"{problem.laps} lap{plural} from rest"
    if not known:
        yield f"{name}, {race}: no solution is known"
        return
    if problem.margin:
        kept = _margin_kept(problem)
        race += f", {kept:.3g} m from the frames"
        if kept < problem.margin:
            race += f" (of {problem.margin:g} m, at most half of the room in a gate)"
    time = f"[bold]{known.time:.3f} s[/]"
    yield f"{name}, {race}: best known limit {time}, model {problem.model}"
    if known is not found:
        yield "found before, and not slower than what was found now"
    yield f"[dim]laps[/]  {'  '.join(f'{t:.3f}' for t in known.lap_times)} s"
    checked = known.verified
    residual = f"{1e3 * checked.residual:.1g} mm"
    worth = f"{1e3 * checked.worth:.1g} ms"
    passes = checked.events.get("pass", 0)
    yield (
        f"[dim]checked[/]  {len(known.solution.t)} nodes, {residual} at most from the fine "
        f"integration, worth {worth}; referee: {checked.outcome}, {passes} gates"
    )
