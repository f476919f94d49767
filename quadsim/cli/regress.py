"""`race regress`: repeat the flights of a baseline and report whether the planner got worse."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import fmean
from typing import Annotated

from rich.markup import escape

from quadsim.campaign.document import Table, as_table
from quadsim.campaign.flights.baseline import (
    Baseline,
    StoredNumbers,
    Verdict,
    WorstSeed,
    baseline_text,
    baseline_variant,
    fly_baselines,
    judge,
    load_baseline,
    worst_seed,
)
from quadsim.campaign.run.commits import short
from quadsim.campaign.run.pool import open_pool
from quadsim.campaign.run.variants import Variant
from quadsim.cli.campaigns import Jobs, Scheduler
from quadsim.cli.flags import Given, Help, Json, Switch, flag, settings_as_flags
from quadsim.config.setting_texts import Settings
from quadsim.console import UsageError, emit, emit_json
from quadsim.record.whole_files import write_whole
from quadsim.tables.wording import settings_of, wording

UNITS = {"lap": "lap [s]", "thrust_tv": "thrust_tv [m/s^2/s]"}
COLUMNS: dict[str, Callable[[Verdict], str]] = {
    "": lambda v: UNITS.get(v.name, v.name),
    "then": lambda v: f"{v.stored:.4g}",
    "now": lambda v: f"{v.now:.4g}",
    "worse by": lambda v: f"{100 * v.worse:+.2f} %",
    "at most (95 %)": lambda v: f"{100 * v.bound:+.2f} %",
    "allowed": lambda v: f"{100 * v.effect:.3g} %",
    "false alarms <=": lambda v: f"{100 * v.unchanged_fails:.3g} %",
}


@dataclass(frozen=True)
class Found:
    """The new results of one baseline, with the verdicts on them."""

    path: Path
    baseline: Baseline
    variant: Variant
    now: StoredNumbers
    verdicts: list[Verdict]  # empty if nothing was stored yet

    @property
    def is_worse(self) -> bool:
        """Whether a number did not pass."""
        return any(not verdict.ok for verdict in self.verdicts)

    @property
    def worst(self) -> WorstSeed | None:
        """The attempt that has become worst; None if nothing can be said."""
        then = self.baseline.stored
        return worst_seed(then, self.now) if then else None

    @property
    def seed(self) -> int | None:
        """The seed of the attempt that has become worst."""
        return self.variant.spec.seed + self.worst.number if self.worst else None

    @property
    def command(self) -> str | None:
        """The command that flies the worst attempt; None if no flags give it."""
        if self.seed is None:
            return None
        record = replace(self.variant.spec, seed=self.seed).record()
        return wording(record, Path()).command if settings_of(record) else None


def regress(
    *baselines: Annotated[str, Help("FILE.yaml")],
    regen: Annotated[bool, Switch("store what is flown now, and print what changed")] = False,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    json: Json = False,
    settings: Given = None,
) -> int:
    """Fly the flights of baseline files, and fail if the planner got worse.

    It fails if success, lap time or chatter is worse by more than the effects
    given in the file, or if the flights are too few to tell. Flags of `race fly`
    apply on top, to test a change.

    race regress tests/lap_times/*.yaml

    race regress mine.yaml --preset tuned.yaml

    A new baseline: write FILE.yaml with two lines, course: figure8 and
    variant: race+laps=1, then race regress FILE.yaml --regen
    """
    if not baselines:
        raise UsageError("expected one FILE.yaml or more, got none")
    paths = [Path(name) for name in baselines]
    files = [load_baseline(path) for path in paths]
    variants = [
        _variant(path, baseline, settings or {})
        for path, baseline in zip(paths, files, strict=True)
    ]
    for path, baseline in zip(paths, files, strict=True):
        if baseline.stored is None and not regen:
            raise UsageError(f"{path}: nothing stored yet: race regress {path} --regen")
    with open_pool(jobs, scheduler) as pool:
        flown = fly_baselines(pool, variants, [baseline.attempts for baseline in files])

    found = []
    for path, baseline, variant, now in zip(paths, files, variants, flown, strict=True):
        verdicts = judge(baseline.stored, now, baseline.effects) if baseline.stored else []
        found.append(Found(path, baseline, variant, now, verdicts))
    if json:
        emit_json([_as_json(one, flags_text(settings or {})) for one in found])
    else:
        for one in found:
            _print(one, settings or {})
    if regen:
        for one in found:
            write_whole(one.path, baseline_text(one.baseline, one.now).encode())
        return 0
    return 1 if any(one.is_worse for one in found) else 0


def _variant(path: Path, baseline: Baseline, settings: Settings) -> Variant:
    """Return the variant of a baseline file. Raises UsageError, which names the file."""
    try:
        with settings_as_flags():
            return baseline_variant(path.stem, baseline, settings)
    except ValueError as error:
        raise UsageError(f"{path}: {error}") from None


def _as_json(found: Found, flags: str) -> dict:
    verdicts = [asdict(verdict) | {"ok": verdict.ok} for verdict in found.verdicts]
    then = found.baseline.stored
    return {
        "file": str(found.path),
        "flags": flags,
        "verdicts": verdicts,
        "commits": {"then": then.commit if then else None, "now": found.now.commit},
        "worst_seed": found.seed,
        "command": found.command,
    }


def flags_text(settings: Settings) -> str:
    """Return settings of the command line as their flags, such as "--samples 512"."""
    words = []
    for name, value in settings.items():
        values = value if isinstance(value, list | tuple) else [value]
        words += [flag(name), *(str(each) for each in values)]
    return " ".join(words)


def _mark(verdict: Verdict) -> str:
    """Return a verdict in a word, with its colour."""
    if verdict.undecided:
        return f"{verdict.name} [yellow]undecided[/]"
    return f"{verdict.name} {'[green]ok[/]' if verdict.ok else '[red]WORSE[/]'}"


def _print(found: Found, settings: Settings) -> None:
    """Print the verdicts on a baseline, and the flags that were added to its variant."""
    baseline = found.baseline
    flown = f"{baseline.course} {baseline.variant}"
    if settings:
        flown += f" with {flags_text(settings)}"
    emit(f"[bold]{escape(str(found.path))}[/]  {escape(flown)}")
    if found.verdicts:
        emit(as_table(Table.of(found.verdicts, COLUMNS)), " ".join(map(_mark, found.verdicts)))
        emit(*(f"{v.name}: {v.undecided}" for v in found.verdicts if v.undecided))
        emit(*map(escape, _advice(found)), "")
        return
    finished = [lap for lap in found.now.laps if lap is not None]
    lap = f", lap {fmean(finished):.3f} s" if finished else ""
    emit(f"new: {len(finished)}/{len(found.now.laps)} finished{lap}")
    # What an unchanged racer will be told, before a change is tested with too few attempts
    alarms = [
        f"{verdict.name} <= {100 * verdict.unchanged_fails:.3g} %"
        for verdict in judge(found.now, found.now, baseline.effects)
    ]
    emit(f"false alarms with {baseline.attempts} attempts: {', '.join(alarms)}", "")


def _advice(found: Found) -> Iterator[str]:
    """Yield both commits, and for a worse racer its worst seed with the command that flies it."""
    then = found.baseline.stored
    if then:
        yield f"commits: then {short(then.commit)}, now {short(found.now.commit)}"
    worst = found.worst
    if not found.is_worse or worst is None:
        return
    laps = [f"{lap:.3f} s" if lap else "not finished" for lap in (worst.then, worst.now)]
    yield f"worst seed {found.seed}: then {laps[0]}, now {laps[1]}"
    if found.command:
        yield found.command
