"""`race render`: pictures of a flight or of a course for perception, with labels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future
from difflib import get_close_matches
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter
from typing import Annotated

from msgspec import Meta
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from quadsim.campaign.pool import Pool, finished, open_pool
from quadsim.cli.flags import Help, Json, RunsDir, Switch
from quadsim.console import UsageError, complain, emit, emit_json, progress_console
from quadsim.files.data_files import SUFFIXES as YAML
from quadsim.files.extras import needs_extra
from quadsim.files.yaml_errors import did_you_mean
from quadsim.physics.plant import has_bullet
from quadsim.record.archive import find_run, load_run
from quadsim.record.run import RunError, system_of
from quadsim.render.folder import annotate, film, settle, whole
from quadsim.render.frames import Pictures, make_frames
from quadsim.render.look import VARIED
from quadsim.render.poses import Pose, drawn_poses, flown_poses
from quadsim.sensing.camera import Camera, load_camera
from quadsim.spec.systems import SYSTEMS, system_of_course

DRAWN = 100  # pictures of a course, unless another number is asked for
CHUNK = 4  # pictures a worker makes at a time

Count = Annotated[
    Annotated[int, Meta(ge=1, le=10**5)] | None,
    Help("pictures; default: the flight's, 100 of a course"),
]
Seed = Annotated[
    Annotated[int, Meta(ge=0, le=10**9)], Help("of a course's poses, and of what is varied")
]
Jobs = Annotated[
    Annotated[int, Meta(ge=1)] | None, Help("worker processes; default: one for each core")
]


def render(
    target: Annotated[
        str, Help("a run (its folder, a part of its name, last), or a course or FILE.yaml")
    ] = "last",
    /,
    *,
    camera: Annotated[str, Help("a camera by name, or a FILE.yaml")] = "aigp",
    out: Annotated[
        str, Help("folder for pictures and labels; one that has some is gone on with")
    ] = "pictures",
    frames: Count = None,
    seed: Seed = 0,
    vary: Annotated[
        str | None, Help("draw for each picture: textures,light,background, or all")
    ] = None,
    mp4: Annotated[
        bool, Switch("a film of the pictures too, video.mp4; needs the extra render")
    ] = False,
    jobs: Jobs = None,
    runs_dir: RunsDir = "runs",
    json: Json = False,
) -> int:
    """Pictures for perception: what a camera on the vehicle sees in a flight, or along and around a
    course. Colour, depth and segmentation, and as labels the corners of the gates in pixels and the
    camera's pose (COCO-like JSON).

    race render last --camera aigp --out pictures --mp4

    race render split_s_swift --frames 1000 --seed 1 --vary all --out pictures
    """
    _check_extras(mp4)
    seen = load_camera(camera)
    pictures, poses = _asked(target, seen, frames, seed, _varied(vary), runs_dir)
    folder = Path(out)
    settle(folder, pictures)
    kept, began = whole(folder, len(poses)), perf_counter()
    missing = [(i, pose) for i, pose in enumerate(poses) if i not in kept]
    try:
        with open_pool(jobs) as pool, _Line(len(poses), len(kept), quiet=json) as line:
            for made in make_all(pool, pictures, folder, missing):
                line.advance(line.tasks[0].id, made)
    except BrokenExecutor:
        raise UsageError(
            "a worker process was killed; what is whole is kept: the same command goes on"
        ) from None
    except KeyboardInterrupt:
        there = f"{len(whole(folder, len(poses)))} of {len(poses)} pictures are whole"
        raise KeyboardInterrupt(
            f"race render: interrupted, {there}: the same command goes on"
        ) from None
    rate = len(missing) / (perf_counter() - began)
    annotate(folder, pictures, len(poses))
    if mp4:
        film(folder, pictures, len(poses))
    _say(folder, len(poses), len(missing), rate, json)
    return 0


def make_all(
    pool: Pool, pictures: Pictures, out: Path, poses: Sequence[tuple[int, Pose]]
) -> Iterator[int]:
    """Make these pictures; yields how many more are whole. Raises OSError, BrokenExecutor."""
    chunks = iter([poses[i : i + CHUNK] for i in range(0, len(poses), CHUNK)])
    running: set[Future] = set()
    while True:
        while len(running) < 2 * pool.window and (chunk := next(chunks, None)):
            running.add(pool.submit(make_frames, (pictures, out, chunk)))
        if not running:
            return
        for future in finished(running):
            running.remove(future)
            yield len(future.result())


class _Line(Progress):
    """A bar with the pictures a second; nothing where stderr is no terminal."""

    def __init__(self, total: int, kept: int, quiet: bool):
        if kept and not quiet:
            complain(f"{kept} of {total} pictures are kept from before")
        console = progress_console()
        columns = (BarColumn(24), MofNCompleteColumn(), TextColumn("{task.speed:.1f} a second"))
        super().__init__(
            *columns, console=console, transient=True, disable=quiet or not console.is_terminal
        )
        self.add_task("", total=total, completed=kept)


def _check_extras(mp4: bool) -> None:
    """Raises UsageError."""
    if not has_bullet():
        raise UsageError(needs_extra("pybullet", "bullet"))
    if mp4 and find_spec("imageio_ffmpeg") is None:
        raise UsageError(f"--mp4: {needs_extra('imageio-ffmpeg', 'render')}")


def _varied(words: str | None) -> tuple[str, ...]:
    """Of VARIED, in its order. Raises UsageError."""
    said = (
        VARIED
        if words == "all"
        else tuple(word.strip() for word in words.split(","))
        if words
        else ()
    )
    for word in said:
        if word not in VARIED:
            raise UsageError(f"--vary: no {word!r}: {did_you_mean(word, (*VARIED, 'all'))}")
    return tuple(word for word in VARIED if word in said)


def _asked(
    target: str, camera: Camera, frames: int | None, seed: int, vary: tuple[str, ...], runs_dir: str
) -> tuple[Pictures, list[Pose]]:
    """Raises UsageError, FileError, RunError."""
    more = {"camera": camera, "seed": seed, "vary": vary}
    if target.endswith(YAML) or any(target in entry.courses for entry in SYSTEMS.values()):
        if (system := system_of_course(target)) != "quadrotor":
            raise UsageError(
                f"expected a course for a quadrotor, got {target!r} for the system {system}"
            )
        course = SYSTEMS["quadrotor"].load_course(target)
        try:
            poses = drawn_poses(course, camera, frames or DRAWN, seed)
        except ValueError as error:
            raise UsageError(str(error)) from None
        return Pictures(course.name, course.text, poses="drawn", **more), poses
    run = load_run(_run_folder(target, runs_dir))
    if (system := system_of(run.spec)) != "quadrotor":
        raise UsageError(
            f"expected the run of a quadrotor, got one of the system {system or run.spec['system']}"
        )
    poses = flown_poses(run.telemetry, camera.rate)[:frames]
    return Pictures(run.spec["course"], run.spec["course_text"], poses=run.digest(), **more), poses


def _run_folder(target: str, runs_dir: str) -> Path:
    """Raises UsageError for what is near a course's name, else RunError."""
    try:
        return find_run(target, runs_dir)
    except RunError:
        near = get_close_matches(target, SYSTEMS["quadrotor"].courses, n=1)
        if near:
            raise UsageError(f"no run or course {target!r}: did you mean {near[0]!r}?") from None
        raise


def _say(out: Path, count: int, made: int, rate: float, as_json: bool) -> None:
    if as_json:
        emit_json(
            {"out": str(out), "pictures": count, "made": made, "per_second": rate if made else None}
        )
    else:
        speed = f", {rate:.1f} a second" if made else ""
        emit(f"{count} pictures in {escape(str(out))}: {made} made{speed}, {count - made} kept")
