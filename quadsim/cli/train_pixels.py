"""`race train-pixels`: train the network that finds gates in pictures."""

from __future__ import annotations

import shlex
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from msgspec import Meta
from rich.progress import BarColumn, TextColumn
from rich.progress import Progress as Bar

from quadsim.cli.flags import Help, Json, Switch
from quadsim.console import UsageError, complain, emit, emit_json, progress_console
from quadsim.files.extras import needs_extra
from quadsim.record.whole_files import expect_file, try_writing

if TYPE_CHECKING:
    from quadsim.learn.network_training import NetworkProgress

Seed = Annotated[int, Meta(ge=0, le=10**9)]
Pictures = Annotated[int, Meta(ge=16, le=10**6)]
Steps = Annotated[int, Meta(ge=1, le=10**7)]


def train_pixels(
    *,
    out: Annotated[str, Help("FILE.onnx of the network")] = "gates.onnx",
    pictures: Annotated[Pictures, Help("pictures to draw, of 0.2 MB of memory each")] = 6000,
    steps: Annotated[Steps, Help("steps of the training, of up to 16 pictures each")] = 6000,
    seed: Annotated[Seed, Help("random seed of pictures, weights and steps")] = 0,
    float32: Annotated[
        bool, Switch("no bfloat16, which only newer processors multiply fast")
    ] = False,
    json: Json = False,
) -> int:
    """Train the network that finds gates in pictures, for the sensor `pixels` of a sensing file.

    The command flies the courses to learn from, draws pictures of them and of random courses, and
    trains on one core of the processor. The file is written ten times, and holds what made it.

    race train-pixels --out mine.onnx
    """
    path = Path(out)
    if path.suffix != ".onnx":
        raise UsageError(f"--out: expected FILE.onnx, got {out!r}")
    expect_file(path)
    try_writing(path.parent)
    for package in ("torch", "onnx"):
        if find_spec(package) is None:
            raise UsageError(needs_extra(package, "train"))
    # imported late, as PyTorch takes seconds
    from quadsim.learn.gate_network import NetworkTraining
    from quadsim.learn.network_training import train_network

    flags = f"--pictures {pictures} --steps {steps} --seed {seed}"
    command = f"race train-pixels --out {shlex.quote(out)} {flags}{' --float32' * float32}"
    numbers = NetworkTraining(steps=steps, bfloat16=not float32)
    with Line(quiet=json) as line:
        about = train_network(path, pictures, numbers, seed, command, line.show)
    if json:
        emit_json({"network": str(path), **about})
    else:
        emit(f"{path}: after {about['steps']} steps, losses {about['losses']}")
    return 0


class Line:
    """A progress line on a terminal; elsewhere a line for each hundredth of the steps.

    Args:
        quiet: show nothing.
    """

    def __init__(self, quiet: bool):
        console = progress_console()
        columns = (BarColumn(24), TextColumn("{task.description}"))
        self._bar = Bar(*columns, console=console, disable=quiet or not console.is_terminal)
        self._task = self._bar.add_task("", total=1.0)
        self._lines = not quiet and not console.is_terminal

    def __enter__(self) -> Line:
        self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._bar.stop()

    def show(self, progress: NetworkProgress) -> None:
        """Show how far the training is."""
        if self._lines and progress.step:
            complain(progress.text)
        self._bar.update(self._task, completed=progress.share, description=progress.text)
