"""`make race` on a machine whose first Python is not fit: nothing is left that makes the right one
fail."""

import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
UNFIT = {
    "too old": "import sys; sys.version_info = (3, 10, 4)",
    "too new": "import sys; sys.version_info = (3, 14, 0)",
    "without ensurepip": "import sys; sys.modules['ensurepip'] = None",
}
VENV = """#!/bin/sh
# Stands in for a Python: -c CODE runs behind a first line, -m venv makes a folder, everything else fails.
case "$1" in
-c) exec {python} -c "{first}
$2" ;;
-m) mkdir -p .venv/bin && cp "$0" .venv/bin/python; test "$2" = venv ;;
*) exit 1 ;;
esac
"""


@pytest.fixture
def checkout(tmp_path):
    """checkout(first line of Python) -> `make` there with such a Python."""
    if not shutil.which("make"):
        pytest.skip("make is not installed")
    for name in ("Makefile", "pyproject.toml"):
        shutil.copy(ROOT / name, tmp_path)

    def make(first):
        python = tmp_path / "python-of-this-machine"
        python.write_text(VENV.format(python=sys.executable, first=first))
        python.chmod(python.stat().st_mode | stat.S_IXUSR)
        command = ["make", "--silent", ".venv/.app", f"PYTHON={python}"]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    return make


@pytest.mark.parametrize("first", UNFIT.values(), ids=UNFIT)
def test_an_unfit_python_is_named_and_leaves_no_environment(first, checkout, tmp_path):
    done = checkout(first)
    assert done.returncode != 0
    assert done.stderr.startswith("needs Python 3.11 to 3.13 with venv, tried: ")
    assert not (tmp_path / ".venv").exists()


def test_a_fit_python_makes_the_environment_also_in_the_place_of_an_unfit_one(checkout, tmp_path):
    unfit = tmp_path / ".venv" / "bin" / "python"
    unfit.parent.mkdir(parents=True)
    unfit.write_text("#!/bin/sh\nexit 1\n")
    unfit.chmod(0o755)
    done = checkout("pass")
    assert "needs Python" not in done.stderr
    assert "Stands in for" in unfit.read_text()
