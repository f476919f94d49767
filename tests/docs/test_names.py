"""Every page of the repository names only what there is: files, code, commands, flags, keywords."""

import re
import sqlite3
import tomllib

import pytest
import yaml

from quadsim.campaign.heats.store import HeatStore
from quadsim.campaign.run.store import Store
from quadsim.cli.commands import GROUPS
from tests.docs import names
from tests.docs.names import missing_flags, missing_keywords, missing_links, missing_names, pages
from tests.docs.pages import ROOT

# What is right, and below it the same with a mistake each
RIGHT = """# Title

See `quadsim/config/spec.py`, `tests/docs/`, `trace.py`, `tests/lap_times/*.yaml`, [it](#title),
`quadsim.fly`, `quadsim.fly("figure8", laps=1)`,
`quadsim.controllers.costs.race_targets.GateTarget`, `quadsim.__version__`, `Spec.but`, `race
fly`, `make docs-version VERSION=0.1`, `--target-ess 20`, `pytest tests/docs -k name`,
`@pytest.mark.compiled`, `pip install --editable '.[limit]'`,
`python -m quadsim.tables.write_tables` and `test_the_pages_name_only_what_there_is`.

    race limit figure8                      # with CasADi: pip install 'casadi>=3.6.4,<4'
    NAME=1 race compare figure8 --attempts 2
      --variants slow=colored+thrust-to-weight=2

```python
from quadsim.sensing.camera import load_camera
```
"""
WRONG = {
    "names": {
        "quadsim/config/spec.py": "quadsim/config/gone.py",
        "tests/docs/`": "tests/gone/`",
        "`trace.py`": "`gone.py`",
        "tests/lap_times/*.yaml": "tests/lap_times/*.gone",
        "`quadsim.fly`": "`quadsim.gone`",
        "race_targets.GateTarget": "race_targets.Gone",
        "Spec.but": "Spec.gone",
        "race\nfly": "race\ngone",
        "make docs-version": "make gone",
        "VERSION=": "GONE=",
        "pytest tests/docs": "pytest tests/gone",
        "mark.compiled": "mark.gone",
        "'.[limit]'": "'.[gone]'",
        "--editable ": "",
        "quadsim.tables.write_tables": "quadsim.config.gone",
        "test_the_pages_name_only": "test_the_pages_name_gone",
        "'casadi>=3.6.4,<4'": "'casadi>=2'",
        "install 'casadi>=3.6.4,<4'": "install quadsim",
        "import load_camera": "import gone",
    },
    "links": {"(#title)": "(#gone)", "[it](#title)": "[it](gone.md)"},
    "flags": {
        "--target-ess": "--gone",
        "--attempts": "--gone",
        "--variants slow": "--gone slow",
        "thrust-to-weight": "gone",
    },
    "keywords": {"laps=1": "gone=1"},
}
CHECKS = {
    "names": missing_names,
    "links": missing_links,
    "flags": missing_flags,
    "keywords": missing_keywords,
}


@pytest.mark.parametrize("kind", CHECKS)
def test_the_pages_name_only_what_there_is(kind):
    found = {page.relative_to(ROOT).as_posix(): CHECKS[kind](page) for page in pages()}
    assert len(found) > 25
    assert {page: missing for page, missing in found.items() if missing} == {}


@pytest.mark.parametrize("kind", CHECKS)
def test_a_name_of_nothing_is_found(kind, tmp_path, monkeypatch):
    monkeypatch.setattr("tests.docs.pages.ROOT", tmp_path)
    page = tmp_path / "page.md"
    page.write_text(RIGHT)
    assert CHECKS[kind](page) == []
    for right, wrong in WRONG[kind].items():
        assert RIGHT.count(right) == 1, right
        page.write_text(RIGHT.replace(right, wrong))
        assert len(CHECKS[kind](page)) == 1, wrong


def test_the_queries_on_the_pages_are_of_columns_that_a_campaign_has(tmp_path):
    file = tmp_path / "campaign.sqlite"
    with Store(file), HeatStore(file), sqlite3.connect(file) as database:
        queries = [
            query
            for page in pages()
            for query in re.findall(r'^sqlite3 \S+ "(.*)"$', page.read_text(), re.MULTILINE)
        ]
        assert queries
        for query in queries:
            database.execute(query)


def test_the_table_of_packages_is_in_the_order_of_the_contract_of_imports():
    """docs/architecture.md begins with the lowest layer, the contract with the highest."""
    contracts = names.PROJECT["tool"]["importlinter"]["contracts"]
    (layers,) = [c["layers"] for c in contracts if c["name"] == "imports point downwards"]
    text = (ROOT / "docs/architecture.md").read_text().partition("\n## Packages")[2]
    table = text.partition("\n## ")[0]
    rows = re.findall(r"^\| (`.*?) \|", table, re.MULTILINE)
    assert [packages(row) for row in rows] == [
        sorted(layer.replace(" ", "").split("|")) for layer in reversed(layers)
    ]


def packages(row: str) -> list[str]:
    """Return the modules of a row: "`run.py` of `quadsim`", "`quadsim/learn`, `quadsim/limit`"."""
    spans = [span.removesuffix(".py").replace("/", ".") for span in re.findall(r"`(.+?)`", row)]
    if " of " in row:
        *files, package = spans
        spans = [f"{package}.{file}" for file in files]
    return sorted(spans)


def test_one_address_of_the_repository_is_named_wherever_one_is():
    """As long as pyproject.toml names none, the README tells how to find the address."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    site = yaml.load((ROOT / "mkdocs.yml").read_text(), yaml.BaseLoader)
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    address = project.get("urls", {}).get("Repository")
    assert [site.get("repo_url"), citation.get("repository-code")] == [address] * 2
    assert f"git clone {address or 'ADDRESS'} quadsim" in (ROOT / "README.md").read_text()


def test_the_page_of_commands_has_the_groups_of_the_help():
    page = (ROOT / "docs" / "commands.md").read_text()
    *sections, _ = page.split("\n## ")[1:]  # the last one describes outputs
    found = {}
    for section in sections:
        title, *lines = section.splitlines()
        cells = [line.split(" | ")[0] for line in lines if line.startswith("| `race ")]
        found[title] = set(re.findall(r"`race ([\w-]+)", " ".join(cells)))
    assert found == {title: set(commands) for title, commands in GROUPS.items()}
