"""Optional packages: the extras of pyproject.toml, and what installs one that is missing."""

from __future__ import annotations

import shlex
import sys
from importlib import metadata


def needs_extra(package: str, extra: str) -> str:
    """The line that says what is missing and what installs it: packages by name, as no index has
    this project.

    package: what could not be imported; named alone where this project's metadata does not know the
    extra.
    """
    asked = [
        r.partition(";")[0]
        for r in metadata.requires("quadsim") or ()
        if f"extra == '{extra}'" in r
    ]
    return f"{package} is not installed: {sys.executable} -m pip install {shlex.join(asked or [package])}"
