"""Small pieces of HTML. Every name that comes from a file goes through `text`."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from quadsim.palette import Style
from quadsim.web.competitor import Competitor

DIM = "#9aa3b2"  # secondary text
MARKER_EDGE = "#111"  # outlines of dots
TRACK = "#2c3038"  # background of bars and strips
RED = "#ff6b6b"  # hits and crashes, as light as text on a dark page has to be
GREY = "#e2e6ec"  # values that are neither good nor bad
TEXT = "12px"  # the smallest size of a text
MONOSPACE = "ui-monospace,Menlo,Consolas,monospace"
MONO = {"font_family": MONOSPACE, "font_variant_numeric": "tabular-nums"}


def text(value: object) -> str:
    """Return a value as escaped text."""
    return escape(str(value), quote=True)


def rounded(value: float, decimals: int) -> float:
    """Return a number rounded to `decimals`; zero has no sign."""
    return round(value, decimals) + 0.0


def element(tag: str, content: str, **look: object) -> str:
    """Return an element with a style. Underscores in its names become hyphens."""
    style = ";".join(f"{name.replace('_', '-')}:{value}" for name, value in look.items())
    return f'<{tag} style="{style}">{content}</{tag}>'


def div(content: str, **look: object) -> str:
    """Return a block with a style."""
    return element("div", content, **look)


def svg(tag: str, content: str = "", **attributes: object) -> str:
    """Return an SVG element. Underscores in names become hyphens, floats get one decimal."""
    written = []
    for name, value in attributes.items():
        shown = f"{value:.1f}" if isinstance(value, float) else value
        written.append(f'{name.replace("_", "-")}="{shown}"')
    return f"<{tag} {' '.join(written)}>{content}</{tag}>"


def table(head: list[str], rows: Sequence[list[str] | str], left: int = 1) -> str:
    """Return a table.

    Args:
        head: HTML of the cells of its head.
        rows: HTML of the cells of each row; a single text spans all columns.
        left: number of left-aligned columns; the rest is right-aligned.
    """
    top = {"color": DIM, "font_weight": 400, "border_bottom": "1px solid #3a3f48"}
    body = _row("th", head, left, top)
    for row in rows:
        if isinstance(row, str):
            body += f'<tr><td colspan="{len(head)}" style="padding:0 4px 5px">{row}</td></tr>'
        else:
            body += _row("td", row, left, {})
    look = {"width": "100%", "border_collapse": "collapse", "font_size": TEXT}
    return element("table", body, **look, **MONO)


def _row(tag: str, cells: list[str], left: int, look: dict[str, object]) -> str:
    """Return a row of a table."""
    row = ""
    for i, cell in enumerate(cells):
        side = "left" if i < left else "right"
        row += element(tag, cell, text_align=side, padding="2px 4px", white_space="nowrap", **look)
    return f"<tr>{row}</tr>"


def box(*parts: str) -> str:
    """Return vertically stacked parts, in the text size of the page."""
    return div("".join(parts), padding="4px 10px 8px", font_size=TEXT, line_height=1.35)


def heading(content: str) -> str:
    """Return the heading of a part."""
    return div(
        content,
        color=DIM,
        font_size=TEXT,
        letter_spacing=".06em",
        text_transform="uppercase",
        margin="10px 0 4px",
    )


def small(content: str) -> str:
    """Return a remark."""
    return div(content, color=DIM, font_size=TEXT)


def coloured(content: str, colour: str) -> str:
    """Return a text in a colour."""
    return element("span", content, color=colour, font_weight=600)


def swatch(s: Style) -> str:
    """Return the colour and the line style as a short line."""
    dash = " ".join(map(str, s.dash))
    line = {"stroke": s.colour, "stroke_width": 3, "stroke_dasharray": dash}
    content = svg("line", x1=0, y1=5, x2=22, y2=5, **line)
    return svg("svg", content, width=22, height=10, style="vertical-align:middle;margin-right:5px")


def label(entry: Competitor) -> str:
    """Return a competitor's name in its sampler's colour and line style."""
    return swatch(entry.style) + element("b", text(entry.name), color=entry.style.colour)


def bar(share: float, colour: str, height: int = 5, width: str = "100%") -> str:
    """Return a bar of a height [px] that is filled up to a share of 0 to 1."""
    percent = f"{100 * min(max(share, 0.0), 1.0):.1f}%"
    fill = div("", width=percent, height="100%", background=colour)
    look = {"background": TRACK, "border_radius": "2px", "overflow": "hidden"}
    return div(fill, height=f"{height}px", width=width, **look)
