"""Flies the missing attempts of a campaign, keeps each as soon as it has finished, and shows the
progress on stderr."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, nullcontext
from functools import cached_property
from pathlib import Path

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from quadsim.campaign.attempt import LIBRARIES, Flown, attempt_key, this_provenance
from quadsim.campaign.pool import Pool, fly_all, open_pool
from quadsim.campaign.store import Row, Store, code_of
from quadsim.campaign.variants import Variant
from quadsim.console import complain, progress_console, uninterrupted
from quadsim.record.run import RunError
from quadsim.spec.spec import Spec


class Tally(Progress):
    """`with Tally(total, kept) as tally`: a bar; where stderr is no terminal, one line for each
    attempt.

    kept: of the total, flown before.
    """

    def __init__(self, total: int, kept: int = 0):
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
        self.add_task("", total=total, completed=kept)

    def count(self, note: str) -> None:
        (task,) = self.tasks
        self.advance(task.id)
        note += f", {task.time_remaining:.0f} s left" if task.time_remaining else ""
        self.update(task.id, description=note)
        if self.disable:
            complain(f"{task.completed:.0f}/{task.total:.0f} {note}")


def fly_variants(
    pool: Pool, attempts: Sequence[tuple[Variant, Spec]], tally: Tally | None
) -> Iterator[tuple[Variant, Spec, Flown]]:
    """Attempts as they finish. One that is lost twice with its worker is reported and left out."""
    variant_of = {id(spec): variant for variant, spec in attempts}
    for spec, flown in fly_all(pool, [spec for _, spec in attempts]):
        variant = variant_of[id(spec)]
        label = f"{variant.course} {variant.name} seed {spec.seed}"
        if flown is None:
            complain(f"{label}: lost twice with its worker, not flown")
            continue
        yield variant, spec, flown
        if tally:
            tally.count(f"{label}: {flown.run.outcome}")


class Runner:
    """`with Runner(...) as runner: rows = runner(variants, attempts)`; the first missing attempt
    starts the workers."""

    def __init__(
        self,
        campaign: Path,
        jobs: int | None = None,
        scheduler: str | None = None,
        this_commit: bool = False,
        telemetry: bool = True,
    ):
        """this_commit: count only what this commit has flown; telemetry: keep it; the workers: see
        open_pool."""
        self.campaign, self._workers, self._this_commit = campaign, (jobs, scheduler), this_commit
        self._telemetry, self._kept = telemetry, 0
        self._open = ExitStack()

    def __enter__(self) -> Runner:
        self._store = self._open.enter_context(Store(self.campaign))
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self._open.close()
        if not error or not self._kept:
            return
        kept = f"what has been flown is kept in {self.campaign}: the same command goes on there"
        if isinstance(error, KeyboardInterrupt):
            raise KeyboardInterrupt(kept) from None
        complain(kept)

    @cached_property
    def pool(self) -> Pool:
        return self._open.enter_context(open_pool(*self._workers))

    def __call__(
        self, variants: Sequence[Variant], attempts: int, quiet: bool = False
    ) -> list[list[Row]]:
        """Rows of every variant by seed, without lost attempts. Raises RunError, UsageError,
        KeyboardInterrupt."""
        keys = [
            {attempt_key(s.record()): (variant, s) for s in variant.attempts(attempts)}
            for variant in variants
        ]
        # seed by seed
        wanted = dict(
            pair for seed in zip(*(k.items() for k in keys), strict=True) for pair in seed
        )
        rows = self._rows_by_key(wanted)
        self._kept += len(rows)
        missing = [pair for key, pair in wanted.items() if key not in rows]
        if missing:
            with nullcontext() if quiet else Tally(len(wanted), len(rows)) as tally:
                for variant, spec, flown in fly_variants(self.pool, missing, tally):
                    with uninterrupted():
                        self._store.add(spec, variant.name, flown, self._telemetry)
                    self._kept += 1
                    _expect_same_libraries(flown.provenance["versions"])
            rows = self._rows_by_key(wanted)
        return [[rows[k] for k in of_variant if k in rows] for of_variant in keys]

    def _rows_by_key(self, keys: dict[str, tuple[Variant, Spec]]) -> dict[str, Row]:
        """What is stored, and counts: of several commits this one, else the latest."""
        code = code_of(this_provenance())
        rows = [r for r in self._store.rows(keys) if r.code == code or not self._this_commit]
        # `rows` are oldest first
        return {r.key: r for r in sorted(rows, key=lambda r: r.code == code)}


def _expect_same_libraries(theirs: Mapping[str, str | None]) -> None:
    """A worker of a cluster may have others: what it flies is another attempt. Raises RunError."""
    ours = this_provenance()["versions"]
    for name in LIBRARIES:
        if theirs.get(name) != ours.get(name):
            raise RunError(
                f"a worker flies with {name} {theirs.get(name)}, here is {ours.get(name)}: install the same"
            )
