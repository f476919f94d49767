"""Store: one SQLite file, one row an attempt; telemetry beside it, one folder a flight.

A row is written after its telemetry is on the disk, in one transaction: what has a row has been flown to its end.
Write-ahead logging and a busy timeout let several campaigns write at once.
"""

from __future__ import annotations

import json
import shutil
import sqlite3
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from quadsim.app.campaign.attempt import Flown, attempt_key, result, this_provenance, variant_key
from quadsim.race.spec import Spec
from quadsim.record.archive import RunFolder
from quadsim.record.run import RunError, canonical

PATIENCE = 60.0  # for another writer's transaction [s]
SCHEMA_VERSION = 1
SCHEMA = f"""
CREATE TABLE IF NOT EXISTS attempts (
    key TEXT NOT NULL,        -- sha256 of specification and seed
    code TEXT NOT NULL,       -- commit that flew it
    variant TEXT NOT NULL,        -- sha256 of the specification
    name TEXT NOT NULL,       -- what the variant was called when it flew
    course TEXT NOT NULL, sampler TEXT NOT NULL, preset TEXT NOT NULL, vehicle TEXT NOT NULL,
    randomize REAL NOT NULL, seed INTEGER NOT NULL,
    outcome TEXT NOT NULL,    -- finished, crashed, timeout
    result TEXT NOT NULL,     -- JSON, see attempt.result
    folder TEXT NOT NULL,     -- telemetry, relative to this file
    flown_at TEXT NOT NULL,   -- UTC
    spec TEXT NOT NULL,       -- JSON
    PRIMARY KEY (key, code)
);
CREATE INDEX IF NOT EXISTS attempts_by_variant ON attempts (variant, seed);
PRAGMA user_version = {SCHEMA_VERSION};
"""


@dataclass(frozen=True)
class Row:
    """One finished attempt."""

    key: str
    code: str
    variant: str
    name: str
    course: str
    sampler: str
    preset: str
    vehicle: str
    randomize: float
    seed: int
    outcome: str
    result: dict
    folder: str
    flown_at: str


COLUMNS = tuple(Row.__dataclass_fields__)


class Store:
    """`with Store(path) as store`. Raises RunError: one line, the path, what is wrong."""

    def __init__(self, path: Path, create: bool = True):
        self.path, self.flights = path, path.with_suffix(".flights")
        if not create and not path.exists():
            raise RunError(f"{path}: no such campaign; `race compare` makes one")
        with _one_line(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._db = sqlite3.connect(path, timeout=PATIENCE, isolation_level=None)
            version = self._db.execute("PRAGMA user_version").fetchone()[0]
            if version == 0:
                self._db.executescript(f"BEGIN IMMEDIATE; {SCHEMA} COMMIT;")
                with suppress(sqlite3.OperationalError):  # waits for nobody: whoever is in the way does the same
                    self._db.execute("PRAGMA journal_mode = WAL")
            elif version != SCHEMA_VERSION:
                raise RunError(f"{path}: expected a campaign of version {SCHEMA_VERSION}, got {version}")

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self._db.close()

    def add(self, spec: Spec, name: str, flown: Flown) -> bool:
        """Keep an attempt; False where somebody else has flown it meanwhile, whose row stays."""
        record = spec.record()
        folder = RunFolder.open(self.flights, record, flown.provenance).save(flown.run)
        row = Row(
            key=attempt_key(spec),
            code=code_of(flown.provenance),
            variant=variant_key(spec),
            name=name,
            course=spec.course.name,
            sampler=spec.sampler,
            preset=spec.preset,
            vehicle=spec.vehicle.name,
            randomize=spec.randomize,
            seed=spec.seed,
            outcome=flown.run.outcome,
            result=result(flown),
            folder=str(folder.relative_to(self.path.parent)),
            flown_at=time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        )
        values = [*vars(row).values(), record]
        values = [canonical(v).decode() if isinstance(v, dict) else v for v in values]
        with _one_line(self.path):
            marks = ", ".join("?" * len(values))
            added = self._db.execute(f"INSERT OR IGNORE INTO attempts VALUES ({marks})", values).rowcount == 1
        if not added:
            shutil.rmtree(folder)
        return added

    def rows(self, keys: Iterable[str] | None = None) -> list[Row]:
        """Attempts with these keys, or all, oldest first."""
        query, given = f"SELECT {', '.join(COLUMNS)} FROM attempts", ()
        if keys is not None:
            query, given = query + " WHERE key IN (SELECT value FROM json_each(?))", (json.dumps(list(keys)),)
        with _one_line(self.path):
            found = self._db.execute(query + " ORDER BY flown_at, seed", given).fetchall()
        return [_row(dict(zip(COLUMNS, values, strict=True))) for values in found]

    def spec(self, key: str) -> dict:
        """The full specification of an attempt."""
        with _one_line(self.path):
            return json.loads(self._db.execute("SELECT spec FROM attempts WHERE key = ?", (key,)).fetchone()[0])


def _row(values: dict) -> Row:
    return Row(**values | {"result": json.loads(values["result"])})


def this_code() -> str:
    """The code that flies in this process."""
    return code_of(this_provenance())


def code_of(provenance: dict) -> str:
    """Commit, or where there is no repository the version."""
    return provenance["git"] or f"version {provenance['versions']['quadsim']}"


@contextmanager
def _one_line(path: Path) -> Iterator[None]:
    try:
        yield
    except (sqlite3.Error, OSError) as error:
        raise RunError(f"{path}: cannot keep the campaign here: {error}") from error
