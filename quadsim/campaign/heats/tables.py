"""Tables of many races: the entrants, their order at the finish, and settings side by side."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from math import isnan

from quadsim.campaign.document import Block, Line, Table
from quadsim.campaign.heats.paired import FlownHeats, HeatsDifference
from quadsim.campaign.heats.stats import EntrantStats, HeatsSummary
from quadsim.statistics import Mean


def entrants_table(found: HeatsSummary) -> Table:
    """Return the numbers of each entrant."""
    return Table.of(
        found.entrants,
        {
            "entrant": lambda e: e.name,
            "finished": lambda e: f"{e.finished}/{e.races} ({_percent(e.finished_ci)})",
            "wins": lambda e: f"{e.wins} ({_percent(e.wins_ci)})",
            "rank": lambda e: _mean(e.rank),
            "race [s]": lambda e: _mean(e.race, 3),
            "overtakes": lambda e: _mean(e.overtakes),
            "rating": lambda e: f"{e.rating:.0f} +- {e.rating_error:.0f}",
        },
    )


def win_matrix(found: HeatsSummary) -> Table:
    """Return how often the entrant of a row came in before the entrant of a column [%]."""
    shares: dict[tuple[str, str], str] = {}
    for pair in found.pairs:
        low, high = pair.ci
        ahead = pair.a_first / pair.races
        shares[pair.a, pair.b] = f"{100 * ahead:.0f} ({_percent(pair.ci)})"
        shares[pair.b, pair.a] = f"{100 * (1 - ahead):.0f} ({_percent((1 - high, 1 - low))})"

    def cell(row: EntrantStats, column: EntrantStats) -> str:
        return shares.get((row.name, column.name), "-")

    columns = {
        column.name: lambda row, column=column: cell(row, column) for column in found.entrants
    }
    return Table.of(found.entrants, {"ahead of": lambda row: row.name, **columns})


def overtakers_table(found: HeatsSummary) -> Table:
    """Return how often and how soon one entrant overtook another."""
    return Table.of(
        found.overtakers,
        {
            "overtakes": lambda o: o.name,
            "whom": lambda o: o.other,
            "races": lambda o: f"{o.races}/{found.races}",
            "first at gate": lambda o: _gate(o.gates),
        },
        texts=(0, 1),
    )


# Fewer overtakes are shown without an interval, which could be wider than the race is long.
LEAST_OVERTAKES = 5


def _gate(gates: Mean) -> str:
    """Return the mean gate of overtakes with its interval, which begins at gate 1 or later."""
    if 0 < gates.n < LEAST_OVERTAKES:
        return f"{gates.mean:.1f}"
    return _mean(replace(gates, low=max(gates.low, 1.0)), 1)


def lines_of(found: HeatsSummary) -> list[str]:
    """Return the numbers of all entrants together, a line for each."""
    races = f"{found.with_contact} of {found.races} races have a contact"
    return [
        f"finished {found.finished} of {found.flights} flights ({_percent(found.finished_ci)})",
        f"{races} ({_percent(found.contact_ci)}), {found.contacts} contacts in all",
        f"overtakes in a race {_mean(found.overtakes)}",
        *(
            f"{name} was out by an error in {number} of {found.races} races: {text}"
            for name, texts in found.faults.items()
            for text, number in Counter(texts).items()
        ),
    ]


def settings_table(flown: Sequence[FlownHeats]) -> Table:
    """Return the races of several settings side by side."""
    return Table.of(
        flown,
        {
            "setting": lambda one: one.name,
            "flights finished": lambda one: _finished(one.summary),
            "races with contact": lambda one: _with_contact(one.summary),
            "contacts": lambda one: str(one.summary.contacts),
            "overtakes in a race": lambda one: _mean(one.summary.overtakes),
            "race [s]": lambda one: _mean(one.summary.race, 3),
        },
    )


def _finished(found: HeatsSummary) -> str:
    """Return the share of flights that finished."""
    return f"{found.finished}/{found.flights} ({_percent(found.finished_ci)})"


def _with_contact(found: HeatsSummary) -> str:
    """Return the share of races that have a contact."""
    return f"{found.with_contact}/{found.races} ({_percent(found.contact_ci)})"


def differences_table(differences: Sequence[HeatsDifference]) -> Table:
    """Return the table of differences of each other setting from the first, by equal starts."""
    return Table.of(
        differences,
        {
            "setting": lambda d: f"{d.b} - {d.a}",
            "contacts in a race": lambda d: _mean(d.contacts),
            "contact in one alone": lambda d: (
                f"{d.contact_b_only} : {d.contact_a_only} (p {d.p_contact:.2g})"
            ),
            "finished in a race": lambda d: _mean(d.finished),
            "overtakes": lambda d: _mean(d.overtakes),
            "time [s]": lambda d: _mean(d.time, 3),
        },
    )


def _percent(interval: tuple[float, float]) -> str:
    """Return an interval of a share in percent."""
    low, high = interval
    return f"{100 * low:.0f} to {100 * high:.0f} %"


def _mean(mean: Mean, digits: int = 2) -> str:
    """Return a mean with its interval."""
    if mean.n == 0 or isnan(mean.mean):
        return "-"
    if mean.n == 1:
        return f"{mean.mean:.{digits}f}"
    return f"{mean.mean:.{digits}f} ({mean.low:.{digits}f} to {mean.high:.{digits}f})"


def summary_blocks(found: HeatsSummary) -> list[Block]:
    """Return the tables and lines of many races under one setting."""
    tables = [entrants_table(found), win_matrix(found)]
    if found.overtakers:
        tables.append(overtakers_table(found))
    return [*tables, *map(Line, lines_of(found))]
