"""Train the network that finds gates: fly courses, render pictures, train, write the file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

from quadsim.learn.gate_network import Network, NetworkTraining, trained
from quadsim.learn.gate_pictures import (
    HELD_OUT,
    RANDOM_COURSES,
    TRAINED_ON,
    draw_pictures,
    grounds,
)
from quadsim.learn.onnx_file import onnx_bytes
from quadsim.record.provenance import git_commit
from quadsim.record.whole_files import write_whole
from quadsim.sensing import load_sensing

# number of times that the network is written
WRITTEN = 10
# share of the training's time in which pictures are drawn, for its progress
DRAWN = 0.2


class NetworkProgress(NamedTuple):
    """The progress of a training."""

    share: float
    # 0: pictures are drawn
    step: int
    text: str


def train_network(
    path: Path,
    count: int,
    numbers: NetworkTraining,
    seed: int,
    command: str,
    show: Callable[[NetworkProgress], None] = lambda progress: None,
) -> dict[str, str]:
    """Train a network, write its file, and return the metadata in the file.

    Args:
        path: the file to write.
        count: number of pictures.
        numbers: steps, batches, learning rate.
        seed: seed of flights, pictures, weights and steps.
        command: command line, for the metadata.
        show: function that is called with the progress.

    Raises:
        RunError: the file cannot be written.
    """
    camera = load_sensing("pixels").pixels
    assert camera
    show(NetworkProgress(0.0, 0, "flying the courses"))
    places = grounds(seed)
    pictures = draw_pictures(
        places,
        camera,
        count,
        seed,
        lambda share: show(NetworkProgress(DRAWN * share, 0, f"{share:.0%} of the pictures")),
    )
    about = {
        "command": command,
        "commit": git_commit() or "unknown",
        "seed": str(seed),
        "courses": f"{', '.join(TRAINED_ON)} and {RANDOM_COURSES} random ones",
        "held out": ", ".join(HELD_OUT),
        "pictures": str(count),
        "numbers": str(asdict(numbers)),
    }

    def report(network: Network, step: int, losses: tuple[float, ...]) -> None:
        text = "heat {:.3f}, place {:.3f}, centre {:.3f}".format(*losses)
        about.update({"steps": str(step), "losses": text})
        if step * WRITTEN % numbers.steps < WRITTEN * max(numbers.steps // 100, 1):
            write_whole(path, onnx_bytes(network, about))
        share = DRAWN + (1.0 - DRAWN) * step / numbers.steps
        show(NetworkProgress(share, step, f"{step} of {numbers.steps} steps: {text}"))

    write_whole(path, onnx_bytes(trained(pictures, numbers, seed, report), about))
    return about
