"""The runner flies the missing heats of a campaign and keeps each as soon as it has ended."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Self

from quadsim.campaign.heats.store import HeatRow, HeatStore, key_of, result_of
from quadsim.campaign.run.attempt import (
    use_one_thread_in_a_worker,
    with_fresh_parts,
)
from quadsim.campaign.run.database import code_of
from quadsim.campaign.run.pool import run_all
from quadsim.campaign.run.runner import (
    CampaignRunner,
    Tally,
    expect_same_libraries,
    expect_same_parts,
)
from quadsim.campaign.run.variants import expect_identity, expect_importable
from quadsim.console import complain, uninterrupted
from quadsim.heat.spec import HeatSpec
from quadsim.record.provenance import this_provenance
from quadsim.record.schema import StoredResult
from quadsim.results.heat import fly_heat


class FlownHeat(NamedTuple):
    """A heat that a worker has flown."""

    result: StoredResult
    # the record of its specification, as the worker had it
    record: dict[str, Any]
    # versions, commit and processor of the worker
    provenance: dict[str, Any]


def fly_heat_alone(heat: HeatSpec) -> FlownHeat:
    """Fly a heat, in a worker process on one thread."""
    use_one_thread_in_a_worker()
    if any(entrant.spec.own_objects() for entrant in heat.entrants):
        heat = with_fresh_parts(heat)
    # Before the flights, as these name the code and the parts that fly.
    flown_by = this_provenance()
    record = heat.record()
    return FlownHeat(result_of(fly_heat(heat)), record, flown_by)


class HeatRunner(CampaignRunner):
    """Flies the missing heats of a campaign.

    Use it as `with HeatRunner(path) as runner: rows = runner(heats)`.
    """

    def __enter__(self) -> Self:
        self._store = self._open.enter_context(HeatStore(self.campaign))
        return self

    def __call__(self, heats: Sequence[HeatSpec]) -> list[HeatRow | None]:
        """Return all heats in order; the missing ones are flown.

        A heat that was lost twice with its worker is reported, and is None.

        Raises:
            RunError: the campaign cannot be read or written, or a worker has other libraries or
                other parts of the user's own.
            SettingError: a part of the user's own has no identity.
            KeyboardInterrupt: Ctrl-C; the heats that have finished are kept.
        """
        if not self._temporary:
            for entrant in {id(e): e for heat in heats for e in heat.entrants}.values():
                expect_identity(entrant.spec)
        keys = [key_of(heat) for heat in heats]
        wanted = dict(zip(keys, heats, strict=True))
        self._forget_errors(self._store, wanted, "races")
        rows = self._rows(wanted)
        self._kept += len(rows)
        missing = [heat for key, heat in wanted.items() if key not in rows]
        if missing and not self.pool.in_this_process:
            for entrant in missing[0].entrants:
                expect_importable(entrant.spec)
        if missing:
            with Tally(len(wanted), len(rows)) as tally:
                self._fly(missing, tally)
            rows = self._rows(wanted)
        return [rows.get(key) for key in keys]

    def _fly(self, missing: Sequence[HeatSpec], tally: Tally) -> None:
        """Fly heats, and keep each as soon as it has ended."""
        for heat, flown in run_all(self.pool, fly_heat_alone, missing):
            label = f"{heat.course.name} seed {heat.seed}"
            if flown is None:
                complain(f"{label}: lost twice with its worker, not flown")
                continue
            if not self.pool.in_this_process:
                _expect_same_entrants(heat, flown)
            with uninterrupted():
                self._store.add(heat, flown.result, flown.provenance)
            self._kept += 1
            expect_same_libraries(flown.provenance["versions"])
            for name, fault in flown.result.faults.items():
                complain(f"{label}: {name} is out: {fault}")
            tally.count(f"{label}: first {flown.result.order[0].name}")

    def _rows(self, keys: Mapping[str, HeatSpec]) -> dict[str, HeatRow]:
        """Return the stored row of each heat, by key; see `Database.newest`."""
        return self._store.newest(keys, code_of(this_provenance()), self._this_commit)


def _expect_same_entrants(heat: HeatSpec, flown: FlownHeat) -> None:
    """Raise RunError if a worker has flown with other parts of the user's own."""
    for entrant, record in zip(heat.entrants, flown.record["entrants"], strict=True):
        expect_same_parts(entrant.name, entrant.spec, record["spec"])
