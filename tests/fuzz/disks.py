"""Disks that fill, and outputs that cannot be written.

Older files stay, and nothing looks finished that is not. A disk fills where a file reaches the
largest size that the process may write (RLIMIT_FSIZE): it leaves the same half-written file and
the same error from write(), without a file system of its own.
"""

from __future__ import annotations

import os
import random
import shutil
from functools import partial
from pathlib import Path

from quadsim.record.archive import list_runs, read_run
from quadsim.record.run import RunError
from tests.fuzz.base import COMPARE, FLIGHTS, SHORT, base, campaign_base
from tests.fuzz.damage import WORDS
from tests.fuzz.harness import Case, Outcome

OLD = b"an older file, whole"
READERS = (
    ("show",),
    ("show", "--json"),
    ("courses",),
    ("vehicles", "--json"),
    ("check", "swift"),
    ("--help",),
)
KINDS = {"--csv": "csv", "--zip": "zip", "--html": "html"}


def exports(rng: random.Random) -> Case:
    """Return a case that exports or draws a run.

    It writes beside an older file on a disk that fills, or to a place that cannot be written.
    """
    kind = rng.choice([*KINDS, "plot"])
    command = ("plot",) if kind == "plot" else ("export", kind)
    if rng.random() < 0.4:
        out = rng.choice(
            ("pipe", "to-null", "/proc/x", "old", "runs", "no/such/folder/x", "old/x", *WORDS)
        )
        return Case(
            "exports", f"{command} to {out!r}", (*command, "--out", out), partial(_with_runs, True)
        )
    size = rng.choice((0, 1, 512, 4096, rng.randrange(20_000)))
    return Case(
        "exports",
        f"{command} on a disk of {size} bytes",
        (*command, "--out", "figures" if kind == "plot" else "new"),
        partial(_with_runs, True),
        _older_or_whole,
        fsize=size,
    )


def disks(rng: random.Random) -> Case:
    """Return a case with a flight, a comparison or a report on a disk that fills."""
    kind = rng.random()
    size = rng.choice((0, 100, rng.randrange(5000), rng.randrange(60_000)))
    label = f"disk of {size} bytes"
    if kind < 0.5:
        argv = ("fly", *rng.choice(FLIGHTS), *SHORT)
        return Case("disks", f"{label}: {argv}", argv, after=_nothing_looks_finished, fsize=size)
    if kind < 0.6:
        return Case(
            "disks", f"{label}: compare", COMPARE, _with_campaign, _campaign_stays, fsize=size
        )
    argv = rng.choice(READERS)
    return Case(
        "disks",
        f"/dev/full: {argv}",
        argv,
        partial(_with_runs, False),
        codes=frozenset({2}),
        to="/dev/full",
    )


def _with_runs(older: bool, folder: Path) -> None:
    shutil.copytree(base().runs[0], folder / "runs" / base().runs[0].name)
    if older:
        (folder / "old").write_bytes(OLD)
        os.mkfifo(folder / "pipe")
        (folder / "to-null").symlink_to("/dev/null")


def _with_campaign(folder: Path) -> None:
    shutil.copytree(campaign_base().campaign, folder / "campaigns")


def _older_or_whole(folder: Path, outcome: Outcome) -> str:
    """Claim that after an error every older file is as it was, and nothing else is there."""
    if outcome.code == 0:
        return ""
    if (folder / "old").read_bytes() != OLD:
        return "the older file is lost"
    before = {"runs", "old", "figures", "pipe", "to-null"}
    left = sorted(path.name for path in folder.iterdir() if path.name not in before)
    left += [path.name for path in folder.glob("figures/*")]
    return f"left behind: {left}" if left else ""


def _nothing_looks_finished(folder: Path, _: Outcome) -> str:
    """Claim that every run that is listed can be read."""
    runs = folder / "runs"
    for path in list_runs(runs) if runs.exists() else ():
        try:
            read_run(path)
        except RunError as error:
            return f"looks finished: {error}"
    return ""


def _campaign_stays(folder: Path, _: Outcome) -> str:
    """Claim that the rows from before are still there."""
    from quadsim.campaign.run.store import Store

    try:
        with Store(folder / "campaigns" / "race.sqlite", create=False) as store:
            return "" if len(store.rows()) >= 4 else "rows are lost"
    except RunError as error:
        return f"the campaign is lost: {error}"
