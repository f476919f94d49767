"""`race regress`: fly a baseline's flights again and say whether the racer got worse."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from statistics import fmean
from typing import Annotated

from rich.markup import escape
from tyro.conf import FlagCreatePairsOff, OmitArgPrefixes, Positional, arg

from quadsim.app.campaign.attempt import Flown
from quadsim.app.campaign.baseline import Baseline, Stored, Verdict, baseline_text, judge, load_baseline
from quadsim.app.campaign.common_flags import INTERRUPTED, FlightWords, Workers, read_with_flight
from quadsim.app.campaign.pool import Pool, fly_all
from quadsim.app.campaign.progress import Tally
from quadsim.app.campaign.store import code_of
from quadsim.app.campaign.tables import TextTable, as_table
from quadsim.app.campaign.variants import Variant, resolve
from quadsim.app.console import emit, emit_json
from quadsim.app.flags import UsageError
from quadsim.record.archive import write_whole
from quadsim.record.metrics import chatter
from quadsim.record.run import RunError

CHANGED = {True: "[green]ok[/]", False: "[red]WORSE[/]"}


@dataclass(frozen=True)
class Regress:
    """Fly what baseline files describe, with the code as it is now, and fail where success, lap time or chatter got
    worse by more than the file's effects. Flags of `race fly` are added: does this change make it slower?

    race regress tests/lap_times/*.yaml

    race regress mine.yaml --preset tuned.yaml

    A new one: write FILE.yaml with one line, flight: figure8 --laps 1, then race regress FILE.yaml --regen
    """

    baselines: Annotated[tuple[str, ...], Positional, arg(metavar="FILE.yaml")] = ()
    regen: FlagCreatePairsOff[bool] = False  # store what flies now, and print what changed
    workers: OmitArgPrefixes[Workers] = field(default_factory=Workers)
    json: FlagCreatePairsOff[bool] = False  # one JSON list instead of tables
    flight: FlightWords = ()

    @classmethod
    def from_argv(cls, argv: Sequence[str]) -> Regress:
        flags = read_with_flight(cls, "race regress", argv)
        if not flags.baselines:
            raise UsageError("expected one FILE.yaml or more, got none")
        return flags

    def run(self) -> int:
        """0: no worse, 1: worse."""
        files = [(Path(name), load_baseline(Path(name))) for name in self.baselines]
        variants = [
            Variant(path.stem, resolve([*shlex.split(b.flight), *self.flight], "race regress")) for path, b in files
        ]
        for path, baseline in files:
            if baseline.stored is None and not self.regen:
                raise UsageError(f"{path}: nothing stored yet: race regress {path} --regen")
        try:
            with self.workers.start() as pool:
                now = fly_baselines(pool, variants, [b.attempts for _, b in files])
        except KeyboardInterrupt:
            return INTERRUPTED
        found = [(path, b, new, _verdicts(b, new)) for (path, b), new in zip(files, now, strict=True)]
        self._present(found)
        if self.regen:
            for path, baseline, new, _ in found:
                write_whole(path, baseline_text(baseline, new).encode())
            return 0
        return 0 if all(v.ok for *_, verdicts in found for v in verdicts) else 1

    def _present(self, found: Sequence[tuple[Path, Baseline, Stored, list[Verdict]]]) -> None:
        if self.json:
            emit_json(
                [{"file": str(path), "verdicts": [asdict(v) | {"ok": v.ok} for v in vs]} for path, *_, vs in found]
            )
            return
        for path, baseline, new, verdicts in found:
            emit(f"[bold]{escape(str(path))}[/]  {escape(baseline.flight)}")
            if verdicts:
                emit(as_table(_sheet(verdicts)), " ".join(f"{v.name} {CHANGED[v.ok]}" for v in verdicts), "")
            else:
                done = [t for t in new.laps if t is not None]
                lap = f", lap {fmean(done):.3f} s" if done else ""
                emit(f"new: {len(done)}/{len(new.laps)} finished{lap}", "")


def fly_baselines(pool: Pool, variants: Sequence[Variant], attempts: Sequence[int]) -> list[Stored]:
    """Every attempt of every variant, flown now. Raises RunError where one is lost twice."""
    todo = {id(s): (i, s) for i, (a, n) in enumerate(zip(variants, attempts, strict=True)) for s in a.attempts(n)}
    landed: list[dict[int, Flown]] = [{} for _ in variants]
    with Tally(len(todo), 0) as tally:
        for spec, flown in fly_all(pool, [spec for _, spec in todo.values()]):
            i, _ = todo[id(spec)]
            if flown is None:
                raise RunError(f"{variants[i].name}: seed {spec.seed}: lost twice with its worker")
            landed[i][spec.seed] = flown
            tally.count(f"{variants[i].name} seed {spec.seed}: {flown.run.outcome}")
    return [store([flights[seed] for seed in sorted(flights)]) for flights in landed]


def store(flights: Sequence[Flown]) -> Stored:
    """The numbers of these attempts, to a tenth of a millisecond."""
    runs = [f.run for f in flights]
    return Stored(
        commit=code_of(flights[0].provenance),
        cpu=flights[0].provenance["cpu"],
        laps=tuple(round(fmean(r.laps), 4) if r.outcome == "finished" else None for r in runs),
        thrust_tv=tuple(round(chatter(r)["commanded"]["thrust_tv"], 2) for r in runs),
    )


def _verdicts(baseline: Baseline, now: Stored) -> list[Verdict]:
    return judge(baseline.stored, now, baseline.effects) if baseline.stored else []


def _sheet(verdicts: Sequence[Verdict]) -> TextTable:
    head = ("", "then", "now", "worse by", "at most (95 %)", "allowed", "false alarms <")
    rows = [
        (
            v.name,
            f"{v.stored:.4g}",
            f"{v.now:.4g}",
            f"{100 * v.worse:+.2f} %",
            f"{100 * v.bound:+.2f} %",
            f"{100 * v.effect:.3g} %",
            f"{100 * v.unchanged_fails:.2g} %",
        )
        for v in verdicts
    ]
    return TextTable(head, tuple(rows))
