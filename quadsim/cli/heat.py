"""`race heat`: a race of several vehicles in one world."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated

from msgspec import Meta
from rich.live import Live
from rich.markup import escape

from quadsim.cli.flags import (
    CourseName,
    Given,
    GivenHeat,
    Help,
    Json,
    settings_as_flags,
)
from quadsim.cli.fly import complain_beside_controllers
from quadsim.config.build import use_threads_of
from quadsim.config.settings import FlightSettings
from quadsim.console import (
    UsageError,
    complain,
    emit,
    emit_json,
    progress_console,
    uninterrupted,
)
from quadsim.firmware.process import FirmwareError
from quadsim.heat.archive import find_heat, read_heat, recorded_heat
from quadsim.heat.launch import heat_frames
from quadsim.heat.line_up import line_up, parts_of
from quadsim.heat.result import HeatRecorder
from quadsim.heat.spec import HeatSpec
from quadsim.record.run import RunError
from quadsim.record.whole_files import expect_file, try_writing
from quadsim.results.heat import Heat

# Default entrants
ENTRANTS = ("colored", "gaussian")
PERIOD = 0.1  # race time between two updates of the live line [s]
EntrantTexts = Annotated[
    list[str] | None,
    Help(
        "samplers, or [NAME=]part+part of presets, samplers and settings; default: colored"
        " gaussian",
        consume_multiple=True,
        show_default=False,
    ),
]


def heat(
    course: CourseName = None,
    /,
    *,
    entrants: EntrantTexts = None,
    rotation: Annotated[
        int, Meta(ge=0, le=7), Help("places by which each entrant starts further on")
    ] = 0,
    plot: Annotated[
        str | None, Help("FILE.png: places, gaps and paths", show_default=False)
    ] = None,
    from_: Annotated[
        str | None,
        Help(
            "fly a stored race again: its folder, a part of its name, or last; --seed changes it",
            name="--from",
        ),
    ] = None,
    parts: Annotated[
        list[str] | None,
        Help(
            "parts of your own that flew, beside --from: NAME=controller=package.module:Class",
            consume_multiple=True,
            negative_iterable="",
        ),
    ] = None,
    race: GivenHeat = None,
    settings: Given = None,
    json: Json = False,
) -> int:
    """Race several vehicles in one world: who wins, who overtakes, who collides?

    Each entrant has its own planner or pilot, and perceives the others.
    race compare-heats flies many races of the same entrants.

    race heat split_s_swift --entrants colored gaussian

    race heat --entrants colored pilot=split_s_swift calm=colored+target-ess=200
    --rules physics --laps 1
    """
    given = dict(settings or {})
    if from_ is not None:
        named = course is not None or entrants is not None
        runs_dir = given.pop("runs_dir", None)
        seed = given.pop("seed", None)
        if named or given or race or rotation or plot:
            flags = "--runs-dir, --seed and --parts"
            wanted = f"neither a course nor other flags than {flags} beside a race"
            raise UsageError(f"--from: expected {wanted}")
        return _again(from_, runs_dir, parts or (), seed, json)
    if parts:
        raise UsageError(
            "--parts: expected none without --from; --entrants have parts of their own"
        )
    with settings_as_flags():
        use_threads_of(given.pop("threads", None))
        names = ENTRANTS if entrants is None else entrants
        made, of_race = line_up(course, names, (race or {}) | given)
        complain_beside_controllers("race heat", [one.spec for one in made], given)
        seed = made[0].spec.seed if made else 0
        spec = HeatSpec(made, of_race, seed, rotation)
    return _one(spec, given.get("runs_dir") or FlightSettings.runs_dir, plot, json)


def _one(spec: HeatSpec, runs_dir: str, plot: str | None, json: bool) -> int:
    """Fly one race, store it and print its report."""
    # Before the race, which may take minutes
    try_writing(Path(runs_dir))
    if plot:
        expect_file(Path(plot))
        try_writing(Path(plot).parent)
    flown, ended = _flown(spec, quiet=json)
    folder = None
    failure = None
    with suppress(KeyboardInterrupt), uninterrupted():
        try:
            folder = flown.save(runs_dir)
        except RunError as error:
            failure = error
    if plot:
        flown.plot(plot)
    if json:
        emit_json(flown.as_json() | {"folder": str(folder) if folder else None})
    else:
        emit(*flown.renderables())
        if folder:
            emit("", f"[dim]stored in {escape(str(folder))}[/]")
    if failure:
        raise failure
    if ended:
        raise FirmwareError(f"{ended}: the race so far is kept")
    if any(run.outcome == "interrupted" for run in flown.runs):
        complain("race heat: interrupted, the race so far is kept")
        return 130
    return _exit_code(flown)


def _exit_code(flown: Heat) -> int:
    """Return 0 if an entrant has finished, 1 if none has."""
    return 0 if any(run.outcome == "finished" for run in flown.runs) else 1


def _again(
    name: str, runs_dir: str | None, parts: Sequence[str], seed: str | None, json: bool
) -> int:
    """Fly a stored race again, and report whether the result is the same.

    With another seed it is another race, which is stored.

    Args:
        name: folder of the race, a part of its name, or "last".
        runs_dir: folder of runs with the race and the solutions that its planners follow; None: the
            default folder, and for the solutions the folder of the record.
        parts: texts of the user's own parts that flew, see `parts_of`.
        seed: seed of the race; None: the seed of the record.
        json: whether the report is JSON.
    """
    stored = read_heat(find_heat(name, runs_dir or FlightSettings.runs_dir))
    with settings_as_flags():
        spec = recorded_heat(stored.record, parts_of(parts), {"runs_dir": runs_dir, "seed": seed})
    if spec.seed != stored.spec.seed:
        code = _one(spec, runs_dir or FlightSettings.runs_dir, None, json)
        complain(f"the stored race was flown with seed {stored.spec.seed}")
        return code
    flown, ended = _flown(spec, quiet=json)
    if ended:
        raise ended
    if json:
        emit_json(flown.as_json())
    else:
        emit(*flown.renderables())
    same = [run.digest() for run in flown.runs] == [run.digest() for run in stored.runs]
    complain(
        "the same race as the stored one, to the last bit"
        if same
        else "not the same race as the stored one: see its cpu and versions"
    )
    return _exit_code(flown)


def _flown(spec: HeatSpec, quiet: bool) -> tuple[Heat, FirmwareError | None]:
    """Fly the race until it ends, Ctrl-C is pressed or a vehicle's firmware ends.

    Returns:
        The race, and the error of a firmware that has ended.

    Raises:
        KeyboardInterrupt, FirmwareError: not all vehicles have started.
    """
    ended = None
    recorder = HeatRecorder(spec)
    console = progress_console()
    live = None
    if console.is_terminal and not quiet:
        live = Live(console=console, auto_refresh=False, transient=True)
        live.start()
    drawn = -PERIOD
    try:
        with suppress(KeyboardInterrupt), settings_as_flags():
            for frame in heat_frames(spec):
                recorder.add(frame)
                if frame.fault:
                    name = spec.names[frame.number]
                    complain(f"race heat: {name} is out at {frame.t:.2f} s: {frame.fault}")
                if live and frame.t >= drawn + PERIOD:
                    live.update(_line(spec, recorder, frame.t), refresh=True)
                    drawn = frame.t
    except FirmwareError as error:
        ended = error
    finally:
        if live:
            live.stop()
    if not all(map(len, recorder.recorders)):
        raise ended or KeyboardInterrupt("race heat: interrupted, nothing to keep")
    return Heat.flown(spec, recorder), ended


def _line(spec: HeatSpec, recorder: HeatRecorder, t: float) -> str:
    """Return the live line: time, and the number of gates passed by each entrant."""
    parts = []
    for name, own in zip(spec.names, recorder.recorders, strict=True):
        last = own.last
        state = "-" if last is None else last.outcome or f"{last.passed} gates"
        parts.append(f"{escape(name)} {state}")
    return f"{t:5.1f} s  " + "  ".join(parts)
