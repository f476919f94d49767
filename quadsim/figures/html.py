"""HTML for notebooks: tables and pictures without a style sheet. All text is escaped."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Collection, Iterable, Sequence
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

from quadsim.console import plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CELL = "padding:2px 10px 2px 0;vertical-align:top"


def text(value: object) -> str:
    """Return the text of a value as escaped HTML."""
    return escape(plain(str(value)), quote=True)


def paragraph(value: object) -> str:
    """Return a paragraph of plain text."""
    return f"<p>{text(value)}</p>"


def facts(rows: Iterable[tuple[str, str]]) -> str:
    """Return a table of names and values, both plain text."""
    return table((), rows, texts=(0, 1))


def table(head: Sequence[str], rows: Iterable[Sequence[str]], texts: Collection[int] = (0,)) -> str:
    """Return a table of plain text.

    Args:
        head: headings of the columns; none for a table without a head.
        rows: cells of each row.
        texts: indices of the text columns; the other columns hold numbers and are aligned right.
    """
    lines = [_row("th", head, texts)] if head else []
    lines += [_row("td", row, texts) for row in rows]
    look = "border-collapse:collapse;margin:6px 0;font-variant-numeric:tabular-nums"
    return f'<table style="{look}">{"".join(lines)}</table>'


def _row(tag: str, cells: Sequence[str], texts: Collection[int]) -> str:
    row = ""
    for column, cell in enumerate(cells):
        side = "left" if column in texts else "right"
        row += f'<{tag} style="{CELL};text-align:{side}">{text(cell)}</{tag}>'
    return f"<tr>{row}</tr>"


def image(figure: Figure, described: str) -> str:
    """Return a figure as a PNG within the HTML.

    Args:
        figure: a matplotlib Figure. It is drawn without pyplot, so that the notebook's own figures
            stay as they are.
        described: description of the picture for screen readers.
    """
    data = BytesIO()
    figure.savefig(data, format="png")
    encoded = b64encode(data.getvalue()).decode()
    source = f"data:image/png;base64,{encoded}"
    return f'<img src="{source}" alt="{text(described)}" style="max-width:100%">'


def block(*parts: str) -> str:
    """Return pieces of HTML, stacked vertically."""
    return f"<div>{''.join(parts)}</div>"
