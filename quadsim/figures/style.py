"""The common style of all figures, matplotlib's settings and lines, and their output to files."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from quadsim.palette import GRID, Style
from quadsim.record.whole_files import write_whole

if TYPE_CHECKING:
    # Imported late, so that a command's --help does not load matplotlib
    from matplotlib.figure import Figure

# Default formats, and all accepted formats
FORMATS = ("png", "svg")
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
    # Fixed values, so that the same run gives the same file
    "svg.hashsalt": "quadsim",
}


def line(s: Style) -> dict[str, Any]:
    """Return the arguments of `plot` for a style: colour and line style.

    Dense signals use only the colour, because gaps of a line would look like chatter.
    """
    return {"color": s.colour, "linestyle": (0, s.dash) if s.dash else "-"}


def write_figure(figure: Figure, folder: Path, stem: str) -> tuple[Path, ...]:
    """Write a figure as PNG and SVG, and return the paths of the files.

    Raises:
        RunError: the folder cannot be written.
    """
    return tuple(save_figure(figure, folder / f"{stem}.{kind}") for kind in FORMATS)


def save_figure(figure: Figure, path: Path) -> Path:
    """Write a figure in the format of the path's suffix, and return the path.

    Raises:
        RunError: the file cannot be written.
        ValueError: matplotlib lacks the format.
    """
    data = BytesIO()
    figure.savefig(data, format=path.suffix[1:] or FORMATS[0])
    write_whole(path, data.getvalue())
    return path
