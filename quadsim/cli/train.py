"""`race train`: learn a pilot for a course, with evaluation in the simulator and a plot."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from msgspec import Meta

from quadsim.cli.flags import Help, Json, course_help, settings_as_flags, vehicle_help
from quadsim.console import UsageError, complain, emit, emit_json
from quadsim.files.extras import needs_extra
from quadsim.files.strict_yaml import unit
from quadsim.record.whole_files import expect_file, try_writing
from quadsim.spec.settings import SettingError

if TYPE_CHECKING:
    from quadsim.learn.checkpoint import Evaluation
    from quadsim.learn.task import LearningTask

# weight of the margin in gates: twice the environments' own, as a pilot does not see a gust coming
CLEARANCE = 5.0

COURSE = "a name (see `race courses`), a FILE.yaml or a folder of them; several joined by commas"
Whole = Annotated[int, Meta(ge=1, le=10**12)]
Seed = Annotated[int, Meta(ge=0, le=10**9)]
Size = Annotated[float, Meta(ge=0, le=3)]
Environments = Annotated[int, Meta(ge=1, le=10**6)]
Neurons = Annotated[int, Meta(ge=1, le=4096)]
Weight = Annotated[float, Meta(ge=0, le=1e6)]
Seconds = Annotated[float, unit("s", gt=0, le=1e4)]
Flights = Annotated[int, Meta(ge=1, le=1000)]


def train(
    course: Annotated[str, course_help(COURSE)],
    /,
    *,
    steps: Annotated[Whole, Help("steps of the environments, over all of them")] = 200_000_000,
    out: Annotated[
        str, Help("FILE.npz of the pilot; a checkpoint and a plot lie beside it")
    ] = "pilots/pilot.npz",
    vehicle: Annotated[str, vehicle_help()] = "swift",
    laps: Annotated[Whole | None, Help("laps of a race; default: the course's")] = None,
    seed: Annotated[Seed, Help("random seed")] = 0,
    randomize: Annotated[Size, Help("scale of domain randomization")] = 1.0,
    environments: Annotated[Environments, Help("environments at once")] = 1024,
    hidden: Annotated[Neurons, Help("neurons of each of two hidden layers")] = 64,
    crash: Annotated[Weight, Help("weight of a crash, in metres of progress")] = 10.0,
    time_limit: Annotated[Seconds, Help("longest episode [s]")] = 10.0,
    flights: Annotated[Flights, Help("flights of each evaluation")] = 8,
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
        "out": out,
        "vehicle": vehicle,
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
        # not before: loading the environments takes a second
        from quadsim.learn.task import task

        asked = task(
            courses if len(courses) > 1 else course,
            vehicle,
            start="anywhere",
            randomize=randomize,
            time_limit=time_limit,
            reward={"crash": crash, "clearance": CLEARANCE},
            laps=laps,
        )
    path = _out(out)
    if find_spec("stable_baselines3") is None:
        raise UsageError(needs_extra("stable-baselines3", "train"))
    command = _command(course, flags)
    sizes = {"environments": environments, "hidden": hidden}
    history = _learn(asked, sizes, seed, steps, path, flights, command, quiet=json)
    figure = path.with_suffix(".png")
    title = course if len(courses) == 1 else f"{len(courses)} courses"
    _plot(history, figure, f"Learning {title}")
    if json:
        emit_json({"pilot": str(path), "plot": str(figure), "history": history})
    else:
        emit(f"{path}: race fly {courses[0]} --pilot {path}", f"{figure}: how it learnt")
    return 0


def _courses(given: str) -> list[str]:
    """Return the names and files that are meant, those of a folder in order. Raises UsageError."""
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
    """Return the path of the pilot's file, where it can be written. Raises UsageError, RunError."""
    path = Path(out)
    if path.suffix != ".npz":
        raise UsageError(f"--out: expected FILE.npz, got {out!r}")
    for file in (path, path.with_suffix(".checkpoint.npz"), path.with_suffix(".png")):
        expect_file(file)
    try_writing(path.parent)
    return path


def _command(course: str, flags: dict[str, Any]) -> str:
    """Return the command line that was given, for the pilot's file."""
    given = [
        f"--{name} {shlex.quote(str(value))}" for name, value in flags.items() if value is not None
    ]
    return " ".join(["race train", shlex.quote(course), *given])


def _learn(
    task: LearningTask,
    sizes: dict[str, int],
    seed: int,
    steps: int,
    out: Path,
    flights: int,
    command: str,
    quiet: bool,
) -> list[Evaluation]:
    """Return a row for each evaluation. Raises UsageError, FileError, KeyboardInterrupt."""
    from quadsim.learn.ppo_config import PPOConfig
    from quadsim.learn.training import Training, train

    training = Training(
        task=task,
        config=PPOConfig(environments=sizes["environments"], hidden=sizes["hidden"]),
        seed=seed,
        steps=steps,
        out=out,
        flights=flights,
        command=command,
    )
    try:
        return train(training, report=_pass if quiet else _report)
    # fewer environments than the courses need
    except SettingError as error:
        raise UsageError(f"--{error.name}: {error.problem}") from None
    except KeyboardInterrupt:
        advice = "the same command continues from the last checkpoint"
        raise KeyboardInterrupt(f"race train: interrupted: {advice}") from None


def _pass(row: Evaluation) -> None:
    """Report nothing of an evaluation."""


def _report(row: Evaluation) -> None:
    """Report an evaluation in one line on standard error."""
    lap = f"lap {row['lap']:.3f} s" if row["finished"] else "no lap"
    parts = (
        f"{row['steps'] / 1e6:6.1f} M steps: reward {row['reward']:.2f}/s",
        f"gates {100 * row['gates']:.0f} %",
        f"finished {100 * row['finished']:.0f} %",
        lap,
    )
    complain(", ".join(parts))


def _plot(history: Sequence[Evaluation], path: Path, title: str) -> None:
    """Draw how the pilot learnt."""
    from quadsim.figures.learning import draw
    from quadsim.figures.style import save_figure

    save_figure(draw([dict(row) for row in history], title), path)
