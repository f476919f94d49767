"""The flights of a campaign: a row for each attempt, and the telemetry of each beside the file.

The telemetry lies in one folder for each flight. A row is written after its telemetry is on the
disk, so that every row is a complete flight; only then does the telemetry's folder get its name.
"""

from __future__ import annotations

import shutil
import sqlite3
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from quadsim.campaign.run.attempt import Flown, Result, attempt_key, result, variant_key
from quadsim.campaign.run.database import FORMAT, Database, code_of, database_errors
from quadsim.config.spec import Spec
from quadsim.record.archive import RunFolder, remove_unfinished
from quadsim.record.run import ERROR, Outcome, flown_by

INDEX = "CREATE INDEX attempts_by_variant ON attempts (variant, seed)"


@dataclass(frozen=True)
class AttemptRow:
    """One finished attempt: each field is a column of the table."""

    key: str  # sha256 of specification, seed and libraries
    code: str  # commit that flew it
    variant: str  # sha256 of the same without the seed
    name: str  # of the variant, when it flew
    course: str
    sampler: str  # sampler, pilot or controller, see quadsim.record.run.flown_by
    preset: str
    vehicle: str
    randomize: float
    seed: int
    outcome: Outcome
    result: Result  # JSON
    folder: str  # telemetry, relative to the file; empty if it is not kept
    flown_at: str  # UTC


class Store(Database[AttemptRow]):
    """The attempts of one campaign: `with Store(path) as store`."""

    row_type = AttemptRow
    table = "attempts"
    made_by = "race compare"

    def __init__(self, path: Path, create: bool = True):
        """Open a campaign.

        Args:
            path: the SQLite file.
            create: make the file if there is none, and remove telemetry that a killed command has
                left unfinished.

        Raises:
            RunError: the file cannot be used.
        """
        super().__init__(path, create)
        self.flights = path.with_suffix(".flights")
        if create:
            with database_errors(path):
                remove_unfinished(self.flights, self._has)

    def _create_table(self) -> None:
        super()._create_table()
        self._db.execute(INDEX)

    def label(self, columns: Mapping[str, object]) -> str:
        """Return the name of a row for a message."""
        return f"the attempt {columns['name']} seed {columns['seed']}"

    def add(
        self, spec: Spec, name: str, flown: Flown, telemetry: bool = True, twin: int = 0
    ) -> bool:
        """Keep an attempt.

        Args:
            spec: specification of the flight.
            name: name of its variant.
            flown: the flight.
            telemetry: whether to keep its telemetry too.
            twin: see quadsim.campaign.run.variants.Variant.

        Returns:
            False if another campaign has stored this attempt meanwhile; its row stays.

        Raises:
            RunError: the file cannot be written.
        """
        if not telemetry:
            return self._add(spec, name, flown, folder="", twin=twin)
        with RunFolder.open(self.flights, spec.record(), flown.provenance) as folder:
            folder.write(flown.run)
            relative = str(folder.path.relative_to(self.path.parent))
            added = self._add(spec, name, flown, relative, twin)
            if added:
                folder.finish()
            else:
                folder.drop()
        return added

    def _add(self, spec: Spec, name: str, flown: Flown, folder: str, twin: int) -> bool:
        """Insert the row of an attempt, and return whether it was inserted."""
        record = spec.record()
        versions = flown.provenance["versions"]
        row = AttemptRow(
            key=attempt_key(record, versions, twin),
            code=code_of(flown.provenance),
            variant=variant_key(record, versions, twin),
            name=name,
            course=record["course"]["name"],
            sampler=flown_by(record),
            preset=record["preset"],
            vehicle=record["vehicle"]["name"],
            randomize=record["randomize"],
            seed=record["seed"],
            outcome=cast(Outcome, flown.run.outcome),
            result=result(flown),
            folder=folder,
            flown_at=time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        )
        return self.insert(row, record)

    def ended_by_own_error(self, row: AttemptRow) -> bool:
        """Return whether an error of the user's own code has ended an attempt."""
        return row.outcome == ERROR

    def forgotten(self, row: AttemptRow) -> None:
        """Remove the telemetry of an attempt."""
        folder = self.path.parent / row.folder
        if row.folder and folder.parent == self.flights:
            shutil.rmtree(folder, ignore_errors=True)

    def _has(self, folder: str) -> bool:
        """Return whether a row names this folder of telemetry."""
        name = str((self.flights / folder).relative_to(self.path.parent))
        query = "SELECT 1 FROM attempts WHERE folder = ?"
        return self._db.execute(query, (name,)).fetchone() is not None


def is_campaign(path: Path) -> bool:
    """Return whether a file is a campaign of this format. It is not changed."""
    try:
        db = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)
    except sqlite3.Error:
        return False
    try:
        (version,) = db.execute("PRAGMA user_version").fetchone()
        query = "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name = 'attempts'"
        (tables,) = db.execute(query).fetchone()
    except sqlite3.Error:
        return False
    finally:
        db.close()
    return version == FORMAT and tables == 1
