"""A comparison as tables of text, printed or written as Markdown from the same cells."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

from rich.console import Group, RenderableType
from rich.markup import escape

from quadsim.campaign.summary_stats import PairStats, VariantStats
from quadsim.console import plain_table, width
from quadsim.record.statistics import Mean

SHOWN = 7  # hex digits of a commit
# of a table; between its columns; least width of a text that wraps [terminal columns]
INDENT, GAP, TEXT = 2, 2, 24


@dataclass(frozen=True)
class TextTable:
    """Texts to the left, numbers to the right."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    folds: tuple[int, ...] = (0,)  # columns of text; those but the first of them may wrap at spaces

    @classmethod
    def of(
        cls,
        items: Sequence,
        columns: Mapping[str, Callable[[Any], str]],
        folds: tuple[int, ...] = (0,),
    ):
        """One row for each item; columns: head -> cell of an item."""
        return cls(
            tuple(columns),
            tuple(tuple(cell(item) for cell in columns.values()) for item in items),
            folds,
        )


def as_table(texts: TextTable, columns: int | None = None) -> Group:
    """One table, or where that is too wide several below each other, each with the first column. No
    word is broken.

    columns: of the terminal; None: of this one.
    """
    room = (width() if columns is None else columns) - INDENT
    name, *others = (_least_width(texts, i) for i in range(len(texts.head)))
    # only a longer name is broken
    widths = [min(name, max(TEXT, room - GAP - max(others))), *others]
    parts = [[0]]
    for i in range(1, len(widths)):
        if len(parts[-1]) > 1 and sum(widths[k] + GAP for k in (*parts[-1], i)) - GAP > room:
            parts.append([0])
        parts[-1].append(i)
    shown: list[RenderableType] = []
    for part in parts:
        table = plain_table()
        for i in part:
            text, head = i in texts.folds, escape(texts.head[i])
            side = "left" if text else "right"
            table.add_column(
                head, justify=side, no_wrap=not text, overflow="fold", min_width=widths[i]
            )
        for row in texts.rows:
            table.add_row(*(escape(row[i]) for i in part))
        shown += ["", table]
    return Group(*shown[1:])


def _least_width(table: TextTable, i: int) -> int:
    """Columns of the terminal that column i takes: its longest line, less where it is a text that
    wraps."""
    texts = [*table.head[i].split("\n"), *(row[i] for row in table.rows)]
    whole = max(map(len, texts))
    if i not in table.folds[1:]:
        return whole
    return min(whole, max(TEXT, *(len(word) for text in texts for word in text.split())))


def as_markdown(table: TextTable) -> str:
    lines = [table.head, ("---", *["---:"] * (len(table.head) - 1)), *table.rows]
    return "\n".join(
        "| " + " | ".join(cell.replace("\n", " ") for cell in line) + " |" for line in lines
    )


def comparison_tables(
    variants: Sequence[VariantStats], pairs: Sequence[PairStats]
) -> Iterator[TextTable]:
    """Of one course."""
    yield TextTable.of(
        variants, LAPS | (ABOVE if any(isfinite(a.above_limit) for a in variants) else {})
    )
    if any(a.cost.n for a in variants):
        yield TextTable.of(variants, COSTS)
    yield TextTable.of(variants, CHATTER, folds=(0, len(CHATTER) - 1))
    if pairs:
        yield TextTable.of(pairs, PAIRS)


def notes(
    variants: Sequence[VariantStats], pairs: Sequence[PairStats], limit: float
) -> Iterator[str]:
    """What the tables must not be read without."""
    if any(a.finished < a.attempts for a in variants):
        yield f"Laps: of attempts that finished. Penalised: the others count as the time limit, {limit:.1f} s a lap."
    if any(a.turned_back for a in variants):
        yield "Turned back: attempts that overshot a gate and returned to it."
    if known := [p for p in pairs if isfinite(p.detectable)]:
        each = ", ".join(f"{p.b} - {p.a} {p.detectable:.3f} s" for p in known)
        yield f"Lap differences that so many pairs detect with power 80 %: {each}."
    if any(isfinite(a.above_limit) for a in variants):
        yield "Above the limit: the median race over the best known limit of the same, nominal vehicle (race limit)."
    commits = sorted({c for a in variants for c in a.commits})
    if len(commits) > 1:
        each = "; ".join(f"{a.name}: {', '.join(map(short, a.commits))}" for a in variants)
        yield f"MIXED COMMITS: {each}. --this-commit counts only the present one's flights."
    if any(c.endswith("-dirty") for c in commits):
        yield "Flown from files that differ from their commit (+): the flights cannot be reproduced from it."


def short(commit: str) -> str:
    """A commit's first digits, with a + where files differed from it; a version as it is."""
    digits, dirty, _ = commit.partition("-dirty")
    return digits[: None if " " in digits else SHOWN] + ("+" if dirty else "")


def number(value: float, form: str = ".3f") -> str:
    """A dash for nan."""
    return f"{value:{form}}" if isfinite(value) else "-"


def interval(m: Mean, form: str) -> str:
    """mean [low, high], as far as they are known."""
    return number(m.mean, form) + (f" [{m.low:{form}}, {m.high:{form}}]" if isfinite(m.low) else "")


LAPS: dict[str, Callable[[VariantStats], str]] = {
    "variant": lambda a: a.name,
    "done": lambda a: f"{a.finished}/{a.attempts}",
    "CI\n[%]": lambda a: "{:.0f}-{:.0f}".format(*(100 * p for p in a.success_ci)),
    "lap\n[s]": lambda a: number(a.lap_mean),
    "sd": lambda a: number(a.lap_sd),
    "best": lambda a: number(a.lap_min),
    "race": lambda a: number(a.race_median),
    "flying": lambda a: number(a.flying_median),
    "penalised": lambda a: number(a.penalised_mean),
}
ABOVE: dict[str, Callable[[VariantStats], str]] = {
    "above the\nlimit [%]": lambda a: number(100.0 * a.above_limit, ".1f"),
}
COSTS: dict[str, Callable[[VariantStats], str]] = {
    "variant": lambda a: a.name,
    "accumulated cost": lambda a: interval(a.cost, ".0f"),
    "sd": lambda a: number(a.cost.sd, ".0f"),
}
CHATTER: dict[str, Callable[[VariantStats], str]] = {
    "variant": lambda a: a.name,
    "thrust [m/s^2/s]": lambda a: number(a.thrust_tv, ".1f"),
    "delivered": lambda a: number(a.thrust_tv_delivered, ".1f"),
    "body rates [rad/s^2]": lambda a: number(a.rates_tv, ".1f"),
    "plan [ms]": lambda a: f"{a.plan_ms:.1f}",
    "turned back": lambda a: "-" if a.turned_back is None else str(a.turned_back),
    "ended at": lambda a: ", ".join(f"{n} {where}" for where, n in a.crashes.items()) or "-",
}
PAIRS: dict[str, Callable[[PairStats], str]] = {
    "pair": lambda p: f"{p.b} - {p.a}",
    "lap difference [s]": lambda p: interval(p.lap_difference, "+.3f"),
    "pairs": lambda p: str(p.lap_difference.n),
    "only one": lambda p: f"{p.only_b} : {p.only_a}" if p.seeds else "-",
    "p": lambda p: f"{p.success_p:.3g}",
    "thrust variation": lambda p: f"x {interval(p.thrust_tv_ratio, '.2f')}",
}
