"""The picture of sensing.md: one lap against noise and against latency.

It takes 96 flights, and continues where it was interrupted:

    .venv/bin/python docs/sensing_figures.py
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

import quadsim
from quadsim.campaign.summary_stats import VariantStats
from quadsim.figures.style import STYLE, line
from quadsim.palette import style

FOLDER = Path(__file__).parent
DATA = Path(quadsim.__file__).parent
COURSE = "split_s_swift"
ATTEMPTS = 6
SAMPLERS = ("colored", "gaussian")
# of corners in a picture [px]
NOISE = (0.5, 2.0, 6.0, 15.0)
# of commands [s]
LATENCY = (0.0, 0.02, 0.04, 0.08)
# distance of one sampler's points from the other's, a share of the axis
ASIDE = 0.012


def main() -> None:
    """Fly and draw the picture."""
    plt.rcParams.update(STYLE | {"figure.dpi": 130, "figure.constrained_layout.use": True})
    figure, axes = plt.subplots(2, 2, figsize=(9.0, 5.0), sharex="col", sharey="row")
    with TemporaryDirectory() as made:
        for i, sampler in enumerate(SAMPLERS):
            noisy = {f"{px:g}": {"sensing": corner_noise(Path(made), px)} for px in NOISE}
            draw(axes[:, 0], i, NOISE, fly(sampler, noisy))
            delayed = {f"{s:g}": {"vehicle": late(Path(made), s)} for s in LATENCY}
            draw(axes[:, 1], i, [1e3 * s for s in LATENCY], fly(sampler, delayed))
    axes[1, 0].set_xlabel("noise of the corners, gates.yaml [px]")
    axes[1, 1].set_xlabel("latency of commands, true state [ms]")
    axes[0, 0].set(ylabel="finished [%]", ylim=(-5, 105))
    axes[1, 0].set(ylabel="one lap, median [s]")
    axes[1, 1].legend()
    figure.suptitle(f"{COURSE}, randomized, {ATTEMPTS} flights a point, 95 % intervals")
    figure.savefig(FOLDER / "sensing_curves.png")


def corner_noise(folder: Path, noise: float) -> str:
    """Write a file like gates.yaml, with another noise [px], and return its path."""
    text = (DATA / "sensing/gates.yaml").read_text()
    path = folder / f"corners_{noise:g}px.yaml"
    return write(path, text, "  noise: 2 ", f"  noise: {noise:g} ")


def late(folder: Path, latency: float) -> str:
    """Write a vehicle like swift_40ms, with another latency [s], and return its path."""
    text = (DATA / "vehicle/swift_40ms.yaml").read_text()
    path = folder / f"swift_{1e3 * latency:g}ms.yaml"
    return write(path, text, "latency: 0.04 ", f"latency: {latency:g} ")


def write(path: Path, text: str, old: str, new: str) -> str:
    """Write a text with one piece replaced, and return the path."""
    assert old in text, f"{path.name}: expected {old!r}"
    path.write_text(text.replace(old, new))
    return str(path)


def fly(sampler: str, variants: dict[str, dict[str, Any]]) -> list[VariantStats]:
    """Fly variants of settings, by name, and return their statistics."""
    campaign = Path("campaigns/sensing_curves.sqlite")
    fixed = {
        "sampler": sampler,
        "laps": 1,
        "randomize": 1.0,
        "attempts": ATTEMPTS,
        "jobs": 2,
        "campaign": campaign,
    }
    return list(quadsim.compare(COURSE, variants, **fixed).variants)


def draw(axes: Any, i: int, values: Sequence[float], stats: list[VariantStats]) -> None:
    """Draw the share finished and the median lap of one sampler, of index i."""
    x = np.array(values) + i * ASIDE * max(values)
    share = 100 * np.array([s.finished / s.attempts for s in stats])
    low, high = 100 * np.array([s.success_ci for s in stats]).T
    look = {"marker": "o"} | line(style(SAMPLERS[i]))
    axes[0].errorbar(x, share, (share - low, high - share), capsize=3, **look)
    axes[1].plot(x, [s.race_median for s in stats], label=SAMPLERS[i], **look)


if __name__ == "__main__":
    main()
