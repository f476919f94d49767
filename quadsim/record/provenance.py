"""Provenance: on what machine and with which versions a run was flown. None of it may change a
flight."""

from __future__ import annotations

import platform
import subprocess
import sys
from importlib import metadata
from pathlib import Path

PACKAGES = ("quadsim", "numpy", "scipy", "pybullet", "numba", "rotorpy")


def provenance() -> dict:
    return {"versions": versions(), "git": git_commit(), "cpu": cpu_name(), "argv": list(sys.argv)}


def versions() -> dict[str, str | None]:
    """From the installed metadata: importing all of them would cost a second."""
    return {"python": platform.python_version(), **{name: _version(name) for name in PACKAGES}}


def git_commit() -> str | None:
    """The commit of the working copy this package lies in, with "-dirty" if files differ; None if
    it is installed."""
    root = Path(__file__).resolve().parents[2]
    # else git would name whatever repository an environment happens to lie in
    if not (root / ".git").exists():
        return None
    command = [
        "git",
        "-C",
        str(root),
        "describe",
        "--always",
        "--dirty",
        "--abbrev=40",
        "--exclude=*",
    ]
    try:
        answer = subprocess.run(command, capture_output=True, text=True, timeout=5, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return answer.stdout.strip() or None


def cpu_name() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor() or platform.machine())


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None
