"""The single flights of an experiment: their rows, and the command that flies one of them.

Only `race compare` of single vehicles has such rows. In races of several the places on the grid
depend on the races before.
"""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from quadsim.campaign.run.store import AttemptRow, Store

DIGITS = 6  # significant digits of a number in a CSV file


class Flight(NamedTuple):
    """A row of a file of flights; numbers are texts, as they are printed and compared."""

    course: str
    variant: str
    seed: str
    outcome: str
    laps: str  # [s], with a space between two
    thrust_tv: str  # commanded [m/s^2/s]
    rates_tv: str  # commanded [rad/s^2]


def number(value: float | None) -> str:
    """Return a number as CSV files have it, and "" for None."""
    return "" if value is None else f"{value:.{DIGITS}g}"


def has_flights(words: Sequence[str]) -> bool:
    """Return whether the flights of a command have rows."""
    return list(words[:2]) == ["race", "compare"]


def flights(campaign: Path, command: str) -> list[Flight]:
    """Return the flights of a campaign, by course, variant and seed.

    Args:
        campaign: a file that holds the flights of the command and no others.
        command: `race compare ...`.

    Raises:
        RunError: the campaign cannot be read.
    """
    order = list(variants(shlex.split(command)))
    with Store(campaign, create=False) as store:
        rows = store.rows()
    # A commit may have flown what another one has flown before: the last one counts.
    latest = {(row.course, order.index(row.name), row.seed): row for row in rows}
    return [_flight(latest[key]) for key in sorted(latest)]


def _flight(row: AttemptRow) -> Flight:
    found = row.result
    return Flight(
        course=row.course,
        variant=row.name,
        seed=str(row.seed),
        outcome=row.outcome,
        laps=" ".join(map(number, found["laps"])),
        thrust_tv=number(found["thrust_tv"]["commanded"]),
        rates_tv=number(found["rates_tv"]["commanded"]),
    )


def variants(words: Sequence[str]) -> dict[str, str]:
    """Return name -> text of the variants in the words of a command."""
    listed = words[words.index("--variants") + 1].split(",")
    return {text.split("=")[0]: text for text in listed}


def alone(command: str, flight: Flight) -> list[str]:
    """Return the words of a command that flies one of its flights alone.

    Args:
        command: `race compare COURSE --attempts N --variants A,B ...`.
        flight: one of its flights.
    """
    words = shlex.split(command)
    changed = {
        "--attempts": "1",
        "--variants": variants(words)[flight.variant],
        "--seed": flight.seed,
    }
    for flag, value in changed.items():
        if flag in words:
            words[words.index(flag) + 1] = value
        else:
            words += [flag, value]
    return words


def run_campaign(words: Sequence[str], campaign: Path, out: Path) -> dict | None:
    """Run a `race compare` or `race sweep`, and return what it prints; None if it failed.

    Args:
        words: the command.
        campaign: its file of flights.
        out: the folder of its report.
    """
    campaign.parent.mkdir(parents=True, exist_ok=True)
    return run_json([*words, "--campaign", str(campaign), "--out", str(out)])


def run_json(words: Sequence[str]) -> dict | None:
    """Run a command, and return the JSON value that it prints; None if it failed."""
    program, *rest = words
    done = subprocess.run(
        [Path(sys.executable).with_name(program), *rest, "--json"],
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    return json.loads(done.stdout) if done.returncode == 0 else None
