"""What all figures share: matplotlib's settings, and the palette in matplotlib's words."""

from __future__ import annotations

from typing import Any

from quadsim.palette import GRID, Style

STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "svg.hashsalt": "quadsim",  # the same run, the same file
}


def line(s: Style) -> dict[str, Any]:
    """Colour and line style of `plot`. Dense signals take the colour alone: gaps would look like chatter."""
    return {"color": s.colour, "linestyle": (0, s.dash) if s.dash else "-"}
