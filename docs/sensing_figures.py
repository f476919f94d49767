"""The picture of sensing.md: one lap against noise and against latency, 96 flights, resumed where
it was broken off.

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
from quadsim.campaign.summary_stats import VariantStats
from quadsim.figures.style import STYLE, line
from quadsim.palette import style

FOLDER, DATA = Path(__file__).parent, Path(quadsim.__file__).parent
COURSE, ATTEMPTS = "split_s_swift", 6
SAMPLERS = ("colored", "gaussian")
NOISE = (0.5, 2.0, 6.0, 15.0)  # of corners in a picture [px]
LATENCY = (0.0, 0.02, 0.04, 0.08)  # of commands [s]
ASIDE = 0.012  # of one sampler's points from the other's, a share of the axis


def main() -> None:
    plt.rcParams.update(STYLE | {"figure.dpi": 130, "figure.constrained_layout.use": True})
    figure, axes = plt.subplots(2, 2, figsize=(9.0, 5.0), sharex="col", sharey="row")
    with TemporaryDirectory() as made:
        for i, sampler in enumerate(SAMPLERS):
            noise = flown(sampler, NOISE, lambda v: {"sensing": corner_noise(Path(made), v)})
            latency = flown(sampler, LATENCY, lambda s: {"vehicle": late(Path(made), s)})
            draw(axes[:, 0], i, NOISE, noise, "noise of the corners, gates.yaml [px]")
            draw(
                axes[:, 1],
                i,
                [1e3 * s for s in LATENCY],
                latency,
                "latency of commands, true state [ms]",
            )
    axes[0, 0].set(ylabel="finished [%]", ylim=(-5, 105))
    axes[1, 0].set(ylabel="one lap, median [s]")
    axes[1, 1].legend()
    figure.suptitle(f"{COURSE}, randomized, {ATTEMPTS} flights a point, 95 % intervals")
    figure.savefig(FOLDER / "sensing_curves.png")


def corner_noise(folder: Path, noise: float) -> str:
    """A file like gates.yaml, with another noise [px]."""
    text = (DATA / "sensing/gates.yaml").read_text()
    return written(
        folder / f"corners_{noise:g}px.yaml", text, "  noise: 2 ", f"  noise: {noise:g} "
    )


def late(folder: Path, latency: float) -> str:
    """A vehicle like swift_40ms, with another latency [s]."""
    text = (DATA / "vehicle/swift_40ms.yaml").read_text()
    return written(
        folder / f"swift_{1e3 * latency:g}ms.yaml", text, "latency: 0.04 ", f"latency: {latency:g} "
    )


def written(path: Path, text: str, old: str, new: str) -> str:
    assert old in text, f"{path.name}: expected {old!r}"
    path.write_text(text.replace(old, new))
    return str(path)


def flown(
    sampler: str, values: Sequence[float], settings: Callable[[float], dict[str, Any]]
) -> list[VariantStats]:
    campaign = Path("campaigns/sensing_curves.sqlite")
    variants = {f"{v:g}": settings(v) for v in values}
    fixed = {
        "sampler": sampler,
        "laps": 1,
        "randomize": 1.0,
        "attempts": ATTEMPTS,
        "jobs": 2,
        "campaign": campaign,
    }
    return list(quadsim.compare(COURSE, variants, **fixed).variants)


def draw(axes: Any, i: int, values: Sequence[float], stats: list[VariantStats], label: str) -> None:
    x = np.array(values) + i * ASIDE * max(values)
    share = 100 * np.array([s.finished / s.attempts for s in stats])
    low, high = 100 * np.array([s.success_ci for s in stats]).T
    look = {"marker": "o"} | line(style(SAMPLERS[i]))
    axes[0].errorbar(x, share, (share - low, high - share), capsize=3, **look)
    axes[1].plot(x, [s.race_median for s in stats], label=SAMPLERS[i], **look)
    axes[1].set_xlabel(label)


if __name__ == "__main__":
    main()
