"""A figure of a training: reward, gates passed and lap times over the steps."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure


def draw(history: Sequence[dict], title: str) -> Figure:
    """Return the plot of a training.

    Args:
        history: rows of quadsim.learn.training.train.
        title: title of the figure.
    """
    steps = [row["steps"] / 1e6 for row in history]
    # without a finished race there is no lap time to draw
    laps = [row["lap"] or float("nan") for row in history]
    figure = Figure(figsize=(7.0, 6.0), layout="constrained")
    above, middle, below = figure.subplots(3, 1, sharex=True)

    above.plot(steps, [row["reward"] for row in history], ".-")
    above.set(ylabel="reward [1/s]", title=title)

    middle.plot(steps, [row["gates"] for row in history], ".-", label="gates passed")
    middle.plot(steps, [row["finished"] for row in history], ".-", label="races finished")
    middle.set(ylabel="share in the simulator", ylim=(-0.05, 1.05))
    middle.legend(loc="best", frameon=False)

    below.plot(steps, laps, ".-")
    below.set(ylabel="lap of finished races [s]", xlabel="steps of the environments [million]")
    for axes in (above, middle, below):
        axes.grid(alpha=0.3)
    return figure
