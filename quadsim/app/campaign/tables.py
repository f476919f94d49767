"""A comparison as sheets of text, printed as tables or written as Markdown from the same cells."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isfinite

from rich.markup import escape
from rich.table import Table

from quadsim.app.campaign.summary_stats import PairStats, VariantStats
from quadsim.app.lap_table import plain_table
from quadsim.record.statistics import Mean

SHOWN = 7  # hex digits of a commit


@dataclass(frozen=True)
class TextTable:
    """Texts to the left, numbers to the right."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    folds: tuple[int, ...] = (0,)  # columns of text, which may fold in a narrow terminal


def sheets(variants: Sequence[VariantStats], pairs: Sequence[PairStats]) -> Iterator[TextTable]:
    """Of one course."""
    yield _laps(variants)
    yield _chatter(variants)
    if pairs:
        yield pair_sheet(pairs)


def as_table(sheet: TextTable) -> Table:
    table = plain_table()
    for i, name in enumerate(sheet.head):
        fold = i in sheet.folds
        table.add_column(escape(name), justify="left" if fold else "right", no_wrap=not fold, overflow="fold")
    for row in sheet.rows:
        table.add_row(*map(escape, row))
    return table


def as_markdown(sheet: TextTable) -> str:
    lines = [sheet.head, ("---", *["---:"] * (len(sheet.head) - 1)), *sheet.rows]
    return "\n".join("| " + " | ".join(cell.replace("\n", " ") for cell in line) + " |" for line in lines)


def notes(variants: Sequence[VariantStats], pairs: Sequence[PairStats], limit: float) -> Iterator[str]:
    """What must not be overlooked."""
    if any(a.finished < a.attempts for a in variants):
        yield f"Laps: of attempts that finished. Penalised: the others count as the time limit, {limit:.1f} s a lap."
    known = [p for p in pairs if isfinite(p.detectable)]
    if known:
        each = ", ".join(f"{p.b} - {p.a} {p.detectable:.3f} s" for p in known)
        yield f"Lap differences that so many pairs show with power 80 %: {each}."
    commits = sorted({c for a in variants for c in a.commits})
    if len(commits) > 1:
        each = "; ".join(f"{a.name}: {', '.join(map(short, a.commits))}" for a in variants)
        yield f"MIXED COMMITS: {each}. --this-commit counts only the present one's flights."
    if any(c.endswith("-dirty") for c in commits):
        yield "Flown from files that differ from their commit (+): nobody else can repeat it."


def short(commit: str) -> str:
    """A commit's first digits, with a + where files differed from it; a version as it is."""
    digits, dirty, _ = commit.partition("-dirty")
    return digits[: None if " " in digits else SHOWN] + ("+" if dirty else "")


def _laps(variants: Sequence[VariantStats]) -> TextTable:
    head = ("variant", "finished", "CI [%]", "lap [s]", "sd", "best", "race", "flying", "penalised")
    rows = [
        (
            a.name,
            f"{a.finished}/{a.attempts}",
            _percent(a.success_ci),
            *map(_seconds, (a.lap_mean, a.lap_sd, a.lap_min, a.race_median, a.flying_median, a.penalised_mean)),
        )
        for a in variants
    ]
    return TextTable(head, tuple(rows))


def _chatter(variants: Sequence[VariantStats]) -> TextTable:
    head = ("variant", "thrust [m/s^2/s]", "delivered", "plan [ms]", "ended at")
    rows = [
        (
            a.name,
            f"{a.thrust_tv:.1f}",
            f"{a.thrust_tv_delivered:.1f}",
            f"{a.plan_ms:.1f}",
            ", ".join(f"{n} {where}" for where, n in a.crashes.items()) or "-",
        )
        for a in variants
    ]
    return TextTable(head, tuple(rows), folds=(0, len(head) - 1))


def pair_sheet(pairs: Sequence[PairStats]) -> TextTable:
    head = ("pair", "lap difference [s]", "pairs", "only one", "p", "thrust variation")
    rows = [
        (
            f"{p.b} - {p.a}",
            _interval(p.lap_difference, "+.3f"),
            str(p.lap_difference.n),
            f"{p.only_b} : {p.only_a}" if p.seeds else "-",
            f"{p.success_p:.3g}",
            f"x {_interval(p.thrust_tv_ratio, '.2f')}",
        )
        for p in pairs
    ]
    return TextTable(head, tuple(rows))


def _seconds(t: float) -> str:
    return f"{t:.3f}" if isfinite(t) else "-"


def _percent(interval: tuple[float, float]) -> str:
    return "{:.0f}-{:.0f}".format(*(100 * p for p in interval))


def _interval(m: Mean, form: str) -> str:
    if not isfinite(m.mean):
        return "-"
    known = isfinite(m.low)
    return f"{m.mean:{form}} [{m.low:{form}}, {m.high:{form}}]" if known else f"{m.mean:{form}}"
