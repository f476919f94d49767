"""One colour and one line style for each sampler, the same on every page, figure and table.

Okabe and Ito's colours, which people with any kind of colour vision tell apart; the dashes tell them apart in grey.
"""

from __future__ import annotations

from dataclasses import dataclass


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
OTHER = Style("#b0b0b0", (4, 4))
NEXT, HIT, BEST, FASTER = "#009e73", "#d55e00", "#b07cff", "#2fbf71"  # next gate, collisions, best of all, faster


def style(sampler: str) -> Style:
    return STYLES.get(sampler, OTHER)
