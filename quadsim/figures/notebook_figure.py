"""A figure that a notebook displays as a picture."""

from __future__ import annotations

from io import BytesIO

from matplotlib.figure import Figure

DPI = 72  # resolution of the picture in a notebook, which is as wide as a cell


class NotebookFigure(Figure):
    """A matplotlib Figure that a notebook displays without an import of pyplot."""

    def _repr_png_(self) -> bytes:
        """Return the picture, for IPython."""
        data = BytesIO()
        self.savefig(data, format="png", dpi=DPI)
        return data.getvalue()
