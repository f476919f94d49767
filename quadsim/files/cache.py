"""The folder for things that are made once on a machine: compiled code, the built firmware."""

from __future__ import annotations

import os
from pathlib import Path


def cache_folder() -> Path | None:
    """Return $XDG_CACHE_HOME/quadsim or ~/.cache/quadsim, which may not exist yet.

    Returns:
        The folder; None if the user has no home directory.
    """
    home = os.environ.get("XDG_CACHE_HOME", "")
    # A relative one is to be ignored, by the specification of these folders.
    if not os.path.isabs(home):
        home = os.path.expanduser("~/.cache")
    return Path(home) / "quadsim" if os.path.isabs(home) else None
