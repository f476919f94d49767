"""The notebooks of examples/ are stored with what their cells print.

`make docs-check` runs them as they stand; tests/test_examples.py runs them on a short course.
"""

import contextlib
import io
import json
import re
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

from tests.docs.test_pages import missing

FOLDER = Path(__file__).parents[1] / "examples" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
# [bytes] A stored notebook is part of every checkout.
MOST = 300_000
# Paths of a machine, and addresses of objects.
OF_A_MACHINE = re.compile(r"/(?:home|root|tmp|Users|work)/| at 0x")

by_notebook = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def cells(path: Path) -> list[dict]:
    """Return the cells of a notebook that hold code."""
    return [cell for cell in json.loads(path.read_text())["cells"] if cell["cell_type"] == "code"]


def run(path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Run the cells of a notebook in a folder, and return what each prints on stdout."""
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.chdir(folder)
    # A dataclass looks for the module that it is defined in.
    names = {"__name__": "__main__"}
    printed = []
    for cell in cells(path):
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            exec(compile("".join(cell["source"]), path.name, "exec"), names)
        printed.append(out.getvalue())
    plt.close("all")
    return printed


def stored_text(cell: dict) -> str:
    """Return what a cell printed when the notebook was stored."""
    return "".join("".join(output.get("text", "")) for output in cell["outputs"])


def test_there_are_notebooks():
    assert len(NOTEBOOKS) >= 3


@pytest.mark.docs
@by_notebook
def test_a_notebook_prints_what_is_stored_in_it(path, tmp_path, monkeypatch):
    """Randomized flights differ in their last digits between two processors with AVX-512, too."""
    for cell, printed in zip(cells(path), run(path, tmp_path, monkeypatch), strict=True):
        assert missing(stored_text(cell).splitlines(), printed, flown=True, digits=False) == []


@by_notebook
def test_a_stored_notebook_was_run_from_top_to_bottom_without_an_error(path):
    found = cells(path)
    assert [cell["execution_count"] for cell in found] == list(range(1, len(found) + 1))
    kinds = {output["output_type"] for cell in found for output in cell["outputs"]}
    assert kinds <= {"stream", "display_data", "execute_result"}
    pictures = [o for cell in found for o in cell["outputs"] if "image/png" in o.get("data", {})]
    assert pictures


@by_notebook
def test_a_stored_notebook_says_nothing_of_the_machine_that_ran_it(path):
    notebook = json.loads(path.read_text())
    assert notebook["metadata"]["language_info"] == {"name": "python"}
    assert [cell["metadata"] for cell in notebook["cells"]] == [{}] * len(notebook["cells"])
    outputs = [output for cell in cells(path) for output in cell["outputs"]]
    assert [output for output in outputs if output.get("name") == "stderr"] == []
    texts = ["".join(o.get("text", o.get("data", {}).get("text/plain", ""))) for o in outputs]
    assert [text for text in texts if OF_A_MACHINE.search(text)] == []
    assert path.stat().st_size < MOST
