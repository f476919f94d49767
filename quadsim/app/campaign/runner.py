"""Runner a campaign: fly what is missing, keep each attempt as it lands."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import cached_property
from pathlib import Path

from quadsim.app.campaign.attempt import attempt_key
from quadsim.app.campaign.common_flags import Workers
from quadsim.app.campaign.pool import Pool, fly_all
from quadsim.app.campaign.progress import Tally
from quadsim.app.campaign.store import Row, Store, this_code
from quadsim.app.campaign.variants import Variant
from quadsim.app.console import complain
from quadsim.app.fly import uninterrupted
from quadsim.race.spec import Spec


class Runner:
    """`with Runner(...) as conduct: rows = conduct(variants, attempts)`. Workers start with the first missing attempt."""

    def __init__(self, campaign: Path, workers: Workers, this_commit: bool):
        """this_commit: count only what this commit has flown."""
        self.campaign, self._workers, self._this_commit = campaign, workers, this_commit
        self._open = ExitStack()

    def __enter__(self) -> Runner:
        self._store = self._open.enter_context(Store(self.campaign))
        return self

    def __exit__(self, *error: object) -> None:
        self._open.close()
        if any(error):
            complain(f"what has been flown is kept in {self.campaign}: the same command goes on there")

    @cached_property
    def pool(self) -> Pool:
        return self._open.enter_context(self._workers.start())

    def __call__(self, variants: Sequence[Variant], attempts: int, quiet: bool = False) -> list[list[Row]]:
        """Every attempt of every variant by seed; lost ones are missing. Raises RunError, UsageError, KeyboardInterrupt."""
        keys = [{attempt_key(spec): (variant, spec) for spec in variant.attempts(attempts)} for variant in variants]
        wanted = dict(pair for seed in zip(*(k.items() for k in keys), strict=True) for pair in seed)  # seed by seed
        before = self._counting(self._store.rows(wanted))
        missing = [pair for key, pair in wanted.items() if key not in before]
        if missing and quiet:
            self._fly(missing, lambda _: None)
        elif missing:
            with Tally(len(wanted), len(before)) as tally:
                self._fly(missing, tally.count)
        rows = self._counting(self._store.rows(wanted)) if missing else before
        return [[rows[k] for k in of_variant if k in rows] for of_variant in keys]

    def _counting(self, rows: Sequence[Row]) -> dict[str, Row]:
        """By key: of several commits this one, else the latest."""
        code = this_code()
        rows = [r for r in rows if r.code == code or not self._this_commit]
        return {r.key: r for r in sorted(rows, key=lambda r: (r.code == code, r.flown_at))}

    def _fly(self, missing: Sequence[tuple[Variant, Spec]], count: Callable[[str], None]) -> None:
        variant_of = {id(spec): variant for variant, spec in missing}
        for spec, flown in fly_all(self.pool, [spec for _, spec in missing]):
            variant = variant_of[id(spec)]
            said = f"{spec.course.name} {variant.name} seed {spec.seed}: "
            if flown is None:
                complain(f"{said}lost twice with its worker, not flown")
                continue
            with uninterrupted():
                self._store.add(spec, variant.name, flown)
            count(said + flown.run.outcome)
