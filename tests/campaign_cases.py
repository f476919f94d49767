"""Campaigns that the tests share: flights of a tenth of a second, and the command that flies
them."""

import os
import signal
import sqlite3
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

from quadsim.campaign.store import Row
from quadsim.campaign.variants import Variant, resolve, words_as_settings

SMALL = ["--samples", "128", "--horizon", "20", "--iterations", "1"]
FLIGHT = ["paper_flat", "--preset", "paper", *SMALL, "--timeout", "0.1"]
RACE = [sys.executable, "-c", "from quadsim.cli.cli import main; main()"]


def variant(name="colored", *argv) -> Variant:
    """FLIGHT with this sampler, and with other flags added or replaced."""
    course, settings = words_as_settings(FLIGHT)
    return Variant(name, resolve(course, settings | {"sampler": name} | words_as_settings(argv)[1]))


def specs(number, *argv):
    return variant("gaussian", *argv).attempts(number)


def start(campaign, *argv, attempts=6, **kwargs) -> subprocess.Popen:
    """`race compare` on its way, in a process group of its own."""
    command = [
        *RACE,
        "compare",
        *FLIGHT,
        "--attempts",
        str(attempts),
        "--campaign",
        str(campaign),
        *argv,
    ]
    pipes = {
        "stdout": subprocess.PIPE,
        "stderr": subprocess.PIPE,
        "text": True,
        "start_new_session": True,
    }
    return subprocess.Popen(command, **pipes | kwargs)


def seeds_flown(campaign: Path) -> list[tuple]:
    """(sampler, seed, flown_at, rowid) of every row, read past the program."""
    if not campaign.exists():
        return []
    try:
        with sqlite3.connect(campaign) as db:
            return sorted(db.execute("SELECT sampler, seed, folder FROM attempts").fetchall())
    except sqlite3.OperationalError:  # not made yet
        return []


def end_after(process: subprocess.Popen, campaign: Path, rows: int, sign: signal.Signals) -> None:
    """Signal the program alone once so many attempts are kept."""
    while len(seeds_flown(campaign)) < rows and process.poll() is None:
        time.sleep(0.02)
    os.kill(process.pid, sign)


def row(seed=0, outcome="finished", laps=(5.0, 4.0), tv=10.0, code="a" * 40, **changes) -> Row:
    """As if flown."""
    crash = (
        {"kind": "hit", "gate": 3, "lap": 1, "position": [1.0, 2.0, 3.0]}
        if outcome == "crashed"
        else None
    )
    laps = list(laps) if outcome == "finished" else []
    result = {"laps": laps, "crash": crash, "fault": None, "thrust_tv": None}
    if tv is not None:
        result |= {"thrust_tv": {"commanded": tv, "delivered": tv / 2}}
    result |= {
        "plan_ms": {"p50": 1.0, "p95": 2.0},
        "real_time_factor": 3.0,
        "cpu": "",
        "digest": "",
    }
    row = Row(
        f"k{seed}",
        code,
        "variant",
        "a",
        "paper_flat",
        "colored",
        "race",
        "swift",
        0.0,
        seed,
        outcome,
        result,
        "",
        "",
    )
    return replace(row, **changes)
