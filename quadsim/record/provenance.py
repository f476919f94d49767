"""The provenance of a run: the machine and the versions with which it was flown.

Nothing in it changes a flight.
"""

from __future__ import annotations

import platform
import subprocess
import sys
from functools import cache
from importlib import metadata
from pathlib import Path

PACKAGES = ("quadsim", "numpy", "scipy", "pybullet", "numba", "rotorpy", "crazyflow", "jax")
# Print the commit alone, without the names of tags, and whether files differ from it
DESCRIBE = ("describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")


def provenance() -> dict:
    """Return versions, commit, CPU and command line of this process, as a JSON dict."""
    return {"versions": versions(), "git": git_commit(), "cpu": cpu_name(), "argv": list(sys.argv)}


@cache
def this_provenance() -> dict:
    """Return the provenance of this process, of the code as it was loaded: asked for once."""
    return provenance()


def versions() -> dict[str, str | None]:
    """Return the versions of Python and of PACKAGES, None for a package that is not installed.

    They are read from the installed metadata, because importing all packages takes a second.
    """
    found: dict[str, str | None] = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = None
    return found


def git_commit() -> str | None:
    """Return the commit of the working copy with this package, None if it is installed.

    It ends with "-dirty" if files differ from the commit.
    """
    root = Path(__file__).resolve().parents[2]
    # Else git would name whatever repository an environment happens to lie in
    if not (root / ".git").exists():
        return None
    command = ["git", "-C", str(root), *DESCRIBE]
    try:
        answer = subprocess.run(command, capture_output=True, text=True, timeout=5, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return answer.stdout.strip() or None


def cpu_name() -> str:
    """Return the name of the processor, as precisely as the system gives it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    for line in lines:
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
