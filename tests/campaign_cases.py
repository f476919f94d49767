"""Campaigns that tests share: flights of a tenth of a second, and the command that flies them."""

import os
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from quadsim.campaign.run.store import AttemptRow
from quadsim.campaign.run.variants import Variant
from quadsim.config.setting_texts import resolve
from tests.small import SMALL, flags

COURSE = "paper_flat"
SETTINGS = {**SMALL, "first_iterations": 1, "timeout": 0.1}
# The same as words of a command line.
FLIGHT = [COURSE, *flags(SETTINGS)]
RACE = [sys.executable, "-c", "from quadsim.cli.cli import main; main()"]


def variant(name="colored", **settings) -> Variant:
    """Return what FLIGHT flies with this sampler, and with other settings added or replaced."""
    return Variant(name, resolve(COURSE, SETTINGS | {"sampler": name} | settings))


def specs(number):
    """Return `number` flights that differ in their seeds."""
    return variant("gaussian").attempts(number)


def after_a_moment(job):
    """Return the job, as a worker that takes some time for it."""
    time.sleep(0.02)
    return job


@dataclass(frozen=True)
class LoggedJob:
    """A job that takes a moment, and the file that says which of them have ended."""

    number: int
    log: Path


def logged_moment(job):
    """Return the number of a job, and write it into its file when it ends."""
    time.sleep(0.05)
    with job.log.open("a") as log:
        log.write(f"{job.number}\n")
    return job.number


def start(campaign, *argv, attempts=6, **kwargs) -> subprocess.Popen:
    """Start `race compare` in a process group of its own."""
    words = [*FLIGHT, "--attempts", str(attempts), "--campaign", str(campaign), *argv]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([*RACE, "compare", *words], start_new_session=True, **pipes, **kwargs)


def seeds_flown(campaign: Path) -> list[tuple]:
    """Return (sampler, seed, folder) of every row, read past the program."""
    if not campaign.exists():
        return []
    try:
        with closing(sqlite3.connect(campaign)) as db:
            return sorted(db.execute("SELECT sampler, seed, folder FROM attempts").fetchall())
    except sqlite3.OperationalError:  # not made yet
        return []


def end_after(process: subprocess.Popen, campaign: Path, rows: int, sign: signal.Signals) -> None:
    """Signal the program alone once the campaign holds `rows` attempts."""
    while len(seeds_flown(campaign)) < rows and process.poll() is None:
        time.sleep(0.02)
    os.kill(process.pid, sign)


def row(
    seed=0, outcome="finished", laps=(5.0, 4.0), gates=7, tv=10.0, code="a" * 40, **changes
) -> AttemptRow:
    """Return a row as if its attempt had been flown."""
    crash = {"kind": "hit", "gate": 3, "obstacle": 0, "lap": 1, "position": [1.0, 2.0, 3.0]}
    result = {
        "laps": list(laps) if outcome == "finished" else [],
        "gates_passed": gates,
        "crash": crash if outcome == "crashed" else None,
        "fault": None,
        "thrust_tv": {"commanded": tv, "delivered": tv / 2},
        "rates_tv": {"commanded": 30.0, "delivered": 20.0},
        "motors": None,
        "turned_back": [],
        "plan_ms": {"p50": 1.0, "p95": 2.0},
        "real_time_factor": 3.0,
        "cpu": "",
        "digest": "",
    }
    made = AttemptRow(
        key=f"k{seed}",
        code=code,
        variant="variant",
        name="a",
        course="paper_flat",
        sampler="colored",
        preset="race",
        vehicle="swift",
        randomize=0.0,
        seed=seed,
        outcome=outcome,
        result=result,
        folder="",
        flown_at="",
    )
    return replace(made, **changes)
