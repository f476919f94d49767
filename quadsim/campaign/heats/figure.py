"""The figure of races under several settings: one row for each setting, with 95 % intervals."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quadsim.campaign.heats.paired import FlownHeats
from quadsim.figures.notebook_figure import NotebookFigure
from quadsim.figures.style import STYLE
from quadsim.palette import Style, styles
from quadsim.statistics import Mean


def draw_heats(flown: Sequence[FlownHeats], title: str) -> Figure:
    """Draw how often flights finish, how often they collide and overtake, and their times.

    Args:
        flown: the races of each setting.
        title: title of the figure.
    """
    summaries = [one.summary for one in flown]
    looks = styles([one.name for one in flown])
    with rc_context(STYLE):
        figure = NotebookFigure(
            figsize=(14, 1.6 + 0.55 * len(flown)), dpi=110, layout="constrained"
        )
        finished, contacts, overtakes, times = figure.subplots(1, 4, sharey=True)
        for y, (found, look) in enumerate(zip(summaries, looks, strict=True)):
            _draw_share(finished, y, found.finished, found.flights, found.finished_ci, look)
            _draw_share(contacts, y, found.with_contact, found.races, found.contact_ci, look)
            _draw_mean(overtakes, y, found.overtakes, look, digits=1)
            _draw_mean(times, y, found.race, look, digits=2)
        finished.set(xlim=(0, 103), title="flights that finished [%]")
        contacts.set(xlim=(0, 103), title="races with a contact [%]")
        overtakes.set_title("overtakes in a race")
        times.set_title("race time of those that finished [s]")
        for axes in (finished, contacts, overtakes, times):
            axes.grid(visible=False, axis="y")
            axes.tick_params(axis="y", length=0)
            axes.margins(x=0.15)
        # The first row is at the top.
        names = [one.name for one in flown]
        finished.set(yticks=range(len(names)), yticklabels=names, ylim=(len(names) - 0.4, -0.6))
        figure.suptitle(title, x=0.008, ha="left", fontsize=11)
    return figure


def _draw_share(
    axes: Axes, y: float, count: int, of: int, interval: tuple[float, float], look: Style
) -> None:
    """Draw a share as a bar, with its interval and both numbers."""
    low, high = interval
    axes.barh(y, 100 * count / of, height=0.4, color=look.colour, alpha=0.75)
    axes.plot([100 * low, 100 * high], [y, y], color="black", linewidth=1.6)
    axes.text(1, y - 0.36, f"{count} of {of}", va="center", fontsize=9)


def _draw_mean(axes: Axes, y: float, mean: Mean, look: Style, digits: int) -> None:
    """Draw a mean with its interval and its number."""
    if mean.n == 0:
        return
    if mean.n > 1:
        axes.plot([mean.low, mean.high], [y, y], color="black", linewidth=1.6)
    axes.plot(mean.mean, y, "D", color=look.colour, markersize=7)
    axes.annotate(
        f"{mean.mean:.{digits}f}", (mean.mean, y - 0.2), ha="center", va="bottom", fontsize=9
    )
