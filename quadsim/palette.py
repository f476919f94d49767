"""One colour and one line style for each sampler, the same on every page, figure and table.

The colours are Okabe and Ito's, which people with any kind of colour vision can distinguish; the
line styles distinguish them in grey.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import cycle


@dataclass(frozen=True)
class Style:
    """A colour and a line style."""

    # "#rrggbb"
    colour: str
    # Lengths of stroke and gap [px]; () is solid
    dash: tuple[int, ...]

    @property
    def rgb(self) -> tuple[int, int, int]:
        """Red, green and blue, each from 0 to 255."""
        red, green, blue = bytes.fromhex(self.colour.removeprefix("#"))
        return red, green, blue


STYLES = {
    "colored": Style("#e69f00", ()),
    "gaussian": Style("#56b4e9", (6, 3)),
    "log_normal": Style("#009e73", (2, 3)),
    "smooth": Style("#cc79a7", (9, 3, 2, 3)),
    "smooth_star": Style("#f0e442", (9, 3)),
    # a person, see quadsim.racing.hand
    "hand": Style("#ee3377", (14, 2)),
}
# For variants that are no sampler: the rest of the eight colours, then three of Paul Tol's
SPARE = (
    Style("#0072b2", ()),
    Style("#d55e00", (6, 3)),
    Style("#000000", (2, 3)),
    Style("#882255", (9, 3, 2, 3)),
    Style("#999933", (9, 3)),
    Style("#332288", (4, 4)),
)
OTHER = Style("#b0b0b0", (4, 4))
# On the dark page, for the second and later competitors with the same sampler
SPARE_ON_DARK = (
    Style("#f4f4f4", (2, 3)),
    Style("#8f9dff", (9, 3)),
    Style("#c8e36b", (6, 3)),
    Style("#ff9ec7", (9, 3, 2, 3)),
    Style("#7fe0d0", (4, 4)),
    Style("#c9a37a", (12, 4)),
    Style("#a8b3c4", (2, 6)),
)

# Meanings: the next gate, collisions, best of all, faster than before
NEXT = "#009e73"
HIT = "#d55e00"
BEST = "#b07cff"
FASTER = "#2fbf71"
HIT_ON_DARK = "#ff6b6b"  # as light as text on a dark page has to be

# On white paper
INK = "#202020"
MARK = "#606060"
FRAME = "#9a9a9a"
LIMIT = "#b0b0b0"
GRID = "#e6e6e6"
FINE = "#f2f2f2"


def style(sampler: str) -> Style:
    """Return the style of a sampler by its name, or OTHER."""
    return STYLES.get(sampler, OTHER)


def styles(variants: Sequence[str]) -> list[Style]:
    """Return the styles of variants that are compared in one figure, up to 36 of which differ.

    A variant that is named after a sampler has the sampler's style, any other variant the next free
    one. Once all are used, colours are combined with the line styles of other colours.
    """
    spare = cycle(
        Style(one.colour, SPARE[(k + turn) % len(SPARE)].dash)
        for turn in range(len(SPARE))
        for k, one in enumerate(SPARE)
    )
    return [STYLES[name] if name in STYLES else next(spare) for name in variants]


def styles_on_dark(samplers: Sequence[str]) -> list[Style]:
    """Return the styles of competitors on a dark page, all of which differ.

    The first competitor with a sampler has the sampler's style, a later one the next free style.
    """
    spare = cycle(SPARE_ON_DARK)
    return [
        style(sampler) if sampler not in samplers[:i] else next(spare)
        for i, sampler in enumerate(samplers)
    ]


def dotted(s: Style) -> Style:
    """Return the dotted style for a second curve of the same sampler in one figure."""
    return replace(s, dash=(1, 1))
