"""An installation from a tree that came without symbolic links, by git or by Python's zipfile."""

import shutil
import stat
import subprocess
import zipfile
from pathlib import Path

import pytest
from hatchling.builders.wheel import WheelBuilder

ROOT = Path(__file__).parent.parent
LINKS = ("controllers", "courses", "web")
FILES = ("controllers/__init__.py", "courses/figure8.yaml", "web/__init__.py")


@pytest.fixture
def tree(tmp_path):
    """A small repository with the project's links."""
    return small_tree(tmp_path / "tree")


def small_tree(found):
    """Make a small repository with the project's links in a folder, and return the folder."""
    for name in ("pyproject.toml", "hatch_build.py", "README.md", "LICENSE", *FILES):
        (found / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, found / name)
    (found / "quadsim").mkdir()
    (found / "quadsim" / "__init__.py").touch()
    for name in LINKS:
        (found / "quadsim" / name).symlink_to(Path("..", name))
    return found


def cloned(tree):
    """Return a clone by a git that makes no links, as on Windows without the right to."""
    git = ["git", "-c", "user.name=a", "-c", "user.email=a@b"]
    for command in (("init", "-q"), ("add", "."), ("commit", "-qm", "all")):
        subprocess.run([*git, *command], cwd=tree, check=True)
    clone = tree.parent / "clone"
    command = ["git", "clone", "-q", "-c", "core.symlinks=false", str(tree), str(clone)]
    subprocess.run(command, check=True)
    return clone


def unzipped(tree):
    """Return the tree, zipped with its links and unpacked by Python's zipfile."""
    archive = tree.parent / "tree.zip"
    with zipfile.ZipFile(archive, "w") as file:
        for path in tree.rglob("*"):
            name = path.relative_to(tree).as_posix()
            if path.is_symlink():
                link = zipfile.ZipInfo(name)
                link.external_attr = (stat.S_IFLNK | 0o777) << 16
                file.writestr(link, path.readlink().as_posix())
            elif path.is_file() and not path.parent.is_symlink():
                file.write(path, name)
    found = tree.parent / "unzipped"
    with zipfile.ZipFile(archive) as file:
        file.extractall(found)
    return found


@pytest.mark.process
@pytest.mark.parametrize("copied", [cloned, unzipped])
def test_it_is_whole_once_installed(tree, copied, tmp_path):
    root = copied(tree)
    assert all((root / "quadsim" / name).is_file() for name in LINKS)
    (wheel,) = WheelBuilder(str(root)).build(directory=str(tmp_path), versions=["standard"])
    with zipfile.ZipFile(wheel) as archive:
        assert {f"quadsim/{name}" for name in FILES} <= set(archive.namelist())
    # An editable installation, before which hatchling runs the same hook, reads the tree.
    assert all((root / "quadsim" / name).is_file() for name in FILES)


def test_a_file_system_without_links_is_one_line(tree, tmp_path, monkeypatch):
    (tree / "quadsim" / "web").unlink()

    def refused(*_, **__):
        raise OSError(1, "Operation not permitted")

    monkeypatch.setattr(Path, "symlink_to", refused)
    with pytest.raises(SystemExit, match=r"quadsim/web: expected a link to \.\./web, which") as end:
        next(WheelBuilder(str(tree)).build(directory=str(tmp_path), versions=["standard"]))
    assert "\n" not in str(end.value)
