"""`race fly`: one flight, from the flags to the report."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import closing, suppress
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
from quadsim.config.build import build, launch, with_threads
from quadsim.config.recorded import recorded_spec, sorted_settings
from quadsim.config.settings import SETTINGS, FlightSettings
from quadsim.config.spec import Spec
from quadsim.console import COMPILING, UsageError, complain, uninterrupted
from quadsim.firmware.process import FirmwareError
from quadsim.firmware.translation import translated
from quadsim.racing.events import Frame
from quadsim.record.archive import RunFolder, find_run, load_reportable, remove_unfinished
from quadsim.record.run import (
    RecordedRun,
    Recorder,
    RunError,
    own_parts,
    same_flight,
    why_not_repeatable,
)


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
    before = None
    if from_ is None:
        spec = spec_of(course, settings)
    else:
        if course is not None:
            raise UsageError(f"--from: expected no course beside a run, got {course!r}")
        before = stored_run(from_, settings or {})
        spec = spec_again(before, settings or {})
    try:
        parts = build(spec)
    except ValueError as error:  # laps on an open course, a gate too small for the vehicle
        raise UsageError(str(error)) from None
    remove_unfinished(spec.runs_dir)

    record = spec.record()
    with closing(parts.plant), RunFolder.open(spec.runs_dir, record) as folder:
        if spec.plant == "rigid" and not (settings or {}).get("plant"):
            complain("PyBullet is not installed: the built-in rigid body flies (--plant rigid)")
        if spec.betaflight and (read := translated(spec.betaflight)).changes_something:
            shown = f"race firmware read --betaflight {quote(spec.betaflight.name)}"
            complain(f"{read.summary()}: {shown}")
        if not getattr(parts.controller, "is_cached", True):
            complain(COMPILING)
        with settings_as_flags():  # a user's own sampler may return invalid values
            recorder, ended = _recorded(launch(spec, parts), spec, quiet=json)
        run = recorder.run(record)
        # The flight that a first Ctrl-C has ended is stored despite a second Ctrl-C.
        with suppress(KeyboardInterrupt), uninterrupted():
            failure = _save(folder, run)

    present(run, None if failure else folder.path, json, spec.runs_dir)
    if before:
        complain(compared(run, before, settings or {}))
    if failure:
        raise failure
    if ended:
        raise FirmwareError(f"{ended}: the flight so far is kept")
    if run.outcome == "interrupted":
        end = run.telemetry["t"][-1]
        complain(f"race fly: interrupted at {end:.2f} s, the flight so far is kept")
    return EXIT[run.outcome]


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
        of_planner = SETTINGS[name].group in ("sampling", "mppi", "cost") and name != "dt"
        if of_planner or name in ("sampler", "preset", "term", "view_weight"):
            wanted = "expected none beside --pilot, which flies without a planner"
            raise UsageError(f"{flag(name)}: {wanted}")


def stored_run(name: str, settings: Mapping[str, Any]) -> RecordedRun:
    """Return the stored run to repeat. Raises RunError."""
    return load_reportable(find_run(name, settings.get("runs_dir") or FlightSettings.runs_dir))


def spec_again(before: RecordedRun, settings: Mapping[str, Any]) -> Spec:
    """Return the Spec of a stored run with the given flags, and apply its number of threads.

    Raises:
        UsageError: a flag cannot be used.
        FileError: a file or a part of the run is missing or differs.
    """
    with settings_as_flags():
        return with_threads(recorded_spec(before.spec, settings))


def compared(run: RecordedRun, before: RecordedRun, settings: Mapping[str, Any]) -> str:
    """Return one line that says whether a repeated run equals the original."""
    _, changed = sorted_settings(before.spec, settings)
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


def _save(folder: RunFolder, run: RecordedRun) -> RunError | None:
    """Store the run and return the error if that fails.

    The caller prints the report before the error.
    """
    try:
        folder.save(run)
    except RunError as error:
        return error
    return None
