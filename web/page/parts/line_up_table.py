"""The competitors of the next START as a table, with the reason why they cannot be flown."""

from __future__ import annotations

import msgspec

from quadsim.palette import styles_on_dark
from quadsim.web.state.line_up import LineUp
from quadsim.web.state.page_state import PageState


class LineUpRow(msgspec.Struct):
    """A competitor.

    Attributes:
        number: of its row.
        what: what it flies.
        changes: its numbers that differ from the preset.
    """

    number: int
    name: str
    colour: str
    dash: tuple[int, ...]
    what: str
    changes: str


class LineUpTable(msgspec.Struct):
    """The competitors; what they differ in; why START cannot fly them, empty: it can."""

    rows: list[LineUpRow]
    compared: str
    problem: str


def table_of(state: PageState, line_up: LineUp) -> LineUpTable:
    """Return the table of competitors."""
    styles = styles_on_dark([row.choices.kind for row in state.rows])
    rows = [
        LineUpRow(
            number=row.number,
            name=line_up.names[k],
            colour=styles[k].colour,
            dash=tuple(styles[k].dash),
            what=" · ".join(line_up.what[k]),
            changes=" · ".join(line_up.changes[k]),
        )
        for k, row in enumerate(state.rows)
    ]
    return LineUpTable(rows, line_up.compared, line_up.problem)
