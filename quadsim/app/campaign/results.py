"""`race results`: what campaigns have stored, listed, filtered, compared."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from fnmatch import fnmatch
from pathlib import Path
from typing import Annotated

from rich.markup import escape
from tyro.conf import FlagCreatePairsOff, Positional, arg

from quadsim.app.campaign.common_flags import CAMPAIGN
from quadsim.app.campaign.store import Row, Store
from quadsim.app.campaign.summary_stats import VariantStats, pair_stats, variant_stats
from quadsim.app.campaign.tables import TextTable, as_table, pair_sheet, short
from quadsim.app.console import emit, emit_json
from quadsim.app.flags import UsageError

ID = 6  # hex digits of an variant that are shown


@dataclass(frozen=True)
class Group:
    """All attempts of one specification that one commit flew, whatever campaign they lie in."""

    id: str  # first digits of the variant's hash
    code: str
    rows: tuple[Row, ...]
    limit: float  # [s] a lap

    @property
    def numbers(self) -> VariantStats:
        return variant_stats(self.rows[0].name, self.rows, self.limit)


@dataclass(frozen=True)
class Results:
    """What is stored: one line for each variant and the commit that flew it. Two or more ids compare them.

    race results --course split_s* --sampler colored

    race results 3fa91c 8b02d7 --campaigns campaigns/monday.sqlite campaigns/race.sqlite
    """

    ids: Annotated[
        tuple[str, ...], Positional, arg(metavar="ID")
    ] = ()  # first digits of variants; ID@COMMIT is one commit's
    campaigns: Annotated[tuple[str, ...], arg(metavar="FILE")] = (CAMPAIGN,)  # where to look
    course: str = "*"  # only of courses like this
    sampler: str = "*"
    vehicle: str = "*"
    commit: str = "*"  # only flown by commits that begin like this
    json: FlagCreatePairsOff[bool] = False  # one JSON object instead of a table

    def run(self) -> int:
        groups = [g for g in stored(self.campaigns) if self._wanted(g)]
        if self.ids:
            groups = [_find(groups, id_) for id_ in self.ids]
        numbers = [g.numbers for g in groups]
        pairs = [
            pair_stats(_label(a), _label(b), a.rows, b.rows)
            for i, a in enumerate(groups if self.ids else [])
            for b in groups[i + 1 :]
            if a.rows[0].course == b.rows[0].course
        ]
        if self.json:
            variants = [asdict(n) | {"id": g.id, "seeds": _seeds(g)} for g, n in zip(groups, numbers, strict=True)]
            emit_json({"variants": variants, "pairs": [asdict(p) for p in pairs], "campaigns": list(self.campaigns)})
            return 0
        emit(as_table(_sheet(groups, numbers)) if groups else "nothing stored that fits")
        if pairs:
            emit("", as_table(pair_sheet(pairs)))
        if len({g.code for g in groups}) > 1 and pairs:
            emit("", escape("MIXED COMMITS: " + ", ".join(f"{_label(g)}" for g in groups)))
        return 0

    def _wanted(self, g: Group) -> bool:
        row = g.rows[0]
        return all(
            fnmatch(value, pattern)
            for value, pattern in (
                (row.course, self.course),
                (row.sampler, self.sampler),
                (row.vehicle, self.vehicle),
                (g.code, f"{self.commit}*"),
            )
        )


def stored(campaigns: Sequence[str]) -> Iterator[Group]:
    """Every group, in the order of its first flight. Raises RunError."""
    groups: dict[tuple[str, str], dict[str, Row]] = {}
    limits: dict[str, float] = {}
    for path in campaigns:
        with Store(Path(path), create=False) as store:
            for row in store.rows():
                groups.setdefault((row.variant, row.code), {})[row.key] = (
                    row  # one attempt in two campaigns counts once
                )
                if row.variant not in limits:
                    spec = store.spec(row.key)
                    limits[row.variant] = spec["timeout"] / spec["laps"]
    for (variant, code), rows in groups.items():
        yield Group(variant[:ID], code, tuple(sorted(rows.values(), key=lambda r: r.seed)), limits[variant])


def _find(groups: Sequence[Group], wanted: str) -> Group:
    """By first digits of the variant, of the commit too where they are said. Raises UsageError unless just one fits."""
    variant, _, commit = wanted.partition("@")
    fits = [g for g in groups if g.rows[0].variant.startswith(variant) and g.code.startswith(commit)]
    if len(fits) != 1:
        known = ", ".join(_label(g) for g in (fits or groups)[:4])
        raise UsageError(
            f"{wanted!r}: expected the id of one variant, or ID@COMMIT; {len(fits)} fit; there are {known}"
        )
    return fits[0]


def _sheet(groups: Sequence[Group], numbers: Sequence[VariantStats]) -> TextTable:
    head = ("id", "variant", "course", "vehicle", "rnd", "seeds", "done", "lap [s]", "thrust", "commit")
    rows = [
        (
            g.id,
            n.name,
            n.course,
            g.rows[0].vehicle,
            f"{g.rows[0].randomize:g}",
            _seeds(g),
            f"{n.finished}/{n.attempts}",
            f"{n.lap_mean:.3f}" if n.finished else "-",
            f"{n.thrust_tv:.1f}",
            short(g.code),
        )
        for g, n in zip(groups, numbers, strict=True)
    ]
    return TextTable(head, tuple(rows), folds=(1, 2, 3))


def _seeds(g: Group) -> str:
    return f"{g.rows[0].seed}-{g.rows[-1].seed}"


def _label(g: Group) -> str:
    return f"{g.rows[0].name} {g.id}@{short(g.code)}"
