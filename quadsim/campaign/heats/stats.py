"""The numbers of many heats of the same entrants: finishes, wins, ranks, overtakes, contacts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any, NamedTuple

from quadsim.campaign.heats.rating import HeadToHead, bradley_terry
from quadsim.files.json_values import without_nan
from quadsim.record.schema import StoredPlacing, StoredResult
from quadsim.statistics import (
    Mean,
    clustered_mean,
    clustered_wilson,
    mean_interval,
    wilson,
)


class EntrantStats(NamedTuple):
    """The numbers of one entrant over many races."""

    name: str
    races: int
    finished: int
    finished_ci: tuple[float, float]
    wins: int
    wins_ci: tuple[float, float]
    rank: Mean
    # race time of the flights that finished [s]
    race: Mean
    overtakes: Mean  # of others, in a race
    overtaken: Mean
    rating: float
    # half of its 95 % interval
    rating_error: float


class OvertakeStats(NamedTuple):
    """How often and how soon one entrant overtook another."""

    name: str
    other: str
    # races in which the entrant overtook the other one at least once
    races: int
    # gates that the entrant had passed at its first overtake
    gates: Mean


class HeatsSummary(NamedTuple):
    """The numbers of many races."""

    races: int
    entrants: list[EntrantStats]
    pairs: list[HeadToHead]
    overtakers: list[OvertakeStats]
    # flights that finished, of all; the interval is by race
    flights: int
    finished: int
    finished_ci: tuple[float, float]
    # race time of the flights that finished [s]; the interval is by race
    race: Mean
    # races with a contact of two vehicles
    with_contact: int
    contact_ci: tuple[float, float]
    contacts: int
    overtakes: Mean  # in a race
    # name of an entrant -> the errors of its planner or controller, one for each race that had one
    faults: dict[str, list[str]]


def summary(names: Sequence[str], results: Sequence[StoredResult], gates: int) -> HeatsSummary:
    """Return the numbers of many races, at least one.

    Args:
        names: names of the entrants.
        results: the races.
        gates: number of gates of the course.
    """
    ranks = [{placing.name: placing for placing in result.order} for result in results]
    pairs = []
    for a, b in combinations(names, 2):
        first = sum(race[a].rank < race[b].rank for race in ranks)
        pairs.append(HeadToHead(a, b, len(ranks), first, wilson(first, len(ranks))))
    ratings = bradley_terry(
        names, [{name: placing.rank for name, placing in race.items()} for race in ranks]
    )
    entrants = [_entrant_stats(name, ranks, results, *ratings[name]) for name in names]
    flights = len(names) * len(results)
    finished = sum(entrant.finished for entrant in entrants)
    contacts = [sum(event.kind == "contact" for event in result.events) for result in results]
    overtakes = [sum(event.kind == "overtake" for event in result.events) for result in results]
    with_contact = sum(count > 0 for count in contacts)
    # The flights of one race share its course and its seed, and act on each other: what is pooled
    # over them has the race as its unit.
    times = [
        [placing.time for placing in result.order if placing.time is not None] for result in results
    ]
    finishers = [
        sum(placing.outcome == "finished" for placing in result.order) for result in results
    ]
    return HeatsSummary(
        races=len(results),
        entrants=entrants,
        pairs=pairs,
        overtakers=list(_overtakers(results, gates)),
        flights=flights,
        finished=finished,
        finished_ci=clustered_wilson(finishers, [len(names)] * len(results)),
        race=clustered_mean(times),
        with_contact=with_contact,
        contact_ci=wilson(with_contact, len(results)),
        contacts=sum(contacts),
        overtakes=mean_interval([float(count) for count in overtakes]),
        faults=_faults(results),
    )


def _faults(results: Sequence[StoredResult]) -> dict[str, list[str]]:
    """Return the errors that entrants have raised, by name."""
    found: dict[str, list[str]] = {}
    for result in results:
        for name, text in result.faults.items():
            found.setdefault(name, []).append(text)
    return found


def _entrant_stats(
    name: str,
    ranks: Sequence[dict[str, StoredPlacing]],
    results: Sequence[StoredResult],
    rating: float,
    rating_error: float,
) -> EntrantStats:
    """Return the numbers of one entrant."""
    own = [race[name] for race in ranks]
    finished = sum(placing.outcome == "finished" for placing in own)
    wins = sum(placing.rank == 1 for placing in own)
    overtakes = [
        float(sum(e.kind == "overtake" and e.name == name for e in result.events))
        for result in results
    ]
    overtaken = [
        float(sum(e.kind == "overtake" and e.other == name for e in result.events))
        for result in results
    ]
    return EntrantStats(
        name=name,
        races=len(own),
        finished=finished,
        finished_ci=wilson(finished, len(own)),
        wins=wins,
        wins_ci=wilson(wins, len(own)),
        rank=mean_interval([float(placing.rank) for placing in own]),
        race=mean_interval([placing.time for placing in own if placing.time is not None]),
        overtakes=mean_interval(overtakes),
        overtaken=mean_interval(overtaken),
        rating=rating,
        rating_error=rating_error,
    )


def _overtakers(results: Sequence[StoredResult], gates: int) -> Iterator[OvertakeStats]:
    """Yield the numbers of each pair of entrants of which one overtook the other."""
    first: dict[tuple[str, str], list[float]] = {}
    for result in results:
        here: dict[tuple[str, str], float] = {}
        for event in result.events:
            if event.kind == "overtake":
                passed = (event.lap - 1) * gates + event.gate
                here.setdefault((event.name, event.other), float(passed))
        for pair, passed in here.items():
            first.setdefault(pair, []).append(passed)
    for (name, other), passed in sorted(first.items()):
        yield OvertakeStats(name, other, len(passed), mean_interval(passed))


def summary_as_json(found: HeatsSummary) -> dict[str, Any]:
    """Return the numbers of many races as JSON."""
    return plain_fields(found) | {
        "entrants": [plain_fields(entrant) for entrant in found.entrants],
        "pairs": [pair._asdict() for pair in found.pairs],
        "overtakers": [plain_fields(overtaker) for overtaker in found.overtakers],
    }


def plain_fields(record: NamedTuple) -> dict[str, Any]:
    """Return a record of numbers as a dictionary; a number that is not known is None."""

    def number(value: object) -> object:
        if isinstance(value, Mean):
            return {"mean": value.mean, "low": value.low, "high": value.high, "n": value.n}
        return value

    return without_nan({name: number(value) for name, value in record._asdict().items()})
