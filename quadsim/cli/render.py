"""`race render`: pictures of a flight or of a course for perception, with labels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future
from difflib import get_close_matches
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from time import perf_counter
from typing import Annotated, NamedTuple

from msgspec import Meta
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from quadsim.campaign.run.pool import Pool, finished, open_pool
from quadsim.cli.flags import Help, Json, RunsDir, Switch, course_help
from quadsim.console import UsageError, complain, emit, emit_json, progress_console
from quadsim.course import course_names, load_course
from quadsim.files.data_files import SUFFIXES
from quadsim.files.extras import needs_extra
from quadsim.files.yaml_errors import did_you_mean
from quadsim.record.archive import find_run, read_run
from quadsim.record.run import RunError
from quadsim.record.whole_files import expect_file, try_writing
from quadsim.render.folder import annotate, claimed, whole, write_mp4
from quadsim.render.frames import Job, Pictures, make_frames
from quadsim.render.look import VARIED
from quadsim.render.poses import Pose, drawn_poses, flown_poses
from quadsim.sensing.camera import Camera, load_camera

DRAWN = 100  # default number of pictures of a course
CHUNK = 4  # pictures per task of a worker

TARGET = "a run (its folder, a part of its name, last), or a course by name or as FILE.yaml"
OUT = "folder for pictures and labels; a folder with pictures of the same settings is continued"
VARY = "traits drawn anew for each picture: textures, light, background, joined by commas, or all"
MP4 = "write a film of the pictures too, video.mp4; needs the extra render"
FILM = "FILE.webp or FILE.gif: in place of pictures, a film of a flight from behind the vehicle"
CAMERA = "a camera by name, or a FILE.yaml; default: aigp, and 640 x 360 at 20 Hz for a film"
Count = Annotated[int, Meta(ge=1, le=10**5)]
Seed = Annotated[int, Meta(ge=0, le=10**9)]
Workers = Annotated[int, Meta(ge=1)]


def render(
    target: Annotated[str, course_help(TARGET)] = "last",
    /,
    *,
    camera: Annotated[str | None, Help(CAMERA)] = None,
    out: Annotated[str, Help(OUT)] = "pictures",
    frames: Annotated[
        Count | None, Help("pictures; default: the flight's, 100 of a course")
    ] = None,
    seed: Annotated[Seed, Help("random seed of a course's poses, and of the traits that vary")] = 0,
    vary: Annotated[str | None, Help(VARY)] = None,
    mp4: Annotated[bool, Switch(MP4)] = False,
    film: Annotated[str | None, Help(FILM)] = None,
    jobs: Annotated[Workers | None, Help("worker processes; default: one for each core")] = None,
    runs_dir: RunsDir = "runs",
    json: Json = False,
) -> int:
    """Render pictures for perception from a camera on the vehicle.

    The pictures show a flight, or a course from poses along and around it, as colour, depth and
    segmentation. Labels are the corners of the gates in pixels and the camera's pose (COCO-like
    JSON).

    race render last --camera aigp --out pictures --mp4

    race render split_s_swift --frames 1000 --seed 1 --vary all --out pictures

    race render last --film flight.webp
    """
    _check_extras(mp4)
    if film is not None:
        if mp4 or vary:
            raise UsageError("--film: expected neither --mp4 nor --vary beside it")
        return _film(target, camera, film, frames, runs_dir, json)
    asked = _asked(target, load_camera(camera or "aigp"), frames, seed, _varied(vary), runs_dir)
    pictures = asked.pictures
    folder = Path(out)
    with claimed(folder, pictures):
        made, rate = _make_missing(asked, folder, jobs, quiet=json)
        count = len(asked.poses)
        annotate(folder, pictures, count)
        if mp4:
            write_mp4(folder, pictures, count)
    _report(folder, count, made, rate, json)
    return 0


def _make_missing(asked: _Asked, folder: Path, jobs: int | None, quiet: bool) -> tuple[int, float]:
    """Make the missing pictures, and return their number and the rate [1/s].

    Raises:
        UsageError: a worker process was killed.
        KeyboardInterrupt: the message has the number of complete pictures.
    """
    count = len(asked.poses)
    kept = whole(folder, count)
    missing = [(i, pose) for i, pose in enumerate(asked.poses) if i not in kept]
    began = perf_counter()
    try:
        with open_pool(jobs) as pool, _ProgressLine(count, len(kept), quiet=quiet) as line:
            for made in make_all(pool, asked.pictures, folder, missing):
                line.advance(line.tasks[0].id, made)
    except BrokenExecutor:
        kept_text = "whole pictures are kept: the same command continues"
        raise UsageError(f"a worker process was killed; {kept_text}") from None
    except KeyboardInterrupt:
        there = f"{len(whole(folder, count))} of {count} pictures are whole"
        advice = "the same command continues"
        raise KeyboardInterrupt(f"race render: interrupted, {there}: {advice}") from None
    return len(missing), len(missing) / (perf_counter() - began)


def make_all(
    pool: Pool, pictures: Pictures, out: Path, poses: Sequence[tuple[int, Pose]]
) -> Iterator[int]:
    """Make these pictures; yield the number of newly completed ones each time.

    Raises:
        OSError: a picture cannot be written.
        BrokenExecutor: a worker was killed.
    """
    chunks = iter([poses[i : i + CHUNK] for i in range(0, len(poses), CHUNK)])
    running: set[Future] = set()
    while True:
        for chunk in islice(chunks, 2 * pool.window - len(running)):
            running.add(pool.submit(make_frames, Job(pictures, out, chunk)))
        if not running:
            return
        for future in finished(running):
            running.remove(future)
            yield len(future.result())


class _ProgressLine(Progress):
    """A bar with the pictures per second, shown only if stderr is a terminal."""

    def __init__(self, total: int, kept: int, quiet: bool):
        if kept and not quiet:
            complain(f"{kept} of {total} pictures are kept from before")
        console = progress_console()
        super().__init__(
            BarColumn(24),
            MofNCompleteColumn(),
            TextColumn("{task.speed:.1f} a second"),
            console=console,
            transient=True,
            disable=quiet or not console.is_terminal,
        )
        self.add_task("", total=total, completed=kept)


def _check_extras(mp4: bool) -> None:
    """Raise UsageError unless the required packages are installed."""
    if mp4 and find_spec("imageio_ffmpeg") is None:
        raise UsageError(f"--mp4: {needs_extra('imageio-ffmpeg', 'render')}")


def _varied(given: str | None) -> tuple[str, ...]:
    """Return the traits that vary, in the order of VARIED. Raises UsageError."""
    if not given:
        return ()
    if given == "all":
        return VARIED
    names = [name.strip() for name in given.split(",")]
    for name in names:
        if name not in VARIED:
            raise UsageError(f"--vary: no {name!r}: {did_you_mean(name, (*VARIED, 'all'))}")
    return tuple(name for name in VARIED if name in names)


class _Asked(NamedTuple):
    """The requested pictures."""

    pictures: Pictures
    poses: list[Pose]


def _asked(
    target: str, camera: Camera, frames: int | None, seed: int, vary: tuple[str, ...], runs_dir: str
) -> _Asked:
    """Return the pictures of a course or of a run. Raises UsageError, FileError, RunError."""
    if target.endswith(SUFFIXES) or target in course_names():
        course = load_course(target)
        try:
            poses = drawn_poses(course, camera, frames or DRAWN, seed)
        except ValueError as error:
            raise UsageError(str(error)) from None
        return _Asked(Pictures(course.name, course.text, camera, seed, vary, "drawn"), poses)
    run = read_run(_run_folder(target, runs_dir))
    poses = flown_poses(run.telemetry, camera.rate)[:frames]
    course = run.course
    return _Asked(Pictures(course.name, course.text, camera, seed, vary, run.digest()), poses)


def _film(
    target: str, camera: str | None, file: str, frames: int | None, runs_dir: str, as_json: bool
) -> int:
    """Write a film of a run, and return the exit code.

    Raises:
        UsageError, FileError, RunError: the file, the camera or the run cannot be used.
        OSError: the film cannot be written.
    """
    # imported here, as it loads Matplotlib
    from quadsim.render import film

    path = Path(file)
    if path.suffix.lower() not in film.FORMATS:
        wanted = " or ".join(f"FILE{suffix}" for suffix in film.FORMATS)
        raise UsageError(f"--film: expected {wanted}, got {file!r}")
    if not path.parent.is_dir():
        raise UsageError(f"--film: expected a folder that exists, got {str(path.parent)!r}")
    if target.endswith(SUFFIXES) or target in course_names():
        raise UsageError(f"--film: expected a run, got the course {target!r}")
    expect_file(path)
    try_writing(path.parent)
    lens = load_camera(camera) if camera else film.CAMERA
    run = read_run(_run_folder(target, runs_dir))
    course = run.course
    count = len(flown_poses(run.telemetry, lens.rate)[:frames])
    radius = run.spec["vehicle"]["radius"]
    pictures = []
    with _ProgressLine(count, 0, quiet=as_json) as line:
        for picture in film.film(course, run.telemetry, radius, lens, count):
            pictures.append(picture)
            line.advance(line.tasks[0].id)
    film.write_film(pictures, lens.rate, path)
    if as_json:
        emit_json({"film": file, "pictures": count})
    else:
        emit(f"{count} pictures in {escape(file)}")
    return 0


def _run_folder(target: str, runs_dir: str) -> Path:
    """Return the folder of a run. Raises RunError, or UsageError for a misspelt course."""
    try:
        return find_run(target, runs_dir)
    except RunError:
        near = get_close_matches(target, course_names(), n=1)
        if near:
            raise UsageError(f"no run or course {target!r}: did you mean {near[0]!r}?") from None
        raise


def _report(out: Path, count: int, made: int, rate: float, as_json: bool) -> None:
    """Report the pictures that were made."""
    if as_json:
        per_second = rate if made else None
        emit_json({"out": str(out), "pictures": count, "made": made, "per_second": per_second})
        return
    speed = f", {rate:.1f} a second" if made else ""
    emit(f"{count} pictures in {escape(str(out))}: {made} made{speed}, {count - made} kept")
