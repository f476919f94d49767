"""Make the links of the package where a checkout came without symbolic links.

`quadsim/controllers`, `quadsim/courses` and `quadsim/web` are links to the folders of these names.
In a tree that was unpacked or cloned without links they are small files with the link's target, and
an installation of it could not be imported. hatchling runs this hook before each build, also before
that of an editable installation.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

LINKS = ("controllers", "courses", "web")


class LinkHook(BuildHookInterface):
    """Checks the links before a build."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Make the links that are missing.

        Raises:
            SystemExit: the file system has no links.
        """
        for name in LINKS:
            make_link(Path(self.root), name)


def make_link(root: Path, name: str) -> None:
    """Make the link to a folder of the repository, unless the package has the folder with files.

    Args:
        root: folder of the repository, or of a source distribution, which has whole folders.
        name: name of the folder.

    Raises:
        SystemExit: it cannot be made.
    """
    link = root / "quadsim" / name
    folder = root / name
    # A link may lead nowhere, to itself, or elsewhere; a folder may be empty.
    has_files = link.is_dir() and any(link.iterdir())
    if has_files and (not link.is_symlink() or link.resolve() == folder.resolve()):
        return
    wanted = f"quadsim/{name}: expected a link to ../{name}"
    if not folder.is_dir():
        raise SystemExit(f"{wanted}, and found no such folder: unpack the whole repository")
    try:
        if link.is_dir() and not link.is_symlink():
            link.rmdir()
        else:
            link.unlink(missing_ok=True)
        link.symlink_to(Path("..", name), target_is_directory=True)
    except OSError as error:
        advice = "use a file system with symbolic links, and clone with git -c core.symlinks=true"
        raise SystemExit(f"{wanted}, which cannot be made: {error.strerror}: {advice}") from None
