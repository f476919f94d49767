"""The competitors of the next START as an HTML table."""

from __future__ import annotations

from quadsim.palette import styles_on_dark
from quadsim.web.line_up import LineUp
from quadsim.web.page.html import RED, box, coloured, div, element, small, swatch, text
from quadsim.web.state import PageState


def names_of(state: PageState, line_up: LineUp) -> list[str]:
    """Return the name of each competitor in its colour, as HTML."""
    styles = styles_on_dark([row.choices.kind for row in state.rows])
    return [
        swatch(own) + coloured(text(name), own.colour)
        for name, own in zip(line_up.names, styles, strict=True)
    ]


def table_of(state: PageState, line_up: LineUp, edited: int) -> str:
    """Return the table of competitors as HTML.

    edited: number of the row that the visitor edits.
    """
    rows = []
    for k, name in enumerate(names_of(state, line_up)):
        what = [text(part) for part in line_up.what[k]]
        what += [f"<b>{text(change)}</b>" for change in line_up.changes[k]]
        is_edited = state.rows[k].number == edited and len(state.rows) > 1
        look = {"background": "#2c3038"} if is_edited else {}
        content = f"{k + 1} {name}" + small(" · ".join(what))
        row = div(content, padding="2px 6px", border_radius="4px", **look)
        rows.append(row.replace("<div ", f'<div data-row="{k + 1}" ', 1))
    if line_up.problem:
        remark = div(coloured(text(line_up.problem), RED), margin_top="4px")
    else:
        remark = small(text(line_up.compared)) if line_up.compared else ""
    return box(element("div", "".join(rows)), remark)
