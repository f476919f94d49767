"""The runner flies the missing attempts of a campaign and keeps each as soon as it has finished.

It shows its progress on stderr.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, nullcontext
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Self

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from quadsim.campaign.run.attempt import LIBRARIES, Flown, attempt_key
from quadsim.campaign.run.database import Database, code_of
from quadsim.campaign.run.pool import Pool, fly_all, open_pool
from quadsim.campaign.run.store import AttemptRow, Store
from quadsim.campaign.run.variants import Variant, expect_identities, expect_importable
from quadsim.config.spec import Spec
from quadsim.console import complain, progress_console, uninterrupted
from quadsim.record.provenance import this_provenance
from quadsim.record.run import RunError


class PlannedAttempt(NamedTuple):
    """A flight that the campaign lacks, with the variant that it belongs to."""

    variant: Variant
    spec: Spec


class FlownAttempt(NamedTuple):
    """A flight that a worker has flown, with the variant that it belongs to."""

    variant: Variant
    spec: Spec
    flown: Flown


class Tally(Progress):
    """A bar that counts attempts: `with Tally(10) as tally: tally.count("seed 0")`.

    If stderr is not a terminal, each attempt is one line instead.
    """

    def __init__(self, total: int, kept: int = 0):
        """Begin a tally.

        Args:
            total: the number of attempts.
            kept: how many of them were flown before.
        """
        if kept:
            complain(f"{kept} of {total} attempts are kept from before")
        console = progress_console()
        columns = (
            BarColumn(24),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.description}"),
        )
        super().__init__(*columns, console=console, transient=True, disable=not console.is_terminal)
        self._kept = kept
        self.add_task("", total=total, completed=kept)

    def count(self, note: str) -> None:
        """Count one attempt; the note says which, and how it ended."""
        (task,) = self.tasks
        self.advance(task.id)
        if task.remaining:
            # The mean covers all attempts since the start, as several often end at once.
            each = (task.elapsed or 0.0) / (task.completed - self._kept)
            note += f", {each * task.remaining:.0f} s left"
        self.update(task.id, description=note)
        if self.disable:
            complain(f"{task.completed:.0f}/{task.total:.0f} {note}")


def fly_attempts(
    pool: Pool, attempts: Sequence[PlannedAttempt], tally: Tally | None
) -> Iterator[FlownAttempt]:
    """Yield attempts as they finish.

    One that is lost twice with its worker is reported and left out. An error that ended attempts of
    a variant is reported once.
    """
    variants = {id(attempt.spec): attempt.variant for attempt in attempts}
    told: set[tuple[str, str, str]] = set()
    for spec, flown in fly_all(pool, [attempt.spec for attempt in attempts]):
        variant = variants[id(spec)]
        label = f"{variant.course} {variant.name} seed {spec.seed}"
        if flown is None:
            complain(f"{label}: lost twice with its worker, not flown")
            continue
        fault = (variant.course, variant.name, flown.fault or "")
        if flown.fault and fault not in told:
            told.add(fault)
            complain(f"{label}: ended by an error: {flown.fault}")
        yield FlownAttempt(variant, spec, flown)
        if tally:
            tally.count(f"{label}: {flown.run.outcome}")


class CampaignRunner:
    """Holds the workers of a campaign, and says what is kept if a campaign ends early.

    The first access to `pool` starts the workers.
    """

    def __init__(
        self,
        campaign: Path,
        jobs: int | None = None,
        scheduler: str | None = None,
        this_commit: bool = False,
        temporary: bool = False,
    ):
        """Prepare to fly.

        Args:
            campaign: the SQLite file.
            jobs: the number of workers, see `open_pool`.
            scheduler: address of a Dask cluster, or "slurm", see `open_pool`.
            this_commit: count only what this commit has flown.
            temporary: the campaign is used by one call only, so that parts without an identity can
                fly in it.
        """
        self.campaign = campaign
        self._jobs = jobs
        self._scheduler = scheduler
        self._this_commit = this_commit
        self._temporary = temporary
        self._kept = 0  # flights or heats that are in the campaign
        self._flown: set[str] = set()  # keys of what this runner has been asked for
        self._open = ExitStack()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self._open.close()
        if error is None or not self._kept:
            return
        kept = f"what has been flown is kept in {self.campaign}: the same command continues there"
        if self._temporary:
            kept = "what has been flown is not kept: give campaign='mine.sqlite' to continue later"
        if isinstance(error, KeyboardInterrupt):
            raise KeyboardInterrupt(kept) from None
        complain(kept)

    def _forget_errors(self, store: Database[Any], keys: Iterable[str], what: str) -> None:
        """Remove the rows that an error of the user's own code has ended, to fly them again.

        Args:
            store: the campaign.
            keys: the keys that are wanted.
            what: "attempts" or "heats", for the message.
        """
        before = [key for key in keys if key not in self._flown]
        self._flown.update(before)
        again = store.forget_errors(before)
        if again:
            ended = f"{again} {what} ended" if again > 1 else f"1 of the {what} ended"
            are = "are" if again > 1 else "is"
            complain(f"{ended} in an error of your own code and {are} flown again")

    @cached_property
    def pool(self) -> Pool:
        """Return the workers, which the first access starts. Raises RunError."""
        return self._open.enter_context(open_pool(self._jobs, self._scheduler))


class Runner(CampaignRunner):
    """Flies the missing flights of a campaign, and keeps their telemetry.

    Use it as `with Runner(path) as runner: rows = runner(variants, 10)`.
    """

    def __enter__(self) -> Self:
        self._store = self._open.enter_context(Store(self.campaign))
        return self

    def __call__(
        self, variants: Sequence[Variant], attempts: int, quiet: bool = False
    ) -> list[list[AttemptRow]]:
        """Return the attempts of every variant; the missing ones are flown.

        Args:
            variants: variants of one comparison or search.
            attempts: the number of consecutive seeds.
            quiet: show no progress.

        Returns:
            The rows of each variant by seed, without lost attempts.

        Raises:
            RunError: the campaign cannot be read or written, or a worker has other libraries.
            SettingError: a part of the user's own has no identity.
            KeyboardInterrupt: Ctrl-C; the attempts that have finished are kept.
        """
        if not self._temporary:
            expect_identities(variants)
        wanted = [
            {
                attempt_key(spec.record(), twin=variant.twin): PlannedAttempt(variant, spec)
                for spec in variant.attempts(attempts)
            }
            for variant in variants
        ]
        # Seed by seed, so that an interrupted campaign has pairs to compare.
        by_seed = zip(*(of_variant.items() for of_variant in wanted), strict=True)
        in_order = dict(pair for of_seed in by_seed for pair in of_seed)

        self._forget_errors(self._store, in_order, "attempts")
        rows = self._rows(in_order)
        self._kept += len(rows)
        missing = [attempt for key, attempt in in_order.items() if key not in rows]
        if missing and not self.pool.in_this_process:
            for variant in variants:
                expect_importable(variant.spec)
        if missing:
            with nullcontext() if quiet else Tally(len(in_order), len(rows)) as tally:
                for variant, spec, flown in fly_attempts(self.pool, missing, tally):
                    if not self.pool.in_this_process:
                        expect_same_parts(variant.name, spec, flown.run.spec)
                    with uninterrupted():
                        self._store.add(spec, variant.name, flown, twin=variant.twin)
                    self._kept += 1
                    expect_same_libraries(flown.provenance["versions"])
            rows = self._rows(in_order)
        return [[rows[key] for key in of_variant if key in rows] for of_variant in wanted]

    def _rows(self, keys: Iterable[str]) -> dict[str, AttemptRow]:
        """Return the stored row of each attempt, by key; see `Database.newest`."""
        return self._store.newest(keys, code_of(this_provenance()), self._this_commit)


def expect_same_parts(name: str, spec: Spec, flown: Mapping[str, Any]) -> None:
    """Check that a worker has flown with this process's parts of the user's own.

    A worker imports the code anew, without what this process has set since its own import.

    Args:
        name: name of the variant or entrant, for the message.
        spec: the specification in this process.
        flown: the record of the specification in the worker.

    Raises:
        RunError: a part differs.
    """
    ours = spec.record().get("own", {})
    theirs = flown.get("own", {})
    for role, part in ours.items():
        if _hashes(part) != _hashes(theirs.get(role)):
            raise RunError(
                f"{name}: a worker flies with another {role} than this process has: "
                "state that a script sets after its import does not reach the workers"
            )


def _hashes(part: Any) -> list[str | None]:
    """Return the hashes of one of the user's own parts, or of all terms."""
    described = part if isinstance(part, list) else [part or {}]
    return [one.get("sha256") for one in described]


def expect_same_libraries(theirs: Mapping[str, str | None]) -> None:
    """Raise RunError if a worker has other versions of the libraries that decide a flight."""
    ours = this_provenance()["versions"]
    for name in LIBRARIES:
        if theirs.get(name) != ours.get(name):
            raise RunError(
                f"a worker flies with {name} {theirs.get(name)}, this process has "
                f"{ours.get(name)}: install the same version"
            )
