"""Which tests were skipped wherever they were collected: `python -m tests.skipped FOLDER`.

If FOLDER is set, each session of pytest writes the outcomes of its tests there. `.ci/run nightly`
has all that tests need, so a test that all of its sessions have skipped runs nowhere.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from uuid import uuid4

# Environment variable with the folder of the sessions' outcomes
FOLDER = "SKIPPED_TESTS"
# Kinds of reports of pytest for tests that have run
RAN = ("passed", "failed", "error", "xfailed", "xpassed")


def reasons_of(reports: Iterable[Any]) -> dict[str, str]:
    """Return the reason of each report of a skipped test or file, by its name."""
    return {report.nodeid: report.longrepr[2].removeprefix("Skipped: ") for report in reports}


def write_outcomes(folder: Path, stats: Mapping[str, list[Any]]) -> None:
    """Write which tests a session has skipped and which it has run.

    Args:
        folder: the folder of all sessions, made if it is missing.
        stats: the reports of the session by their kind, as pytest has them.
    """
    ran = {report.nodeid for kind in RAN for report in stats.get(kind, [])}
    outcomes = {"skipped": reasons_of(stats.get("skipped", [])), "ran": sorted(ran)}
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{uuid4().hex}.json").write_text(json.dumps(outcomes))


def never_run(folder: Path) -> dict[str, str]:
    """Return the tests and files that sessions have skipped and none has run, with a reason.

    A file is skipped as a whole if a module that it needs is missing.
    """
    skipped: dict[str, str] = {}
    ran: set[str] = set()
    for path in folder.glob("*.json"):
        outcomes = json.loads(path.read_text())
        skipped |= outcomes["skipped"]
        ran |= set(outcomes["ran"])
    ran |= {name.partition("::")[0] for name in ran}
    return {name: reason for name, reason in skipped.items() if name not in ran}


def main(folder: Path) -> int:
    """Print each reason for which tests run nowhere, and return 1 if there is one."""
    if not any(folder.glob("*.json")):
        print(f"{folder}: expected the outcomes of tests, got none: set {FOLDER}={folder} for them")
        return 1
    found = never_run(folder)
    for reason, count in Counter(found.values()).most_common():
        first = next(name for name in found if found[name] == reason)
        print(f"{count} skipped by every part: {reason}: {first}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
