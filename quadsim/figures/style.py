"""What all figures share: matplotlib's settings, the palette as matplotlib takes it, and how they
are written."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from quadsim.palette import GRID, Style
from quadsim.record.whole_files import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure  # a command's --help does not wait for matplotlib

FORMATS = ("png", "svg")  # written unless a file is named
PICTURES = (".png", ".svg", ".pdf")
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
    "svg.hashsalt": "quadsim",  # the same run gives the same file
}


def line(s: Style) -> dict[str, Any]:
    """Arguments of `plot`: colour and line style. Dense signals take the colour alone: gaps would
    look like chatter."""
    return {"color": s.colour, "linestyle": (0, s.dash) if s.dash else "-"}


def write_figure(figure: Figure, folder: Path, stem: str) -> tuple[Path, ...]:
    """PNG and SVG. Raises RunError where the folder cannot be written."""
    return tuple(save_figure(figure, folder / f"{stem}.{kind}") for kind in FORMATS)


def save_figure(figure: Figure, path: Path) -> Path:
    """In the format that the path's end names. Raises RunError; ValueError for a format that
    matplotlib lacks."""
    data = BytesIO()
    figure.savefig(data, format=path.suffix[1:] or FORMATS[0])
    write_whole(path, data.getvalue())
    return path
