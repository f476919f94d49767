"""`race train`: learn a pilot for a course, with evaluation in the simulator, checkpoints and a
plot."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from quadsim.cli.flags import Help, Json, settings_as_flags
from quadsim.console import UsageError, complain, emit, emit_json
from quadsim.files.strict_yaml import unit
from quadsim.record.whole_files import expect_file, expect_writable
from quadsim.spec.settings import SettingError

# weight of the margin in gates: twice the environments' own, as a pilot does not see a gust coming
CLEARANCE = 5.0

Whole = Annotated[int, Meta(ge=1, le=10**12)]


def train(
    course: Annotated[
        str,
        Help(
            "a name (see `race courses`), a FILE.yaml or a folder of them; several joined by commas"
        ),
    ],
    /,
    *,
    steps: Annotated[Whole, Help("steps of the environments, over all of them")] = 200_000_000,
    out: Annotated[
        str, Help("FILE.npz of the pilot; a checkpoint and a plot lie beside it")
    ] = "pilots/pilot.npz",
    vehicle: Annotated[str, Help("a name or a FILE.yaml")] = "swift",
    laps: Annotated[Whole | None, Help("laps of a race; default: the course's")] = None,
    seed: Annotated[Annotated[int, Meta(ge=0, le=10**9)], Help("random seed")] = 0,
    randomize: Annotated[
        Annotated[float, Meta(ge=0, le=3)], Help("scale of domain randomization")
    ] = 1.0,
    environments: Annotated[
        Annotated[int, Meta(ge=1, le=10**6)], Help("environments at once")
    ] = 1024,
    hidden: Annotated[
        Annotated[int, Meta(ge=1, le=4096)], Help("neurons of each of two hidden layers")
    ] = 64,
    crash: Annotated[
        Annotated[float, Meta(ge=0, le=1e6)], Help("weight of a crash, in metres of progress")
    ] = 10.0,
    time_limit: Annotated[
        Annotated[float, unit("s", gt=0, le=1e4)], Help("longest episode [s]")
    ] = 10.0,
    flights: Annotated[Annotated[int, Meta(ge=1, le=1000)], Help("flights of each evaluation")] = 8,
    json: Json = False,
) -> int:
    """Learn to fly a course by Proximal Policy Optimization (PPO) on the compiled environments.

    Evaluates twenty times on the way, keeps the best pilot, and goes on from its checkpoint after
    an interruption.

    race train split_s_swift --out pilots/split_s.npz

    race fly split_s_swift --pilot pilots/split_s.npz
    """
    weights = {"crash": crash, "clearance": CLEARANCE}
    of_task = {
        "start": "anywhere",
        "randomize": randomize,
        "time_limit": time_limit,
        "reward": weights,
        "laps": laps,
    }
    said = {
        "steps": steps,
        "out": out,
        "vehicle": vehicle,
        "seed": seed,
        "randomize": randomize,
        "crash": crash,
    }
    said |= {
        "environments": environments,
        "hidden": hidden,
        "time-limit": time_limit,
        "flights": flights,
    }
    command = " ".join(
        [
            "race train",
            shlex.quote(course),
            *(f"--{k} {shlex.quote(str(v))}" for k, v in said.items()),
        ]
    )
    path, several = _out(out), _courses(course)
    asked = _task(several if len(several) > 1 else course, vehicle, of_task)
    size = {"environments": environments, "hidden": hidden}
    history = _learn(asked, size, seed, steps, path, flights, command, quiet=json)
    figure = path.with_suffix(".png")
    _plot(history, figure, course if len(several) == 1 else f"{len(several)} courses")
    if json:
        emit_json({"pilot": str(path), "plot": str(figure), "history": history})
    else:
        emit(f"{path}: race fly {several[0]} --pilot {path}", f"{figure}: how it learnt")
    return 0


def _courses(given: str) -> list[str]:
    """The names and files that are meant; those of a folder in order. Raises UsageError."""
    found: list[str] = []
    for one in given.split(","):
        files = sorted(map(str, Path(one).glob("*.yaml"))) if Path(one).is_dir() else [one]
        if not files:
            raise UsageError(f"course: expected a folder of courses, found no *.yaml in {one!r}")
        found += files
    return found


def _out(out: str) -> Path:
    """Where the pilot is written; its folder is made. Raises UsageError, RunError."""
    path = Path(out)
    if path.suffix != ".npz":
        raise UsageError(f"--out: expected FILE.npz, got {out!r}")
    expect_file(path)
    expect_writable(path.parent)
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def _task(course: str | list[str], vehicle: str, settings: dict[str, Any]) -> Any:
    from quadsim.learn.task import task

    with settings_as_flags():
        return task(course, vehicle, **settings)


def _learn(
    task: Any,
    size: dict[str, int],
    seed: int,
    steps: int,
    out: Path,
    flights: int,
    command: str,
    quiet: bool,
) -> list[dict]:
    """What each evaluation saw."""
    from quadsim.learn.ppo import PPOConfig
    from quadsim.learn.training import Training, train

    try:
        asked = Training(
            task,
            PPOConfig(environments=size["environments"], hidden=size["hidden"]),
            seed,
            steps,
            out,
            flights=flights,
            command=command,
        )
        return train(asked, (lambda row: None) if quiet else _say)
    except SettingError as error:  # fewer environments than courses need
        raise UsageError(f"--{error.name}: {error.problem}") from None
    except KeyboardInterrupt:
        raise KeyboardInterrupt(
            "race train: interrupted: the same command goes on from the last checkpoint"
        ) from None


def _say(row: dict) -> None:
    lap = f"lap {row['lap']:.3f} s" if row["finished"] else "no lap"
    reward, steps = row["reward"], row["steps"] / 1e6
    gates, finished = 100 * row["gates"], 100 * row["finished"]
    complain(
        f"{steps:6.1f} M steps: reward {reward:.2f}/s, gates {gates:.0f} %, finished {finished:.0f} %, {lap}"
    )


def _plot(history: list[dict], path: Path, course: str) -> None:
    from quadsim.figures.learning import draw
    from quadsim.figures.style import save_figure

    save_figure(draw(history, f"Learning {course}"), path)
