"""`race fly`: one flight, from the flags to the report."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable
from contextlib import closing, suppress
from typing import Annotated

from quadsim.cli.flags import Given, Help, Json, RunsDir, settings_as_flags
from quadsim.cli.progress import Progress
from quadsim.cli.report import present
from quadsim.console import COMPILING, UsageError, complain, uninterrupted
from quadsim.race.events import Frame
from quadsim.record.archive import RunFolder, remove_unfinished
from quadsim.record.run import Recorder, Run, RunError
from quadsim.spec.build import build, launch, with_threads
from quadsim.spec.spec import Spec

EXIT = {"finished": 0, "crashed": 1, "stuck": 1, "timeout": 1, "interrupted": 130}
CourseName = Annotated[
    str | None, Help("a name (see `race courses`) or a FILE.yaml; default: split_s_swift")
]


def fly(
    course: CourseName = None,
    /,
    *,
    settings: Given = None,
    runs_dir: RunsDir = "runs",
    json: Json = False,
) -> int:
    """Simulate one flight: lap and split times, crashes, thrust chatter, planning time. Default:
    the Split-S course.

    race fly split_s_swift --sampler gaussian --seed 3

    race fly mine.yaml --preset race --vehicle kingfisher --laps 2 --samples 2048 --model.drag 0

    race fly zigzag  (an off-road vehicle along a corridor)

    race fly --system double_integrator  (a point mass to a goal)
    """
    spec = spec_of(course, settings)
    try:
        plant, controller, referee = build(spec)
    except ValueError as error:  # laps on an open course, a gate too small for the vehicle
        raise UsageError(str(error)) from None
    if spec.plant == "rigid" and not (settings or {}).get("plant"):
        complain(
            "PyBullet is not installed: using the built-in rigid-body simulation (--plant rigid)"
        )
    remove_unfinished(runs_dir)
    with closing(plant), RunFolder.open(runs_dir, spec.record()) as folder:
        if not getattr(controller, "is_cached", True):
            complain(COMPILING)
        recorder = _recorded(launch(spec, plant, controller, referee), spec, quiet=json)
        run = recorder.run(spec.record())
        # a second one does not cost what the first one ended
        with suppress(KeyboardInterrupt), uninterrupted():
            failure = _save(folder, run)
    present(run, None if failure else folder.path, json)
    if failure:
        raise failure
    if run.outcome == "interrupted":
        complain(
            f"race fly: interrupted at {run.telemetry['t'][-1]:.2f} s, the flight so far is kept"
        )
    return EXIT[run.outcome]


def spec_of(course: str | None, settings: Given = None) -> Spec:
    """What these flags fly, with the threads in use. Raises UsageError that names the flag,
    FileError."""
    with settings_as_flags():
        return with_threads(Spec.of(course, **(settings or {})))


def _recorded(flight: Iterable[Frame], spec: Spec, quiet: bool) -> Recorder:
    """Every frame until the flight ends or Ctrl-C comes; KeyboardInterrupt where nothing has flown
    yet."""
    recorder = Recorder()
    with Progress(spec, quiet) as line, suppress(KeyboardInterrupt):
        for frame in flight:
            recorder.add(frame)
            line.show(frame)
    if not len(recorder):
        raise KeyboardInterrupt
    return recorder


def _save(folder: RunFolder, run: Run) -> RunError | None:
    """The error is handed back: the report of a flight comes first, also when it cannot be kept."""
    try:
        folder.save(run)
    except RunError as error:
        return error
    return None


def check_compiler() -> None:
    """Raises UsageError where a NUMBA_ variable keeps numba from compiling, here or in a worker."""
    given = ", ".join(
        f"{name}={value!r}"
        for name, value in sorted(os.environ.items())
        if name.startswith("NUMBA_")
    )
    if given and (problem := _compiler_problem()):
        raise UsageError(f"{given}: {problem}: unset it, or give it a value that numba knows")


def _compiler_problem() -> str:
    """What numba says of its variables: the first line, or ""."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            import numba

            if numba.config.DISABLE_JIT:  # pyright: ignore[reportPrivateImportUsage, reportAttributeAccessIssue]
                return "the planner has to be compiled"
            from controllers.lanes.threads import use_threads

            use_threads(None)
        except (ValueError, ImportError, RuntimeError) as error:
            return str(error).splitlines()[0].rstrip(".")
    unread = [
        str(warning.message) for warning in said if "Environment variable" in str(warning.message)
    ]
    return unread[0].splitlines()[0].rstrip(".") if unread else ""
