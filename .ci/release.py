"""Check a release: the versions that the files name, and that the built files can be installed.

    python .ci/release.py versions          # do pyproject.toml, CITATION.cff, CHANGELOG.md agree?
    python .ci/release.py versions v0.2.0   # and do they name 0.2.0?
    python .ci/release.py install dist/*    # install each file in a bare environment, and fly

Between releases the version is that of the next one with .dev0, and the changes stand under
"Unreleased". `make release` and the workflow that publishes run both. They need nothing but Python.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
import tomllib
import venv
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
# "## 0.2.0 (2026-11-27)"
HEADING = re.compile(r"^## (\d+\.\d+\.\d+)(?: \((\d{4}-\d{2}-\d{2})\))?$", re.MULTILINE)
# An entry under "## Unreleased"
UNRELEASED = re.compile(r"^## Unreleased\n+(?!## )(?=\S)", re.MULTILINE)
# Ends the version of pyproject.toml and CITATION.cff between releases
DEV = ".dev0"
# "version: 0.2.0" and "date-released: 2026-11-27"
CITED_VERSION = re.compile(r"^version: (\S+)$", re.MULTILINE)
CITED_DATE = re.compile(r"^date-released: (\S+)$", re.MULTILINE)
MARK = "a package of somebody else"


class Named(NamedTuple):
    """The version that a file names, and the date of its release."""

    version: str
    date: str  # "" if it names none

    def __str__(self) -> str:
        return f"{self.version or 'none'} ({self.date or 'no date'})"


def project_version(root: Path) -> str:
    """Return the version of pyproject.toml."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    return project["project"]["version"]


def cited(root: Path) -> Named:
    """Return what CITATION.cff names."""
    text = (root / "CITATION.cff").read_text(encoding="utf-8")
    version = CITED_VERSION.search(text)
    date = CITED_DATE.search(text)
    return Named(version[1] if version else "", date[1] if date else "")


def newest_change(root: Path) -> Named:
    """Return the newest version that CHANGELOG.md has a heading of."""
    heading = HEADING.search((root / "CHANGELOG.md").read_text(encoding="utf-8"))
    return Named(heading[1], heading[2] or "") if heading else Named("", "")


def problems(root: Path, tag: str | None = None) -> list[str]:
    """Return one line for each file that names another version than pyproject.toml.

    Args:
        root: the folder of the repository.
        tag: the tag of the release, such as "v0.2.0"; None: no release is made.
    """
    version = project_version(root)
    changes = newest_change(root)
    citation = cited(root)
    if tag is None and version.endswith(DEV):
        return _problems_between_releases(version, changes, citation)
    found = []
    if tag is not None and tag != f"v{version}":
        found.append(f"pyproject.toml: expected the version of the tag {tag}, got {version}")
    if tag is not None and UNRELEASED.search((root / "CHANGELOG.md").read_text(encoding="utf-8")):
        found.append(
            "CHANGELOG.md: expected the entries under a version, got some under Unreleased"
        )
    if changes.version != version or not changes.date:
        found.append(f"CHANGELOG.md: expected '## {version} (YYYY-MM-DD)', got {changes}")
    if citation != changes:
        found.append(f"CITATION.cff: expected {changes} as in CHANGELOG.md, got {citation}")
    return found


def _problems_between_releases(version: str, changes: Named, citation: Named) -> list[str]:
    """Return one line for each file that does not fit a version that is not released yet.

    Args:
        version: the version of pyproject.toml, which ends in DEV.
        changes: the newest version that CHANGELOG.md has a heading of.
        citation: what CITATION.cff names.
    """
    found = []
    if changes.version == version.removesuffix(DEV):
        found.append(f"CHANGELOG.md: expected 'Unreleased' until a tag is made, got {changes}")
    if citation != Named(version, ""):
        found.append(f"CITATION.cff: expected {version} without a date, got {citation}")
    return found


def install(file: Path, version: str) -> None:
    """Install a built file in a bare environment beside a foreign package `web`, and fly.

    Raises:
        SystemExit: a step failed; the line names it.
    """
    with tempfile.TemporaryDirectory() as made:
        environment = Path(made) / "environment"
        elsewhere = Path(made) / "elsewhere"
        elsewhere.mkdir()
        venv.create(environment, with_pip=True)
        python = environment / "bin/python"
        (packages,) = environment.glob("lib/python*/site-packages")
        for name in ("web", "controllers", "courses"):
            (packages / name).mkdir()
            (packages / name / "__init__.py").write_text(f"MARK = {MARK!r}\n", encoding="utf-8")

        run(
            [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", file],
            elsewhere,
        )
        printed = run([environment / "bin/race", "--version"], elsewhere)
        expect(file, "race --version", f"race {version}", printed.strip())
        asked = "import quadsim; print(quadsim.__version__, len(quadsim.courses()))"
        printed = run([python, "-c", asked], elsewhere)
        expect(file, "import quadsim", version, printed.split()[0])
        for name in ("web", "controllers", "courses"):
            printed = run([python, "-c", f"import {name}; print({name}.MARK)"], elsewhere)
            expect(file, f"import {name}", MARK, printed.strip())
        flown = run(
            [environment / "bin/race", "fly", "--timeout", "1", "--json"], elsewhere, code=1
        )
        expect(file, "race fly --timeout 1", "timeout", json.loads(flown)["outcome"])
    print(f"{file.name}: installed, imported and flown from another folder")


def run(command: list[str | Path], folder: Path, code: int = 0) -> str:
    """Return what a command prints.

    Raises:
        SystemExit: its exit code is not the expected one.
    """
    # Nothing of the checkout may be found by chance
    bare = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    done = subprocess.run(command, cwd=folder, env=bare, capture_output=True, text=True)
    if done.returncode != code:
        words = " ".join(map(str, command))
        raise SystemExit(
            f"{words}: expected exit code {code}, got {done.returncode}\n{done.stderr}"
        )
    return done.stdout


def expect(file: Path, what: str, wanted: str, got: str) -> None:
    """Raise SystemExit unless a step has given what is wanted."""
    if wanted != got:
        raise SystemExit(f"{file.name}: {what}: expected {wanted!r}, got {got!r}")


def main(words: list[str]) -> int:
    """Run one of the two commands; see the top of this file."""
    if words[:1] == ["versions"] and len(words) <= 2:
        found = problems(ROOT, *words[1:])
        print("\n".join(found) or f"version {project_version(ROOT)}")
        return 1 if found else 0
    if words[:1] == ["install"] and len(words) > 1:
        for file in words[1:]:
            install(Path(file).resolve(), project_version(ROOT))
        return 0
    print(f"release.py: expected versions [TAG], or install FILE..., got {words}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
