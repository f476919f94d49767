"""`race fly`: one flight, from the flags to the report."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import closing, suppress

from quadsim.cli.commands import EXIT
from quadsim.cli.flags import CourseName, Given, Json, settings_as_flags
from quadsim.cli.progress import Progress
from quadsim.cli.report import present
from quadsim.console import COMPILING, UsageError, complain, uninterrupted
from quadsim.race.events import Frame
from quadsim.record.archive import RunFolder, remove_unfinished
from quadsim.record.run import Recorder, Run, RunError
from quadsim.spec.build import build, launch, with_threads
from quadsim.spec.spec import Spec


def fly(course: CourseName = None, /, *, settings: Given = None, json: Json = False) -> int:
    """Simulate one flight: lap and split times, crashes, thrust chatter, planning time.

    The default is three laps of the Split-S course.

    race fly split_s_swift --sampler gaussian --seed 3

    race fly mine.yaml --preset race --vehicle kingfisher --laps 2 --samples 2048 --model-drag 0
    """
    spec = spec_of(course, settings)
    try:
        parts = build(spec)
    except ValueError as error:  # laps on an open course, a gate too small for the vehicle
        raise UsageError(str(error)) from None
    remove_unfinished(spec.runs_dir)

    record = spec.record()
    with closing(parts.plant), RunFolder.open(spec.runs_dir, record) as folder:
        if spec.plant == "rigid" and not (settings or {}).get("plant"):
            complain("PyBullet is not installed: the built-in rigid body flies (--plant rigid)")
        if not getattr(parts.controller, "is_cached", True):
            complain(COMPILING)
        recorder = _recorded(launch(spec, parts), spec, quiet=json)
        run = recorder.run(record)
        # A second Ctrl-C does not cost the flight that the first one ended.
        with suppress(KeyboardInterrupt), uninterrupted():
            failure = _save(folder, run)

    present(run, None if failure else folder.path, json, spec.runs_dir)
    if failure:
        raise failure
    if run.outcome == "interrupted":
        end = run.telemetry["t"][-1]
        complain(f"race fly: interrupted at {end:.2f} s, the flight so far is kept")
    return EXIT[run.outcome]


def spec_of(course: str | None, settings: Given = None) -> Spec:
    """Return the Spec of these flags, with its threads in use.

    Raises:
        UsageError: a flag cannot be used.
        FileError: a file cannot be read.
    """
    given = settings or {}
    with settings_as_flags():
        return with_threads(Spec.of(course, **given))


def _recorded(flight: Iterable[Frame], spec: Spec, quiet: bool) -> Recorder:
    """Return every frame until the flight ends or Ctrl-C comes.

    Raises KeyboardInterrupt where nothing has been flown yet.
    """
    recorder = Recorder()
    with Progress(spec, quiet) as line, suppress(KeyboardInterrupt):
        for frame in flight:
            recorder.add(frame)
            line.show(frame)
    if not len(recorder):
        raise KeyboardInterrupt
    return recorder


def _save(folder: RunFolder, run: Run) -> RunError | None:
    """Store the run and return what kept it from being stored.

    The report of a flight comes first, also where the flight cannot be stored.
    """
    try:
        folder.save(run)
    except RunError as error:
        return error
    return None
