"""Damaged campaigns: the file, its table, or the JSON in a row; listed, compared and continued."""

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
    "DROP TABLE attempts", "DELETE FROM attempts", "PRAGMA user_version = 99",
    "PRAGMA user_version = 1", "PRAGMA user_version = 0",
    "ALTER TABLE attempts RENAME COLUMN result TO results",
    "ALTER TABLE attempts RENAME TO flown", "ALTER TABLE attempts ADD COLUMN more TEXT",
    "DROP TABLE attempts; CREATE TABLE attempts (key TEXT)", "UPDATE attempts SET seed = 0",
    "DROP TABLE trials", "DELETE FROM trial_params", "UPDATE trials SET state = 'x'",
    "DELETE FROM alembic_version",
)  # fmt: skip


def databases(rng: random.Random) -> Case:
    """Return a case with a damaged campaign, mostly listed, now and then continued."""
    seed = rng.randrange(2**32)
    ids = campaign_base().variants
    listings = (("results",), ("results", "--json"), ("results", *ids), ("results", *ids, "--json"))
    argv = rng.choice(listings)
    kind = rng.random()
    if kind < 0.1:
        argv = COMPARE
    elif kind < 0.25:
        argv = TUNE
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
    """Change one cell, of one row or of all."""
    db.row_factory = sqlite3.Row
    row = rng.choice(db.execute("SELECT rowid, * FROM attempts").fetchall())
    names = [name for name in tuple(row.keys()) if name != "rowid"]
    column = rng.choice(["result"] * 4 + ["spec"] * 3 + names)
    if column in ("result", "spec") and rng.random() < 0.85:
        value = damaged_json(rng, row[column])
    else:
        value = rng.choice([value for value in VALUES if _fits(value)])
    where = "" if rng.random() < 0.2 else f" WHERE rowid = {row['rowid']}"
    db.execute(f"UPDATE OR IGNORE attempts SET {column} = ?{where}", (value,))


def _fits(value: object) -> bool:
    """Return whether SQLite can hold a value."""
    if isinstance(value, int):
        return abs(value) < 2**63
    return isinstance(value, str | float | bytes)
