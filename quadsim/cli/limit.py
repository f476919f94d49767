"""`race limit`: the least time in which a vehicle can fly a course, searched by optimisation."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from msgspec import Meta
from rich.console import Console
from rich.markup import escape

from quadsim.cli.flags import Help, Json, RunsDir, Stored, Switch
from quadsim.cli.fly import EXIT
from quadsim.console import UsageError, complain, emit, emit_json, uninterrupted
from quadsim.course import load_course
from quadsim.dynamics.quadrotor import Control, State
from quadsim.files.extras import needs_extra
from quadsim.files.strict_yaml import unit
from quadsim.race.events import Frame, flown_laps
from quadsim.race.referee import Referee
from quadsim.record.archive import RunFolder, find_run, load_run, write_whole
from quadsim.record.limits import LIMITS, Limit, Race, dump
from quadsim.record.run import Recorder, Run
from quadsim.spec.spec import Spec
from quadsim.spec.systems import system_of_course
from quadsim.vehicle import load_vehicle, with_thrust_to_weight

if TYPE_CHECKING:
    from quadsim.limit.search import Attempt, Search

Laps = Annotated[int, Meta(ge=1, le=20)]
Metres = Annotated[float, unit("m", ge=0, le=1)]
Share = Annotated[float, Meta(ge=0, le=0.2)]
Ratio = Annotated[float, Meta(gt=1, le=20)]
TIMEOUT = 1e4  # [s] of the referee: a solution has an end


def limit(
    course: Annotated[str, Help("see `race courses`, or a FILE.yaml")] = "split_s_swift",
    /,
    *,
    vehicle: Annotated[str, Help("see `race vehicles`, or a FILE.yaml")] = "swift",
    thrust_to_weight: Annotated[Ratio | None, Help("stronger or weaker propellers")] = None,
    laps: Annotated[Laps | None, Help("from the standing start; left out: the course's")] = None,
    closed: Annotated[
        bool, Switch("one lap that ends as it begins, in place of a standing start")
    ] = False,
    model: Annotated[
        Literal["rotors", "rates"], Help("four rotors, or the planner's model")
    ] = "rotors",
    margin: Annotated[
        Metres, Help("kept to frames within openings: for a path to be flown, as by race_informed")
    ] = 0.0,
    reserve: Annotated[
        Share, Help("of the thrust, left unused: for a path to be flown; with --model rates")
    ] = 0.0,
    nodes: Annotated[int, Meta(ge=8, le=200), Help("on the way to a gate, in the mean")] = 20,
    start: Annotated[
        tuple[Stored, ...], Help("runs to start from too", consume_multiple=True)
    ] = (),
    known: Annotated[
        bool, Switch("no search: what is known, kept as a run to replay and to race on the page")
    ] = False,
    runs_dir: RunsDir = "runs",
    json: Json = False,
) -> int:
    """The least time in which any controller could fly a vehicle through a course by the referee's
    rules: the best solution of a time-optimal control problem from several starts. It counts where
    fine integration confirms it.

    race limit split_s_swift

    race limit mine.yaml --vehicle kingfisher --laps 2 --start last

    race limit split_s_swift --known, then race web last
    """
    race = _race(course, vehicle, thrust_to_weight, 1 if closed else laps, closed, model)
    race = replace(race, margin=margin, reserve=reserve)
    flights, home = [_flight(race, name, runs_dir) for name in start], Path(runs_dir) / LIMITS
    if known:
        return _show_known(race, home, json)
    attempts: list[Attempt] = []
    # the optimiser would take Ctrl-C for a failure
    with suppress(KeyboardInterrupt), uninterrupted() as stopped:
        for attempt in _search(race, _progress(stopped, quiet=json)).attempts(flights, nodes):
            attempts.append(attempt)
            name = f"{attempt.start}, {attempt.nodes} nodes"
            complain(f"{name}: {'; '.join(attempt.broken) or f'{attempt.time:.3f} s'}")
    best, found = race.best_known(home), _found(race, attempts)
    if found and not (best and best.time <= found.time):
        best = found
        home.mkdir(parents=True, exist_ok=True)
        write_whole(home / race.file_name, dump(found))
    if json:
        emit_json(_summary(race, best, attempts))
    else:
        emit(*_report(race, best, found))
    return EXIT["interrupted"] if stopped else 0 if best else 1


def _show_known(race: Race, home: Path, json: bool) -> int:
    """Raises RunError."""
    best = race.best_known(home)
    folder = None
    if best and not race.closed:
        run = as_run(best, race)
        with RunFolder.open(home.parent, run.spec) as kept:
            folder = kept.save(run)
    if json:
        emit_json(_summary(race, best, []) | {"run_dir": folder and str(folder)})
    else:
        emit(*_report(race, best, best), *([f"stored in {escape(str(folder))}"] if folder else []))
    return 0 if best else 1


def _race(
    course: str,
    vehicle: str,
    ratio: float | None,
    laps: int | None,
    closed: bool,
    model: Literal["rotors", "rates"],
) -> Race:
    """Raises UsageError, FileError."""
    if (system := system_of_course(course)) != "quadrotor":
        raise UsageError(
            f"expected a course for a quadrotor, got {course!r} for the system {system}"
        )
    flown, place = load_vehicle(vehicle), load_course(course)
    if closed and not place.loop:
        raise UsageError(
            f"--closed: expected a course whose last gate leads to the first, {place.name} is open"
        )
    if ratio:
        flown = with_thrust_to_weight(flown, ratio)
    return Race(place, flown, laps or place.laps, model, closed)


def _search(race: Race, show: Callable) -> Search:
    """Raises UsageError."""
    if find_spec("casadi") is None:
        raise UsageError(needs_extra("casadi", "limit"))
    from quadsim.limit.search import Search

    def referee() -> Referee:
        # all hits, not the first
        return Referee(race.course, race.vehicle.radius, race.laps, TIMEOUT, penalties=True)

    try:
        referee()
        return Search(race, referee, show)
    # laps on an open course, a gate too small for the vehicle, a vehicle without rotors
    except ValueError as error:
        raise UsageError(str(error)) from None


def _flight(race: Race, name: str, runs_dir: str) -> tuple[str, dict, list[float]]:
    """A run to start from. Raises UsageError, RunError."""
    run = load_run(find_run(name, runs_dir))
    passes = [gate["t"] for gate in run.gates]
    if (
        len(passes) != race.laps * len(race.course.gates)
        or run.spec["course"] != race.course.name
        or race.closed
    ):
        raise UsageError(
            f"--start: expected a finished race of {race.laps} laps on {race.course.name}, got {name}"
        )
    return f"run {name}", run.telemetry, passes


def _progress(
    stopped: list[int], quiet: bool
) -> Callable[[str, int], Callable[[int, float], None]]:
    """A line on stderr that is written over, where that is a terminal. KeyboardInterrupt once a
    signal has come."""
    console = Console(stderr=True, highlight=False)

    def show(name: str, nodes: int) -> Callable[[int, float], None]:
        def tell(iteration: int, time: float) -> None:
            if stopped:
                raise KeyboardInterrupt
            if console.is_terminal and not quiet:
                console.print(
                    f"{escape(name)}, {nodes} nodes: iteration {iteration}, {time:.3f} s",
                    end="    \r",
                )

        return tell

    return show


def _found(race: Race, attempts: list[Attempt]) -> Limit | None:
    """The fastest that holds."""
    from quadsim.limit.search import best

    fastest = best(attempts)
    if not fastest or not fastest.solved:
        return None
    solution, verified = fastest.solved
    laps = flown_laps(verified.events, race.laps)
    about = race.course.name, race.vehicle.name, race.laps, race.closed, laps, verified.summary()
    return Limit(*about, solution, race.margin, race.reserve)


def _summary(race: Race, known: Limit | None, attempts: list[Attempt]) -> dict:
    """Seconds, metres. time: null where nothing is known."""
    s = known.solution if known else None
    return {
        "course": race.course.name,
        "vehicle": race.vehicle.name,
        "laps": race.laps,
        "closed": race.closed,
        "model": race.model,
        "margin": race.margin,
        "reserve": race.reserve,
        "time": known.time if known else None,
        "lap_times": known.lap_times if known else [],
        "nodes": len(s.t) if s else None,
        "starts": [
            {"start": a.start, "nodes": a.nodes, "time": a.time, "broken": a.broken}
            for a in attempts
        ],
        "verified": known.verified if known else None,
    }


def as_run(limit: Limit, race: Race) -> Run:
    """A solution as a run: what the vehicle does 100 times a second, with the referee's events."""
    referee = Referee(race.course, race.vehicle.radius, race.laps, TIMEOUT, penalties=True)
    spec = Spec.of(race.course, laps=race.laps).record() | {
        "vehicle": asdict(race.vehicle),
        "plant": race.model,
    }
    spec |= {
        "sampler": "limit",
        "preset": "limit",
        "own": {"controller": {"class": "best known limit"}},
    }
    fine, recorder, events = limit.path(1000.0).tolist(), Recorder(), []
    states = limit.states(race.vehicle, np.array(fine)[:, 0])
    for k, (t, *p) in enumerate(fine):
        if k:
            events += referee.observe(fine[k - 1][0], (*fine[k - 1][1:],), t, (*p,))
        if k % 10 == 0 or k == len(fine) - 1:
            x = State(*states[k].tolist())
            frame = Frame(
                t=t,
                x=x,
                u=Control(*x.body_rates, thrust=x.thrust),
                passed=referee.passed,
                lap=referee.lap,
                gate=referee.next_gate + 1,
                ess=0.0,
                temperature=0.0,
                cost=0.0,
                plan_ms=0.0,
                elapsed=t,
                events=tuple(events),
                outcome=referee.outcome if k == len(fine) - 1 else None,
            )
            recorder.add(frame)
            events = []
    return recorder.run(spec)


def _report(race: Race, known: Limit | None, found: Limit | None) -> Iterator[str]:
    name = f"[bold]{escape(race.course.name)}[/], {escape(race.vehicle.name)}"
    what = "a closed lap" if race.closed else f"{race.laps} lap{'s' * (race.laps > 1)} from rest"
    if not known:
        yield f"{name}, {what}: no solution is known"
        return
    v, nodes = known.verified, len(known.solution.t)
    what += f", {race.margin:g} m from the frames" * bool(race.margin)
    yield f"{name}, {what}: best known limit [bold]{known.time:.3f} s[/], model {race.model}"
    if known is not found:
        yield "found before, and not slower than what was found now"
    yield f"[dim]laps[/]  {'  '.join(f'{t:.3f}' for t in known.lap_times)} s"
    apart = f"{1e3 * v['residual']:.1g} mm at most from the fine integration, worth {1e3 * v['worth']:.1g} ms"
    yield f"[dim]checked[/]  {nodes} nodes, {apart}; referee: {v['outcome']}, {v['events'].get('pass', 0)} gates"
