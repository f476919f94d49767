"""A training as a picture: reward, gates passed and laps finished over the steps flown."""

from __future__ import annotations

from matplotlib.figure import Figure

from quadsim.learn.training import rows_of


def draw(history: list[dict], title: str) -> Figure:
    """history: of quadsim.learn.training.train."""
    steps, reward, finished, lap, gates = zip(*rows_of(history), strict=True)
    figure = Figure(figsize=(7.0, 6.0), layout="constrained")
    above, middle, below = figure.subplots(3, 1, sharex=True)
    above.plot(steps, reward, ".-")
    above.set(ylabel="reward [1/s]", title=title)
    middle.plot(steps, gates, ".-", label="gates passed")
    middle.plot(steps, finished, ".-", label="races finished")
    middle.set(ylabel="share in the simulator", ylim=(-0.05, 1.05))
    middle.legend(loc="best", frameon=False)
    below.plot(steps, lap, ".-")
    below.set(ylabel="lap of finished races [s]", xlabel="steps of the environments [million]")
    for axes in (above, middle, below):
        axes.grid(alpha=0.3)
    return figure
