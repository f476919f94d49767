"""Conduct a campaign: fly what is missing, keep each attempt as it lands."""

from __future__ import annotations

import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import DisallowNone, arg

from quadsim.app.campaign.arms import Arm
from quadsim.app.campaign.attempt import attempt_key
from quadsim.app.campaign.pool import fly_all, open_pool
from quadsim.app.campaign.progress import Tally
from quadsim.app.campaign.store import Row, Store, this_code
from quadsim.app.console import complain
from quadsim.app.flags import otherwise
from quadsim.app.flight_flags import Count
from quadsim.app.fly import uninterrupted
from quadsim.app.spec import Spec

SUFFIX = ".sqlite"
Jobs = Annotated[Count | None, DisallowNone, otherwise("every core")]
Scheduler = Annotated[str | None, DisallowNone, arg(metavar="tcp://HOST:PORT"), otherwise("processes here")]
Campaign = Annotated[str, arg(metavar="FILE.sqlite")]
CAMPAIGN = "campaigns/race.sqlite"


@dataclass(frozen=True)
class Conduct:
    """How to fly: where attempts are kept, on what they fly, which of those kept count."""

    campaign: Path
    jobs: int | None
    scheduler: str | None
    this_commit: bool  # count only what this commit has flown

    def __call__(self, arms: Sequence[Arm], attempts: int) -> list[list[Row]]:
        """Every attempt of every arm by seed; lost ones are missing. Raises RunError, UsageError, KeyboardInterrupt."""
        keys = [{attempt_key(spec): (arm, spec) for spec in arm.attempts(attempts)} for arm in arms]
        wanted = dict(pair for seed in zip(*(k.items() for k in keys), strict=True) for pair in seed)  # seed by seed
        with Store(self.campaign) as store:
            before = self._counting(store.rows(wanted))
            missing = [pair for key, pair in wanted.items() if key not in before]
            if missing:
                self._fly(store, missing, len(wanted))
            rows = self._counting(store.rows(wanted))
        return [[rows[k] for k in of_arm if k in rows] for of_arm in keys]

    def _counting(self, rows: Sequence[Row]) -> dict[str, Row]:
        """By key: of several commits this one, else the latest."""
        code = this_code()
        rows = [r for r in rows if r.code == code or not self.this_commit]
        return {r.key: r for r in sorted(rows, key=lambda r: (r.code == code, r.flown_at))}

    def _fly(self, store: Store, missing: list[tuple[Arm, Spec]], total: int) -> None:
        arm_of = {id(spec): arm for arm, spec in missing}
        with (
            open_pool(self.jobs, self.scheduler) as pool,
            Tally(total, total - len(missing)) as tally,
            _resumable(store),
        ):
            for spec, flown in fly_all(pool, [spec for _, spec in missing]):
                arm = arm_of[id(spec)]
                said = f"{spec.course.name} {arm.name} seed {spec.seed}: "
                if flown is None:
                    complain(f"{said}lost twice with its worker, not flown")
                    continue
                with uninterrupted():
                    store.add(spec, arm.name, flown)
                tally.count(said + flown.run.outcome)


@contextmanager
def _resumable(store: Store) -> Iterator[None]:
    """SIGTERM ends like Ctrl-C; whatever ends it, what has landed is kept."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    except BaseException:
        complain(f"what has been flown is kept in {store.path}: the same command goes on there")
        raise
    finally:
        signal.signal(signal.SIGTERM, before)
