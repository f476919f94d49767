"""Many races of the same entrants: flown in parallel, kept one by one, and summed up."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from hashlib import sha256
from itertools import combinations
from pathlib import Path
from typing import NamedTuple, TypedDict

import msgspec
import numpy as np
from scipy.optimize import minimize

from quadsim.campaign.attempt import LIBRARIES, this_provenance
from quadsim.campaign.pool import open_pool, run_all
from quadsim.campaign.runner import Tally
from quadsim.campaign.store import BUSY_TIMEOUT, code_of
from quadsim.console import complain
from quadsim.heat.archive import heat_key
from quadsim.heat.spec import HeatSpec
from quadsim.record.run import RunError, canonical
from quadsim.record.schema import StoredPlacing, StoredResult
from quadsim.record.statistics import Mean, mean_interval, wilson
from quadsim.results.heat import Heat, fly_heat

# Points of a rating by which one entrant beats another ten times as often as it loses
RATING_SCALE = 400.0
MEAN_RATING = 1500.0
# Draws that each pair is credited with, so that ratings are finite if one always wins
PRIOR_DRAWS = 1.0
Z = 1.959963984540054  # of a 95 % interval


class Result(TypedDict):
    """A campaign keeps these numbers of a race."""

    order: list[dict]  # placings, see quadsim.heat.result.Placing
    events: list[dict]  # see quadsim.heat.result.HeatEvent
    real_time_factor: float
    digest: str


class KeptHeat(NamedTuple):
    """A race that has been flown."""

    heat: HeatSpec
    result: Result


class HeatStore:
    """The SQLite file of a campaign of races; each of them is there whole or not at all."""

    def __init__(self, path: Path):
        """Open the file, or make it.

        Raises:
            RunError: it cannot be read or written, or is no such file.
        """
        self._path = path
        with self._one_line():
            path.parent.mkdir(parents=True, exist_ok=True)
            self._db = sqlite3.connect(path, timeout=BUSY_TIMEOUT)
            self._db.execute(
                "CREATE TABLE IF NOT EXISTS heats (key TEXT PRIMARY KEY, seed INTEGER,"
                " rotation INTEGER, code TEXT, result TEXT)"
            )
            self._db.commit()

    def close(self) -> None:
        """Close the file."""
        self._db.close()

    def read(self, key: str) -> StoredResult | None:
        """Return the race of a key, None if it has not been flown. Raises RunError."""
        with self._one_line():
            rows = self._db.execute("SELECT result FROM heats WHERE key = ?", (key,)).fetchall()
            return msgspec.json.decode(rows[0][0], type=StoredResult) if rows else None

    def write(self, key: str, heat: HeatSpec, result: Result, code: str) -> None:
        """Keep a race. Raises RunError."""
        text = json.dumps(result, allow_nan=False)
        with self._one_line(), self._db:
            self._db.execute(
                "INSERT OR REPLACE INTO heats VALUES (?, ?, ?, ?, ?)",
                (key, heat.seed, heat.rotation, code, text),
            )

    @contextmanager
    def _one_line(self) -> Iterator[None]:
        """Turn the errors of SQLite and of damaged rows into a RunError."""
        try:
            yield
        except (sqlite3.Error, OSError, msgspec.DecodeError, msgspec.ValidationError) as error:
            raise RunError(f"{self._path}: cannot keep races here: {error}") from error


def flown_result(heat: HeatSpec) -> Result:
    """Fly a race and return what is kept of it. Workers call it."""
    return result_of(fly_heat(heat))


def result_of(heat: Heat) -> Result:
    """Return what is kept of a race."""
    factors = [run.wall["real_time_factor"] for run in heat.runs]
    return {
        "order": [placing._asdict() for placing in heat.order],
        "events": [event._asdict() for event in heat.events],
        "real_time_factor": min(factors),
        "digest": heat.digest(),
    }


def key_of(heat: HeatSpec) -> str:
    """Return the key of a race: the hash of all that decides it, and of the libraries' versions."""
    versions = this_provenance()["versions"]
    libraries = {name: versions.get(name) for name in LIBRARIES}
    return sha256(heat_key(heat).encode() + canonical(libraries)).hexdigest()


def fly_heats(
    heats: Sequence[HeatSpec], campaign: Path, jobs: int | None = None
) -> list[StoredResult | None]:
    """Fly the races that a campaign lacks, and return all of them in order.

    Each is kept as soon as it has ended. A race that was lost twice with its worker is reported,
    and is None.

    Args:
        heats: the races.
        campaign: the SQLite file.
        jobs: the number of workers, see `open_pool`.

    Raises:
        RunError: the file cannot be read or written.
        KeyboardInterrupt: what has been flown until then is kept.
    """
    store = HeatStore(campaign)
    keys = {id(heat): key_of(heat) for heat in heats}
    try:
        missing = [heat for heat in heats if store.read(keys[id(heat)]) is None]
        if missing:
            code = code_of(this_provenance())
            with Tally(len(heats), len(heats) - len(missing)) as tally, open_pool(jobs) as pool:
                for heat, result in run_all(pool, flown_result, missing):
                    label = f"{heat.course.name} seed {heat.seed}"
                    if result is None:
                        complain(f"{label}: lost twice with its worker, not flown")
                        continue
                    store.write(keys[id(heat)], heat, result, code)
                    tally.count(f"{label}: first {result['order'][0]['name']}")
        return [store.read(keys[id(heat)]) for heat in heats]
    except KeyboardInterrupt:
        if not any(store.read(key) for key in keys.values()):
            raise
        kept = f"what has been flown is kept in {campaign}: the same command continues there"
        raise KeyboardInterrupt(kept) from None
    finally:
        store.close()


class EntrantStats(NamedTuple):
    """The numbers of one entrant over many races."""

    name: str
    races: int
    finished: int
    finished_ci: tuple[float, float]
    wins: int
    wins_ci: tuple[float, float]
    rank: Mean
    # of those that finished [s]
    race: Mean
    overtakes: Mean  # of others, in a race
    overtaken: Mean
    rating: float
    # half of its 95 % interval
    rating_error: float


class PairStats(NamedTuple):
    """How often one entrant came in before another."""

    a: str
    b: str
    races: int
    a_first: int
    ci: tuple[float, float]


class OvertakeStats(NamedTuple):
    """How often and how soon one entrant overtook another."""

    name: str
    other: str
    # races in which it did so at least once
    races: int
    # gates that it had passed when it first did
    gates: Mean


class HeatsSummary(NamedTuple):
    """The numbers of many races."""

    races: int
    entrants: list[EntrantStats]
    pairs: list[PairStats]
    overtakers: list[OvertakeStats]
    # flights that finished, of all
    flights: int
    finished: int
    finished_ci: tuple[float, float]
    # time of those that finished [s]
    race: Mean
    # races with a contact of two vehicles
    with_contact: int
    contact_ci: tuple[float, float]
    contacts: int
    overtakes: Mean  # in a race


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
        pairs.append(PairStats(a, b, len(ranks), first, wilson(first, len(ranks))))
    ratings = bradley_terry(names, pairs)
    entrants = [_entrant_stats(name, ranks, results, *ratings[name]) for name in names]
    flights = len(names) * len(results)
    finished = sum(entrant.finished for entrant in entrants)
    contacts = [sum(event.kind == "contact" for event in result.events) for result in results]
    overtakes = [sum(event.kind == "overtake" for event in result.events) for result in results]
    with_contact = sum(count > 0 for count in contacts)
    times = [placing.time for result in results for placing in result.order]
    return HeatsSummary(
        races=len(results),
        entrants=entrants,
        pairs=pairs,
        overtakers=list(_overtakers(results, gates)),
        flights=flights,
        finished=finished,
        finished_ci=wilson(finished, flights),
        race=mean_interval([time for time in times if time is not None]),
        with_contact=with_contact,
        contact_ci=wilson(with_contact, len(results)),
        contacts=sum(contacts),
        overtakes=mean_interval([float(count) for count in overtakes]),
    )


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


def bradley_terry(
    names: Sequence[str], pairs: Sequence[PairStats]
) -> dict[str, tuple[float, float]]:
    """Return a rating of each entrant and half of its 95 % interval.

    By the model of Bradley and Terry (1952) entrant a comes in before b with the probability
    1 / (1 + exp(s_b - s_a)). The strengths s are those of the greatest likelihood, with PRIOR_DRAWS
    added to each pair. Their mean is zero. A rating is MEAN_RATING + RATING_SCALE s / log(10), the
    scale of Elo. The interval is that of the likelihood's curvature.

    Args:
        names: names of the entrants.
        pairs: how often one came in before another.
    """
    index = {name: k for k, name in enumerate(names)}
    n = len(names)
    wins = np.zeros((n, n))
    for pair in pairs:
        a, b = index[pair.a], index[pair.b]
        wins[a, b] += pair.a_first + 0.5 * PRIOR_DRAWS
        wins[b, a] += pair.races - pair.a_first + 0.5 * PRIOR_DRAWS
    games = wins + wins.T

    def cost(s: np.ndarray) -> float:
        """Return the negative log likelihood, and a term that keeps the mean at zero."""
        ahead = s[:, None] - s[None, :]
        return float((wins * np.logaddexp(0.0, -ahead)).sum() + 0.5 * s.sum() ** 2)

    found = minimize(cost, np.zeros(n), method="BFGS")
    s = found.x - found.x.mean()

    # The curvature of the likelihood, whose direction of equal strengths is taken out
    p = 1.0 / (1.0 + np.exp(s[None, :] - s[:, None]))
    information = games * p * (1.0 - p)
    curvature = np.diag(information.sum(axis=1)) - information
    covariance = np.linalg.pinv(curvature)
    scale = RATING_SCALE / np.log(10.0)
    return {
        name: (MEAN_RATING + scale * float(s[k]), Z * scale * float(np.sqrt(covariance[k, k])))
        for name, k in index.items()
    }
