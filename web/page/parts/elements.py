"""Elements of the page: tables, texts and drawings as values, whose look is in one style sheet.

A page builds them node by node (dom.js), so that no text is ever parsed as HTML; `to_html` writes
them into a file. What an element looks like is said by its class names and by the rules of
shell/elements.css. What a rule cannot know, such as the colour of a competitor, is one of the
`values`, which the rules read as custom properties.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

import msgspec

from quadsim.palette import Style
from quadsim.web.race.competitor import Competitor

SHEET = Path(__file__).parent.parent / "shell" / "elements.css"
VOID = ("img",)  # elements without an end

DIM = "#9aa5b5"  # secondary text, in the style sheet and in pictures


class Element(msgspec.Struct, omit_defaults=True):
    """An element.

    Attributes:
        tag: its name, such as "div".
        attributes: by name, with `class` for the class names.
        values: custom properties for the style sheet, without the hyphens before their names.
        children: elements and texts.
    """

    tag: str
    attributes: dict[str, str] = {}
    values: dict[str, str] = {}
    children: list[Element | str] = []


Content = Element | str
EMPTY = Element("div")  # a part of the page that shows nothing


def element(
    tag: str,
    *children: Content,
    look: str = "",
    values: dict[str, str] | None = None,
    **attributes: object,
) -> Element:
    """Return an element.

    Args:
        tag: its name.
        children: elements and texts; empty texts are left out.
        look: class names, with spaces between them.
        values: custom properties for the style sheet.
        attributes: underscores in their names become hyphens, floats get one decimal.
    """
    written = {"class": look} if look else {}
    for name, value in attributes.items():
        shown = f"{value:.1f}" if isinstance(value, float) else str(value)
        written[name.replace("_", "-")] = shown
    return Element(tag, written, values or {}, [child for child in children if child != ""])


def to_html(content: Content) -> str:
    """Return an element or a text as HTML, for a file with the rules of SHEET.

    Examples:
        >>> from quadsim.web.page.parts.elements import element, to_html
        >>> to_html(element("b", "1 < 2", look="small"))
        '<b class="small">1 &lt; 2</b>'
    """
    if isinstance(content, str):
        return escape(content)
    written = dict(content.attributes)
    if content.values:
        written["style"] = ";".join(f"--{name}:{value}" for name, value in content.values.items())
    attributes = "".join(f' {name}="{escape(value)}"' for name, value in written.items())
    start = f"<{content.tag}{attributes}>"
    if content.tag in VOID:
        return start
    return start + "".join(map(to_html, content.children)) + f"</{content.tag}>"


def rounded(value: float, decimals: int) -> float:
    """Return a number rounded to `decimals`; zero has no sign."""
    return round(value, decimals) + 0.0


def table(
    head: Sequence[Content], rows: Sequence[Sequence[Content] | Content], left: int = 1
) -> Element:
    """Return a table.

    Args:
        head: the cells of its head.
        rows: the cells of each row; a single content spans all columns.
        left: number of left-aligned columns; the rest is right-aligned.
    """
    body = [_row("th", head, left)]
    for row in rows:
        if isinstance(row, Element | str):
            body.append(element("tr", element("td", row, colspan=len(head))))
        else:
            body.append(_row("td", row, left))
    return element("table", *body, look="table")


def _row(tag: str, cells: Sequence[Content], left: int) -> Element:
    """Return a row of a table."""
    looks = ["" if k < left else "right" for k in range(len(cells))]
    return element(
        "tr", *(element(tag, cell, look=look) for cell, look in zip(cells, looks, strict=True))
    )


def box(*parts: Content) -> Element:
    """Return vertically stacked parts."""
    return element("div", *parts, look="box")


def heading(content: str) -> Element:
    """Return the heading of a part."""
    return element("div", content, look="heading")


def line(*contents: Content) -> Element:
    """Return a line of numbers."""
    return element("div", *contents, look="line-of-numbers")


def small(*contents: Content) -> Element:
    """Return a remark."""
    return element("div", *contents, look="small")


def bad(content: str) -> Element:
    """Return a text that says that something is wrong."""
    return element("span", content, look="wrong")


def swatch(style: Style) -> Element:
    """Return the colour and the line style as a short line."""
    dash = " ".join(map(str, style.dash))
    drawn = element("line", x1=0, y1=5, x2=22, y2=5, stroke_dasharray=dash)
    values = {"colour": style.colour}
    return element("svg", drawn, look="swatch-line", values=values, viewBox="0 0 22 10")


def label(entry: Competitor) -> Element:
    """Return a competitor's name in its sampler's colour and line style."""
    name = element("b", entry.name, look="coloured", values={"colour": entry.style.colour})
    return element("span", swatch(entry.style), name)


def bar(share: float, look: str = "") -> Element:
    """Return a bar that is filled up to a share of 0 to 1.

    look: further class names.
    """
    filled = f"{100 * min(max(share, 0.0), 1.0):.1f}%"
    return element("div", element("i"), look=f"meter {look}".strip(), values={"filled": filled})
