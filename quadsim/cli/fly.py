"""`race fly`: one flight, from the flags to the report."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from shlex import quote
from typing import Annotated, Any

from quadsim.cli.commands import EXIT
from quadsim.cli.flags import (
    CourseName,
    Given,
    Help,
    Json,
    flag,
    names,
    settings_as_flags,
    stored_runs,
)
from quadsim.cli.progress import Progress
from quadsim.cli.report import present
from quadsim.config.build import build, with_threads
from quadsim.config.checks import expect_new_log
from quadsim.config.recorded import sorted_settings
from quadsim.config.settings import SETTINGS, FlightSettings
from quadsim.config.spec import Spec
from quadsim.console import COMPILING, UsageError, complain, uninterrupted
from quadsim.files.arrays import read_bytes
from quadsim.files.strict_yaml import FileError
from quadsim.firmware.process import FirmwareError
from quadsim.firmware.translation import translated
from quadsim.racing.events import Frame
from quadsim.racing.flight import Controller, simulate
from quadsim.record.archive import RunFolder, find_run, read_run, remove_unfinished
from quadsim.record.run import (
    RecordedRun,
    Recorder,
    RunError,
    own_parts,
    same_flight,
    why_not_repeatable,
)
from quadsim.record.whole_files import write_whole

# Name of the firmware's log in the folder of a run
BLACKBOX = "blackbox.bbl"


def fly(
    course: CourseName = None,
    /,
    *,
    from_: Annotated[
        str | None,
        Help(
            "fly a stored run again: its folder, a part of its name, or last; further flags change"
            " it",
            name="--from",
            completer=names(stored_runs),
        ),
    ] = None,
    settings: Given = None,
    json: Json = False,
) -> int:
    """Simulate one flight: lap and split times, crashes, thrust chatter, planning time.

    The default is three laps of the Split-S course.

    race fly split_s_swift --sampler gaussian --seed 3

    race fly mine.yaml --preset race --vehicle kingfisher --laps 2 --samples 2048 --model-drag 0

    race fly --from last
    """
    spec, before = _asked(course, from_, settings or {})
    # Before `build`, which lets a sampler of the user's own draw
    record = spec.record()
    try:
        parts = build(spec)
    except ValueError as error:  # laps on an open course, a gate too small for the vehicle
        raise UsageError(str(error)) from None
    remove_unfinished(spec.runs_dir)

    end_of_plant = ExitStack()
    end_of_plant.enter_context(closing(parts.plant))
    with end_of_plant, RunFolder.open(spec.runs_dir, record) as folder:
        _complain_before(spec, parts.controller, settings or {})
        with settings_as_flags():  # a user's own sampler may return invalid values
            recorder, ended = _recorded(simulate(parts), spec, quiet=json)
        run = recorder.run(record)
        failure: RunError | FileError | None = None
        unwritten: FirmwareError | None = None
        # The flight that a first Ctrl-C has ended is stored despite a second Ctrl-C.
        with suppress(KeyboardInterrupt), uninterrupted():
            # A firmware writes its log at its end
            unwritten = _closed(end_of_plant)
            failure = _save(folder, run, None if unwritten else spec.blackbox)

    present(run, None if failure else folder.path, json, spec.runs_dir)
    if before:
        complain(compared(run, before, settings or {}))
    for error in (failure, unwritten):
        if error:
            raise error
    if ended:
        raise FirmwareError(f"{ended}: the flight so far is kept")
    if run.outcome == "interrupted":
        end = run.telemetry["t"][-1]
        complain(f"race fly: interrupted at {end:.2f} s, the flight so far is kept")
    return EXIT[run.outcome]


def _asked(
    course: str | None, from_: str | None, settings: Mapping[str, Any]
) -> tuple[Spec, RecordedRun | None]:
    """Return the Spec of a flight, and the stored run that it repeats, if it does.

    Raises:
        UsageError: a flag cannot be used.
        FileError, RunError: a file or the stored run cannot be read.
    """
    if settings.get("blackbox"):
        with settings_as_flags():
            expect_new_log(settings["blackbox"])
    if from_ is None:
        return spec_of(course, dict(settings)), None
    if course is not None:
        raise UsageError(f"--from: expected no course beside a run, got {course!r}")
    before = stored_run(from_, settings)
    return spec_again(before, settings), before


def _complain_before(spec: Spec, controller: Controller, settings: Mapping[str, Any]) -> None:
    """Say which plant flies, what of a configuration is left out, and that loops are compiled."""
    if spec.plant == "rigid" and not settings.get("plant"):
        complain("PyBullet is not installed: the built-in rigid body flies (--plant rigid)")
    if spec.betaflight and (read := translated(spec.betaflight)).changes_something:
        shown = f"race firmware read --betaflight {quote(spec.betaflight.name)}"
        complain(f"{read.summary()}: {shown}")
    complain_beside_controllers("race fly", [spec], settings)
    if not getattr(controller, "is_cached", True):
        complain(COMPILING)


def spec_of(course: str | None, settings: Given = None) -> Spec:
    """Return the Spec of these flags, and apply its number of threads.

    Raises:
        UsageError: a flag cannot be used.
        FileError: a file cannot be read.
    """
    given = settings or {}
    if given.get("pilot"):
        check_beside_pilot(given)
    with settings_as_flags():
        return with_threads(Spec.of(course, **given))


def check_beside_pilot(given: Mapping[str, Any]) -> None:
    """Raise UsageError for a setting of the planner, which a learned pilot would ignore.

    `race compare` accepts such a setting, as only some of its variants may be pilots.
    """
    for name in given:
        # The preset of a pilot would only bring its vehicle.
        if of_planner(name) or name == "preset":
            wanted = "expected none beside --pilot, which flies without a planner"
            raise UsageError(f"{flag(name)}: {wanted}")


def of_planner(name: str) -> bool:
    """Return whether a setting is one of the planner alone, and not of vehicle, model or clock."""
    if name in ("sampler", "term", "view_weight"):
        return True
    return SETTINGS[name].group in ("sampling", "mppi", "cost") and name != "dt"


def complain_beside_controllers(command: str, specs: Sequence[Spec], given: Iterable[str]) -> None:
    """Say in one line which settings have no effect, as controllers of the user's own fly.

    Args:
        command: the command, such as "race fly".
        specs: its flights; there is nothing to say if a planner flies one of them.
        given: names of the settings that were given for all of them.
    """
    flown = [spec.flown_by for spec in specs if "controller" in spec.own_objects()]
    names = [name for name in given if name in SETTINGS]
    unused = [flag(name) for name in names if of_planner(name) or name == "deadline_ms"]
    if unused and flown and len(flown) == len(specs):
        of_own = f"controller{'s' * (len(flown) > 1)} {', '.join(dict.fromkeys(flown))} of your own"
        why = f"without effect beside the {of_own}, unless read from the Spec"
        complain(f"{command}: {', '.join(unused)}: {why}")


def stored_run(name: str, settings: Mapping[str, Any]) -> RecordedRun:
    """Return the stored run to repeat. Raises RunError."""
    return read_run(find_run(name, settings.get("runs_dir") or FlightSettings.runs_dir))


def spec_again(before: RecordedRun, settings: Mapping[str, Any]) -> Spec:
    """Return the Spec of a stored run with the given flags, and apply its number of threads.

    Raises:
        UsageError: a flag cannot be used.
        FileError: a file or a part of the run is missing or differs.
    """
    with settings_as_flags():
        return with_threads(Spec.of_record(before.spec, **settings))


def compared(run: RecordedRun, before: RecordedRun, settings: Mapping[str, Any]) -> str:
    """Return one line that says whether a repeated run equals the original."""
    changed = sorted_settings(before.spec, settings).changed
    if changed:
        return f"the stored run was flown with other values of {', '.join(sorted(changed))}"
    if same_flight(run, before):
        return "the same flight as the stored run, to the last bit"
    reason = why_not_repeatable(before)
    if own_parts(before.spec):
        reason = ""  # the settings were given again
    # The same spec gives the same bits only on one machine with the same libraries
    return f"not the same flight as the stored run: {reason or 'see its cpu and versions'}"


def _recorded(
    flight: Iterable[Frame], spec: Spec, quiet: bool
) -> tuple[Recorder, FirmwareError | None]:
    """Record every frame until the flight ends, Ctrl-C is pressed or the firmware ends.

    Returns:
        The recorder, and the error of a firmware that has ended in flight.

    Raises:
        KeyboardInterrupt, FirmwareError: there is no frame yet.
    """
    recorder = Recorder()
    ended = None
    try:
        with Progress(spec, quiet) as line, suppress(KeyboardInterrupt):
            for frame in flight:
                recorder.add(frame)
                line.show(frame)
    except FirmwareError as error:
        ended = error
    if not len(recorder):
        raise ended or KeyboardInterrupt("race fly: interrupted, nothing to keep")
    return recorder, ended


def _closed(end_of_plant: ExitStack) -> FirmwareError | None:
    """Close the plant, and return the error if the firmware's log cannot be written."""
    try:
        end_of_plant.close()
    except FirmwareError as error:
        return error
    return None


def _save(folder: RunFolder, run: RecordedRun, blackbox: str | None) -> RunError | FileError | None:
    """Store the run and return the error if that fails.

    The caller prints the report before the error.

    Args:
        folder: the folder of the run.
        run: the run.
        blackbox: the file of the firmware's log, of which the folder gets a copy; None: no log.
    """
    try:
        if blackbox is not None:
            data = read_bytes(Path(blackbox), "a log of the firmware")
            write_whole(folder.part / BLACKBOX, data)
        folder.save(run)
    except (RunError, FileError) as error:
        folder.drop()
        return error
    return None
