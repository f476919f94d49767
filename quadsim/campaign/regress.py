"""`race regress`: fly a baseline's flights again and report whether the racer got worse."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from statistics import fmean
from typing import Annotated, Any

from rich.markup import escape

from quadsim.campaign.attempt import Flown, result
from quadsim.campaign.baseline import Baseline, Stored, Verdict, baseline_text, judge, load_baseline
from quadsim.campaign.pool import Pool, open_pool
from quadsim.campaign.runner import Tally, fly_variants
from quadsim.campaign.store import code_of
from quadsim.campaign.tables import TextTable, as_table
from quadsim.campaign.variants import Jobs, Scheduler, Variant, resolve, words_as_settings
from quadsim.cli.flags import Given, Help, Json, Switch
from quadsim.console import UsageError, emit, emit_json
from quadsim.record.run import RunError
from quadsim.record.whole_files import write_whole

COLUMNS = {
    "": lambda v: v.name,
    "then": lambda v: f"{v.stored:.4g}",
    "now": lambda v: f"{v.now:.4g}",
    "worse by": lambda v: f"{100 * v.worse:+.2f} %",
    "at most (95 %)": lambda v: f"{100 * v.bound:+.2f} %",
    "allowed": lambda v: f"{100 * v.effect:.3g} %",
    "false alarms <": lambda v: f"{100 * v.unchanged_fails:.2g} %",
}


def regress(
    *baselines: Annotated[str, Help("FILE.yaml")],
    regen: Annotated[bool, Switch("store what is flown now, and print what changed")] = False,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    json: Json = False,
    settings: Given = None,
) -> int:
    """Fly what baseline files describe, with the code as it is now, and fail where success, lap
    time or chatter got worse by more than the file's effects. Flags of `race fly` are added: does
    this change make it slower?

    race regress tests/lap_times/*.yaml

    race regress mine.yaml --preset tuned.yaml

    A new one: write FILE.yaml with one line, flight: figure8 --laps 1, then race regress FILE.yaml
    --regen
    """
    if not baselines:
        raise UsageError("expected one FILE.yaml or more, got none")
    files = [(Path(name), load_baseline(Path(name))) for name in baselines]
    variants = [baseline_variant(path, b, settings or {}) for path, b in files]
    for path, baseline in files:
        if baseline.stored is None and not regen:
            raise UsageError(f"{path}: nothing stored yet: race regress {path} --regen")
    with open_pool(jobs, scheduler) as pool:
        flown = fly_baselines(pool, variants, [b.attempts for _, b in files])
    found = [
        (path, b, now, judge(b.stored, now, b.effects) if b.stored else [])
        for (path, b), now in zip(files, flown, strict=True)
    ]
    _present(found, json)
    if regen:
        for path, baseline, now, _ in found:
            write_whole(path, baseline_text(baseline, now).encode())
        return 0
    return 0 if all(v.ok for *_, verdicts in found for v in verdicts) else 1


def baseline_variant(path: Path, baseline: Baseline, settings: Mapping[str, Any]) -> Variant:
    """What the file's `flight` flies, with these settings on top. Raises UsageError, FileError."""
    try:
        course, flight = words_as_settings(shlex.split(baseline.flight))
        spec = resolve(course, flight | dict(settings))
    except ValueError as error:
        raise UsageError(f"{path}: flight: {error}") from None
    if spec.system != "quadrotor":
        raise UsageError(
            f"{path}: flight: expected one of a quadrotor, got the system {spec.system}"
        )
    return Variant(path.stem, spec)


def _present(found: Sequence[tuple[Path, Baseline, Stored, list[Verdict]]], json: bool) -> None:
    if json:
        emit_json(
            [
                {"file": str(path), "verdicts": [asdict(v) | {"ok": v.ok} for v in vs]}
                for path, *_, vs in found
            ]
        )
        return
    for path, baseline, now, verdicts in found:
        emit(f"[bold]{escape(str(path))}[/]  {escape(baseline.flight)}")
        if verdicts:
            words = " ".join(
                f"{v.name} {'[green]ok[/]' if v.ok else '[red]WORSE[/]'}" for v in verdicts
            )
            emit(as_table(TextTable.of(verdicts, COLUMNS)), words, "")
        else:
            done = [t for t in now.laps if t is not None]
            lap = f", lap {fmean(done):.3f} s" if done else ""
            emit(f"new: {len(done)}/{len(now.laps)} finished{lap}", "")


def fly_baselines(pool: Pool, variants: Sequence[Variant], attempts: Sequence[int]) -> list[Stored]:
    """Every attempt of every variant, flown now. Raises RunError where one is lost twice."""
    specs = [variant.attempts(n) for variant, n in zip(variants, attempts, strict=True)]
    todo = [
        (variant, spec)
        for variant, of_variant in zip(variants, specs, strict=True)
        for spec in of_variant
    ]
    with Tally(len(todo)) as tally:
        flown = {id(spec): flight for _, spec, flight in fly_variants(pool, todo, tally)}
    if lost := len(todo) - len(flown):
        raise RunError(f"{lost} of {len(todo)} attempts were lost with their workers")
    return [_stored([flown[id(spec)] for spec in of_variant]) for of_variant in specs]


def _stored(flights: Sequence[Flown]) -> Stored:
    """The numbers of these attempts; lap times to a tenth of a millisecond."""
    results = [result(f) for f in flights]
    return Stored(
        commit=code_of(flights[0].provenance),
        cpu=flights[0].provenance["cpu"],
        laps=tuple(
            round(fmean(f.run.laps), 4) if f.run.outcome == "finished" else None for f in flights
        ),
        thrust_tv=tuple(round(r["thrust_tv"]["commanded"], 2) for r in results if r["thrust_tv"]),
    )
