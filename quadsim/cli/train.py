"""`race train`: learn a pilot for a course, with evaluation in the simulator and a plot."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from datetime import timedelta
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from msgspec import Meta
from rich.markup import escape
from rich.progress import BarColumn, TextColumn
from rich.progress import Progress as Bar

from quadsim.cli.flags import Help, Json, course_help, settings_as_flags, vehicle_help
from quadsim.config.settings import SettingError
from quadsim.console import UsageError, complain, emit, emit_json, plain, progress_console
from quadsim.files.extras import needs_extra
from quadsim.files.strict_yaml import unit
from quadsim.record.whole_files import expect_file, try_writing
from quadsim.vehicle import Vehicle, load_vehicle, with_thrust_to_weight

if TYPE_CHECKING:
    from quadsim.learn.checkpoint import Evaluation
    from quadsim.learn.training import Progress, Training

# Weight of the margin in gates, below the environments' default: with this discount, the loss of
# all later reward is a sufficient penalty of a crash.
CLEARANCE = 1.0

COURSE = "a name (see `race courses`), a FILE.yaml or a folder of them; several joined by commas"
Whole = Annotated[int, Meta(ge=1, le=10**12)]
Seed = Annotated[int, Meta(ge=0, le=10**9)]
Size = Annotated[float, Meta(ge=0, le=3)]
Environments = Annotated[int, Meta(ge=1, le=10**6)]
Neurons = Annotated[int, Meta(ge=1, le=4096)]
Weight = Annotated[float, Meta(ge=0, le=1e6)]
Seconds = Annotated[float, unit("s", gt=0, le=1e4)]
Minutes = Annotated[float, unit("min", gt=0, le=1e5)]
Ratio = Annotated[float, Meta(gt=1, le=20)]
Flights = Annotated[int, Meta(ge=1, le=1000)]


def train(
    course: Annotated[str, course_help(COURSE)],
    /,
    *,
    steps: Annotated[Whole, Help("steps of the environments, over all of them")] = 600_000_000,
    minutes: Annotated[
        Minutes | None, Help("longest training [min]; its learning rate falls in this time")
    ] = None,
    out: Annotated[
        str, Help("FILE.npz of the pilot; a checkpoint and a plot lie beside it")
    ] = "pilots/pilot.npz",
    vehicle: Annotated[str, vehicle_help()] = "swift",
    thrust_to_weight: Annotated[Ratio | None, Help("stronger or weaker propellers")] = None,
    laps: Annotated[Whole | None, Help("laps of a race; default: the course's")] = None,
    seed: Annotated[Seed, Help("random seed")] = 0,
    randomize: Annotated[Size, Help("scale of domain randomization")] = 1.0,
    environments: Annotated[Environments, Help("environments at once")] = 1024,
    hidden: Annotated[Neurons, Help("neurons of each of two hidden layers")] = 64,
    crash: Annotated[Weight, Help("weight of a crash, in metres of progress")] = 1.0,
    time_limit: Annotated[Seconds, Help("longest episode [s]")] = 10.0,
    flights: Annotated[Flights, Help("flights of an evaluation in the second half")] = 16,
    json: Json = False,
) -> int:
    """Learn to fly a course by Proximal Policy Optimization (PPO) of stable-baselines3.

    The training evaluates the pilot twenty times, keeps the best one, and continues from its
    checkpoint after an interruption.

    race train split_s_swift --out pilots/split_s.npz

    race fly split_s_swift --pilot pilots/split_s.npz
    """
    flags = {
        "steps": steps,
        "minutes": minutes,
        "out": out,
        "vehicle": vehicle,
        "thrust-to-weight": thrust_to_weight,
        "laps": laps,
        "seed": seed,
        "randomize": randomize,
        "environments": environments,
        "hidden": hidden,
        "crash": crash,
        "time-limit": time_limit,
        "flights": flights,
    }
    courses = _courses(course)
    with settings_as_flags():
        # imported late, as loading the environments takes a second
        from quadsim.learn.ppo_config import PPOConfig
        from quadsim.learn.task import task
        from quadsim.learn.training import Training

        asked = task(
            courses if len(courses) > 1 else course,
            _vehicle(vehicle, thrust_to_weight),
            start="anywhere",
            randomize=randomize,
            time_limit=time_limit,
            reward={"crash": crash, "clearance": CLEARANCE},
            laps=laps,
        )
    path = _out(out)
    if find_spec("stable_baselines3") is None:
        raise UsageError(needs_extra("stable-baselines3", "train"))
    training = Training(
        task=asked,
        config=PPOConfig(environments=environments, hidden=hidden),
        seed=seed,
        steps=steps,
        out=path,
        flights=flights,
        minutes=minutes,
        command=_command(course, flags),
    )
    history = _learn(training, quiet=json)
    figure = path.with_suffix(".png")
    title = course if len(courses) == 1 else f"{len(courses)} courses"
    _plot(history, figure, f"Learning {title}")
    if json:
        emit_json({"pilot": str(path), "plot": str(figure), "history": history})
    else:
        emit(f"{path}: race fly {courses[0]} --pilot {path}", f"{figure}: how it learnt")
    return 0


def _vehicle(name: str, ratio: float | None) -> Vehicle:
    """Return the vehicle given by the flags. Raises FileError."""
    vehicle = load_vehicle(name)
    return with_thrust_to_weight(vehicle, ratio) if ratio else vehicle


def _courses(given: str) -> list[str]:
    """Return the course names and files; a folder gives its files in order. Raises UsageError."""
    found: list[str] = []
    for name in given.split(","):
        if not Path(name).is_dir():
            found.append(name)
            continue
        files = sorted(map(str, Path(name).glob("*.yaml")))
        if not files:
            raise UsageError(f"course: expected a folder of courses, found no *.yaml in {name!r}")
        found.extend(files)
    return found


def _out(out: str) -> Path:
    """Return the writable path of the pilot's file. Raises UsageError, RunError."""
    path = Path(out)
    if path.suffix != ".npz":
        raise UsageError(f"--out: expected FILE.npz, got {out!r}")
    for file in (path, path.with_suffix(".checkpoint.npz"), path.with_suffix(".png")):
        expect_file(file)
    try_writing(path.parent)
    return path


def _command(course: str, flags: dict[str, Any]) -> str:
    """Return the command line, for the pilot's file."""
    given = [
        f"--{name} {shlex.quote(str(value))}" for name, value in flags.items() if value is not None
    ]
    return " ".join(["race train", shlex.quote(course), *given])


def _learn(training: Training, quiet: bool) -> list[Evaluation]:
    """Train, and return a row for each evaluation.

    Raises UsageError, FileError, KeyboardInterrupt.
    """
    from quadsim.learn.training import train

    try:
        if quiet:
            return train(training)
        with ProgressLine(training.steps) as line:
            return train(training, line.report, line.progress)
    # fewer environments than the courses need
    except SettingError as error:
        raise UsageError(f"--{error.name}: {error.problem}") from None
    except KeyboardInterrupt:
        advice = "the same command continues from the last checkpoint"
        raise KeyboardInterrupt(f"race train: interrupted: {advice}") from None


class ProgressLine:
    """A progress line of a training on a terminal: `with ProgressLine(steps) as line`.

    If stderr is not a terminal, only the evaluations are printed, one line each.

    Args:
        steps: steps of the whole training.
    """

    def __init__(self, steps: int):
        console = progress_console()
        columns = (BarColumn(24), TextColumn("{task.description}"))
        self._bar = Bar(*columns, console=console, transient=True, disable=not console.is_terminal)
        self._task = self._bar.add_task("", total=1.0)
        self._steps = steps

    def __enter__(self) -> ProgressLine:
        self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._bar.stop()

    def progress(self, progress: Progress) -> None:
        """Show the progress of the training."""
        text = progress_text(progress, self._steps)
        self._bar.update(self._task, completed=progress.share, description=text)

    def report(self, row: Evaluation) -> None:
        """Print an evaluation as a permanent line."""
        line = evaluation_text(row)
        if self._bar.disable:
            complain(line)
        else:
            self._bar.console.print(escape(plain(line)), soft_wrap=True)


def progress_text(progress: Progress, steps: int) -> str:
    """Return the steps so far and in total, the steps per second and the remaining time."""
    done = f"{progress.steps / 1e6:.1f} of {steps / 1e6:.1f} M steps"
    left = timedelta(seconds=round(progress.left))
    return f"{done}, {progress.rate / 1e3:.0f} k/s, {left} left"


def evaluation_text(row: Evaluation) -> str:
    """Return an evaluation as one line."""
    lap = f"lap {row['lap']:.3f} s" if row["finished"] else "no lap"
    parts = (
        f"{row['steps'] / 1e6:6.1f} M steps: reward {row['reward']:.2f}/s",
        f"gates {100 * row['gates']:.0f} %",
        f"finished {100 * row['finished']:.0f} %",
        lap,
    )
    return ", ".join(parts)


def _plot(history: Sequence[Evaluation], path: Path, title: str) -> None:
    """Draw the history of a training."""
    from quadsim.figures.learning import draw
    from quadsim.figures.style import save_figure

    save_figure(draw([dict(row) for row in history], title), path)
