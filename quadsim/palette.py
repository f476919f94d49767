"""One colour and one line style for each sampler, the same on every page, figure and table.

Okabe and Ito's colours, which people with any kind of colour vision tell apart; the dashes tell
them apart in grey.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import cycle


@dataclass(frozen=True)
class Style:
    colour: str  # "#rrggbb"
    dash: tuple[int, ...]  # lengths of stroke and gap [px]; (): solid

    @property
    def rgb(self) -> tuple[int, int, int]:
        return int(self.colour[1:3], 16), int(self.colour[3:5], 16), int(self.colour[5:7], 16)


STYLES = {
    "colored": Style("#e69f00", ()),
    "gaussian": Style("#56b4e9", (6, 3)),
    "log_normal": Style("#009e73", (2, 3)),
    "smooth": Style("#cc79a7", (9, 3, 2, 3)),
    "smooth_star": Style("#f0e442", (9, 3)),
}
SPARE = (  # for variants that are no sampler: what is left of the eight, then three of Paul Tol's
    Style("#0072b2", ()),
    Style("#d55e00", (6, 3)),
    Style("#000000", (2, 3)),
    Style("#882255", (9, 3, 2, 3)),
    Style("#999933", (9, 3)),
    Style("#332288", (4, 4)),
)
OTHER = Style("#b0b0b0", (4, 4))
# next gate, collisions, best of all, faster
NEXT, HIT, BEST, FASTER = "#009e73", "#d55e00", "#b07cff", "#2fbf71"
# on white paper
INK, MARK, FRAME, LIMIT, GRID, FINE = (
    "#202020",
    "#606060",
    "#9a9a9a",
    "#b0b0b0",
    "#e6e6e6",
    "#f2f2f2",
)


def style(sampler: str) -> Style:
    return STYLES.get(sampler, OTHER)


def styles(variants: Sequence[str]) -> list[Style]:
    """Of what is compared in one figure: a sampler by its name has its own, any other variant the
    next spare one."""
    spare = cycle(SPARE)
    return [STYLES[name] if name in STYLES else next(spare) for name in variants]


def dotted(s: Style) -> Style:
    """For the same sampler once more in one figure, with other numbers."""
    return replace(s, dash=(1, 1))
