"""The picture of sensing.md: one lap against noise and against latency, 48 flights, resumed where it was broken off.

.venv/bin/python docs/sensing_figures.py
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

import quadsim
from quadsim.app.campaign.summary_stats import VariantStats
from quadsim.app.figures.style import STYLE
from quadsim.palette import style

FOLDER, DATA = Path(__file__).parent, Path(quadsim.__file__).parent
COURSE, ATTEMPTS = "split_s_swift", 6
NOISE = (0.0, 0.1, 0.3, 1.0)  # of the velocity [m/s]
LATENCY = (0.0, 0.02, 0.04, 0.08)  # of commands [s]


def main() -> None:
    plt.rcParams.update(STYLE | {"figure.dpi": 130, "figure.constrained_layout.use": True})
    figure, axes = plt.subplots(2, 2, figsize=(9.0, 5.0), sharex="col", sharey="row")
    with TemporaryDirectory() as made:
        noise = flown(NOISE, lambda v: {"sensing": velocity_noise(Path(made), v)})
        latency = flown(LATENCY, lambda s: {"vehicle": late(Path(made), s)})
    draw(axes[:, 0], NOISE, noise, "noise of the velocity [m/s]")
    draw(axes[:, 1], [1e3 * s for s in LATENCY], latency, "latency of commands [ms]")
    axes[0, 0].set(ylabel="finished [%]", ylim=(-5, 105))
    axes[1, 0].set(ylabel="one lap, median [s]")
    figure.suptitle(f"{COURSE}, colored sampling, randomized, {ATTEMPTS} flights a point, 95 % intervals")
    figure.savefig(FOLDER / "sensing_curves.png")


def velocity_noise(folder: Path, noise: float) -> str:
    """A file like velocity.yaml, with another noise [m/s]."""
    text = (DATA / "sensing/velocity.yaml").read_text()
    return written(folder / f"velocity_{noise:g}.yaml", text, "velocity_noise: 0.1", f"velocity_noise: {noise:g}")


def late(folder: Path, latency: float) -> str:
    """A vehicle like swift_40ms, with another latency [s]."""
    text = (DATA / "vehicle/swift_40ms.yaml").read_text()
    return written(folder / f"swift_{1e3 * latency:g}ms.yaml", text, "latency: 0.04 ", f"latency: {latency:g} ")


def written(path: Path, text: str, old: str, new: str) -> str:
    assert old in text, f"{path.name}: expected {old!r}"
    path.write_text(text.replace(old, new))
    return str(path)


def flown(values: Sequence[float], settings: Callable[[float], dict[str, Any]]) -> list[VariantStats]:
    campaign = Path("campaigns/sensing_curves.sqlite")
    variants = {f"{v:g}": settings(v) for v in values}
    fixed = {"laps": 1, "randomize": 1.0, "attempts": ATTEMPTS, "jobs": 2, "campaign": campaign}
    return list(quadsim.compare(COURSE, variants, **fixed).variants)


def draw(axes: Any, x: Sequence[float], stats: list[VariantStats], label: str) -> None:
    share = 100 * np.array([s.finished / s.attempts for s in stats])
    low, high = 100 * np.array([s.success_ci for s in stats]).T
    colour = style("colored").colour
    axes[0].errorbar(x, share, (share - low, high - share), marker="o", color=colour, capsize=3)
    axes[1].plot(x, [s.race_median for s in stats], marker="o", color=colour)
    axes[1].set_xlabel(label)


if __name__ == "__main__":
    main()
