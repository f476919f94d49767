"""The heats of a campaign: a row for each race of several vehicles."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

import msgspec

from quadsim.campaign.run.attempt import LIBRARIES
from quadsim.campaign.run.database import Database, code_of
from quadsim.config.own import runs_own_code
from quadsim.heat.archive import heat_key
from quadsim.heat.spec import HeatSpec
from quadsim.record.provenance import this_provenance
from quadsim.record.run import canonical
from quadsim.record.schema import StoredEvent, StoredPlacing, StoredResult
from quadsim.results.heat import Heat


@dataclass(frozen=True)
class HeatRow:
    """One finished heat: each field is a column of the table."""

    key: str  # sha256 of the specification, the seed and the libraries
    code: str  # commit that flew it
    entrants: list[str]  # JSON
    seed: int
    rotation: int
    result: StoredResult  # JSON
    flown_at: str  # UTC


class HeatStore(Database[HeatRow]):
    """The heats of one campaign: `with HeatStore(path) as store`."""

    row_type = HeatRow
    json_fields = ("entrants", "result")
    table = "heats"
    made_by = "race compare-heats"

    def label(self, columns: Mapping[str, object]) -> str:
        """Return the name of a row for a message."""
        return f"the heat of seed {columns['seed']}"

    def checked(self, row: HeatRow) -> HeatRow:
        """Return the row. Raises ValueError unless each entrant has one place."""
        placed = sorted(placing.name for placing in row.result.order)
        if placed != sorted(row.entrants):
            raise ValueError(f"expected a place of each of {row.entrants}, got {placed}")
        return row

    def ended_by_own_error(self, row: HeatRow) -> bool:
        """Return whether an error of the user's own code has ended a flight of a heat."""
        if not row.result.faults:
            return False
        entrants = self.spec(row.key).get("entrants", [])
        own = {each["name"] for each in entrants if runs_own_code(each["spec"].get("own", {}))}
        return not own.isdisjoint(row.result.faults)

    def add(self, heat: HeatSpec, result: StoredResult, provenance: Mapping[str, Any]) -> bool:
        """Keep a heat, and return whether it was new. Raises RunError."""
        row = HeatRow(
            key=key_of(heat, provenance["versions"]),
            code=code_of(provenance),
            entrants=list(heat.names),
            seed=heat.seed,
            rotation=heat.rotation,
            result=msgspec.to_builtins(result),
            flown_at=time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        )
        return self.insert(row, heat.record())


def key_of(heat: HeatSpec, versions: Mapping[str, str | None] | None = None) -> str:
    """Return the key of a heat, the hash of its specification and of the libraries' versions.

    Args:
        heat: its specification.
        versions: versions of libraries by name; None: the versions of this process.
    """
    used = this_provenance()["versions"] if versions is None else versions
    libraries = {name: used.get(name) for name in LIBRARIES}
    return sha256(heat_key(heat.record()).encode() + canonical(libraries)).hexdigest()


def result_of(heat: Heat) -> StoredResult:
    """Return the numbers of a heat that a campaign keeps."""
    factors = [run.wall["real_time_factor"] for run in heat.runs]
    return StoredResult(
        order=[StoredPlacing(p.rank, p.name, p.outcome, p.time) for p in heat.order],
        events=[StoredEvent(e.kind, e.name, e.other, e.gate, e.lap) for e in heat.events],
        digest=heat.digest(),
        real_time_factor=min(factors),
        faults=dict(heat.faults),
    )
