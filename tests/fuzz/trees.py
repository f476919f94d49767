"""Repositories whose links were lost or bent on their way: by git, an archive, a copy, an editor.

An installation of such a tree is whole, or ends with one line.
"""

from __future__ import annotations

import random
import shutil
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from hatchling.builders.wheel import WheelBuilder

from tests.fuzz.harness import Case
from tests.test_tree_without_links import FILES, LINKS, small_tree


def _as_it_was(link: Path) -> None:
    """Leave the link."""


def _lost(link: Path) -> None:
    link.unlink()


def _text(link: Path) -> None:
    """Write the target into a file, as git and zip do where there are no links."""
    link.unlink()
    link.write_text(f"../{link.name}")


def _text_of_windows(link: Path) -> None:
    link.unlink()
    link.write_bytes(f"..\\{link.name}\r\n".encode())


def _empty_file(link: Path) -> None:
    link.unlink()
    link.touch()


def _empty_folder(link: Path) -> None:
    link.unlink()
    link.mkdir()


def _copy(link: Path) -> None:
    """Copy the folder, as a copy that follows links does."""
    folder = link.resolve()
    link.unlink()
    shutil.copytree(folder, link)


def _elsewhere(link: Path) -> None:
    link.unlink()
    link.symlink_to("../docs")


def _to_another(link: Path) -> None:
    """Let the link lead to another folder of the project."""
    other = LINKS[(LINKS.index(link.name) + 1) % len(LINKS)]
    link.unlink()
    link.symlink_to(f"../{other}")


def _to_itself(link: Path) -> None:
    link.unlink()
    link.symlink_to(link.name)


def _without_folder(link: Path) -> None:
    """Lose the folder to which the link leads."""
    shutil.rmtree(link.parents[1] / link.name)


CHANGES: tuple[Callable[[Path], None], ...] = (
    _as_it_was,
    _lost,
    _text,
    _text_of_windows,
    _empty_file,
    _empty_folder,
    _copy,
    _elsewhere,
    _to_another,
    _to_itself,
    _without_folder,
)


def trees(rng: random.Random) -> Case:
    """Return a case with a change of each link."""
    # The last one, which no installation can mend, is rarer.
    changes = [rng.choice(CHANGES[: rng.choice((-1, -1, -1, None))]) for _ in LINKS]
    label = ", ".join(f"{name} {c.__name__}" for name, c in zip(LINKS, changes, strict=True))
    call = partial(installed, changes)
    return Case("trees", label, (), call=call)


def installed(changes: list[Callable[[Path], None]]) -> int:
    """Build a changed tree. Return 0 if it is whole, 1 if it is refused with one line."""
    with TemporaryDirectory() as folder:
        root = small_tree(Path(folder, "tree"))
        for name, change in zip(LINKS, changes, strict=True):
            change(root / "quadsim" / name)
        line = ""
        try:
            (wheel,) = WheelBuilder(str(root)).build(directory=folder, versions=["standard"])
        except SystemExit as end:
            line = str(end)
        if line:
            assert _without_folder in changes, line
            assert "\n" not in line
            return 1
        with zipfile.ZipFile(wheel) as archive:
            found = archive.namelist()
        # An editable installation reads the tree itself.
        assert all((root / "quadsim" / name).is_file() for name in FILES)
        assert {f"quadsim/{name}" for name in FILES} <= set(found)
        return 0
