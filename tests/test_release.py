"""The files of a release name one version, and what differs is found before a tag is made."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parent.parent


def checks() -> ModuleType:
    """Return the program that `make release` runs."""
    spec = importlib.util.spec_from_file_location("release", ROOT / ".ci/release.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


RELEASE = checks()
FILES = {
    "pyproject.toml": '[project]\nversion = "1.2.0"\n',
    "CITATION.cff": "cff-version: 1.2.0\nversion: 1.2.0\ndate-released: 2026-11-27\n",
    "CHANGELOG.md": "# Changelog\n\n## Unreleased\n\n## 1.2.0 (2026-11-27)\n\n- new\n\n## 1.1.0\n",
}


def written(folder: Path, file: str = "", old: str = "", new: str = "") -> Path:
    """Write the files of a release, one of them changed."""
    for name, text in FILES.items():
        changed = text.replace(old, new) if name == file else text
        assert name != file or changed != text
        (folder / name).write_text(changed)
    return folder


def test_the_files_of_this_repository_name_one_version():
    assert RELEASE.problems(ROOT) == []


def test_files_that_agree_can_be_tagged(tmp_path):
    root = written(tmp_path)
    assert RELEASE.problems(root) == []
    assert RELEASE.problems(root, "v1.2.0") == []


@pytest.mark.parametrize(
    ("file", "old", "new", "start"),
    [
        (
            "pyproject.toml",
            "1.2.0",
            "1.3.0",
            "pyproject.toml: expected the version",
        ),
        (
            "pyproject.toml",
            "1.2.0",
            "1.2.0.dev0",
            "pyproject.toml: expected the version of the tag",
        ),
        ("CITATION.cff", "\nversion: 1.2.0", "\nversion: 1.1.0", "CITATION.cff: expected 1.2.0"),
        ("CITATION.cff", "-27", "-26", "CITATION.cff: expected 1.2.0 (2026-11-27)"),
        ("CHANGELOG.md", " (2026-11-27)", "", "CHANGELOG.md: expected '## 1.2.0 (YYYY-MM-DD)'"),
        ("CHANGELOG.md", "## 1.2.0", "## 1.1.9", "CHANGELOG.md: expected '## 1.2.0"),
        ("CHANGELOG.md", "Unreleased\n", "Unreleased\n\n### Added\n", "CHANGELOG.md: expected the"),
        ("CHANGELOG.md", "Unreleased\n", "Unreleased\n\n- more\n", "CHANGELOG.md: expected the"),
    ],
)
def test_a_file_that_differs_is_named(tmp_path, file, old, new, start):
    found = RELEASE.problems(written(tmp_path, file, old, new), "v1.2.0")
    assert any(line.startswith(start) for line in found)


BETWEEN = {
    "pyproject.toml": '[project]\nversion = "1.3.0.dev0"\n',
    "CITATION.cff": "cff-version: 1.2.0\nversion: 1.3.0.dev0\n",
}


def test_between_releases_the_next_version_is_named_and_none_is_released(tmp_path):
    root = written(tmp_path)
    for name, text in BETWEEN.items():
        (root / name).write_text(text)
    assert RELEASE.problems(root) == []
    (root / "CHANGELOG.md").write_text("# Changelog\n\n## 1.3.0 (2026-12-01)\n")
    assert [line.split(":")[0] for line in RELEASE.problems(root)] == ["CHANGELOG.md"]
    (root / "CITATION.cff").write_text(FILES["CITATION.cff"])
    assert [line.split(":")[0] for line in RELEASE.problems(root)] == [
        "CHANGELOG.md",
        "CITATION.cff",
    ]


def test_entries_without_a_version_are_no_problem_between_releases(tmp_path):
    root = written(tmp_path, "CHANGELOG.md", "Unreleased\n", "Unreleased\n\n- more\n")
    assert RELEASE.problems(root) == []
