"""Campaigns with damage to the file, to a table or to the JSON in a row are listed, compared and
continued, with their searches."""

from __future__ import annotations

import random
import shutil
import sqlite3
from contextlib import closing, suppress
from functools import partial
from pathlib import Path

from tests.fuzz.base import COMPARE, TUNE, campaign_base
from tests.fuzz.damage import VALUES, damaged_bytes, damaged_json
from tests.fuzz.harness import Case

TABLE = (
    "DROP TABLE attempts", "DELETE FROM attempts", "PRAGMA user_version = 99", "PRAGMA user_version = 1",
    "PRAGMA user_version = 0", "ALTER TABLE attempts RENAME COLUMN result TO results",
    "ALTER TABLE attempts RENAME TO flown", "ALTER TABLE attempts ADD COLUMN more TEXT",
    "DROP TABLE attempts; CREATE TABLE attempts (key TEXT)", "UPDATE attempts SET seed = 0",
    "DROP TABLE trials", "DELETE FROM trial_params", "UPDATE trials SET state = 'x'", "DELETE FROM alembic_version",
)  # fmt: skip


def databases(rng: random.Random) -> Case:
    seed, ids = rng.randrange(2**32), campaign_base().variants
    argv = rng.choice(
        (("results",), ("results", "--json"), ("results", *ids), ("results", *ids, "--json"))
    )
    if rng.random() < 0.3:
        argv = rng.choice((COMPARE, TUNE, TUNE))
    return Case("databases", f"seed {seed}: {' '.join(argv)}", argv, partial(_damage, seed))


def _damage(seed: int, folder: Path) -> None:
    rng = random.Random(seed)
    shutil.copytree(campaign_base().campaign, folder / "campaigns")
    path = folder / "campaigns" / "race.sqlite"
    kind = rng.random()
    if kind < 0.25:
        path.write_bytes(damaged_bytes(rng, path.read_bytes()))
    elif kind < 0.3:
        shutil.rmtree(folder / "campaigns" / "race.flights")
    else:
        with closing(sqlite3.connect(path)) as db, db, suppress(sqlite3.Error):
            if kind < 0.4:
                db.executescript(rng.choice(TABLE))
            else:
                _damage_row(rng, db)


def _damage_row(rng: random.Random, db: sqlite3.Connection) -> None:
    """One cell of one row, or of all."""
    db.row_factory = sqlite3.Row
    row = rng.choice(db.execute("SELECT rowid, * FROM attempts").fetchall())
    column = rng.choice(["result"] * 4 + ["spec"] * 3 + [c for c in row.keys() if c != "rowid"])  # noqa: SIM118
    if column in ("result", "spec") and rng.random() < 0.85:
        value = damaged_json(rng, row[column])
    else:
        value = rng.choice(
            [v for v in VALUES if isinstance(v, str | int | float | bytes) and abs_less(v)]
        )
    where = "" if rng.random() < 0.2 else f" WHERE rowid = {row['rowid']}"
    db.execute(f"UPDATE OR IGNORE attempts SET {column} = ?{where}", (value,))


def abs_less(value: object) -> bool:
    """Whether SQLite can hold it."""
    return not isinstance(value, int) or abs(value) < 2**63
