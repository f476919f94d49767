"""The API page has every public name, and an example of each that runs as a doctest."""

import doctest
import re
from collections.abc import Iterator
from importlib import import_module
from typing import Any

import pytest

import quadsim
from quadsim import controllers
from tests.docs.pages import ROOT

# "::: quadsim.api.fly"
ENTRY = re.compile(r"^::: (\S+)$", re.MULTILINE)
PAGE = (ROOT / "docs/api.md").read_text()
ENTRIES = ENTRY.findall(PAGE)
# Modules of entries that an extra installs.
NEEDS = {"quadsim.learn": "gymnasium", "quadsim.learn.stable_baselines": "stable_baselines3"}
OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def entry(path: str) -> Any:
    """Return the object of an entry of the page."""
    module, _, name = path.rpartition(".")
    for start, package in NEEDS.items():
        if module.startswith(start):
            pytest.importorskip(package)
    return getattr(import_module(module), name)


def examples(path: str) -> Iterator[doctest.DocTest]:
    """Yield the doctest of an entry, and those of its members."""
    found = entry(path)
    finder = doctest.DocTestFinder(exclude_empty=True)
    # no names of the module: a reader of the page has none of them either
    yield from (test for test in finder.find(found, path, globs={}) if test.examples)


@pytest.mark.parametrize("package", [quadsim, controllers], ids=lambda package: package.__name__)
def test_the_page_has_every_public_name(package):
    described = {path.rpartition(".")[2] for path in ENTRIES}
    # a table of numbers has no docstring: it is described in a sentence
    in_sentences = {name for name in package.__all__ if f"`{package.__name__}.{name}`" in PAGE}
    assert set(package.__all__) - described - in_sentences == set()


@pytest.mark.docs
@pytest.mark.parametrize("path", ENTRIES)
def test_an_entry_has_an_example_that_prints_what_it_says(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    tests = list(examples(path))
    assert tests, f"{path} has no example"
    said: list[str] = []
    for test in tests:
        doctest.DocTestRunner(optionflags=OPTIONS).run(test, out=said.append)
    assert said == []


def test_a_wrong_example_is_found():
    def wrong():
        """
        >>> 1 + 1
        3
        """

    (test,) = doctest.DocTestFinder().find(wrong, "wrong", globs={})
    said: list[str] = []
    doctest.DocTestRunner(optionflags=OPTIONS).run(test, out=said.append)
    assert "Expected:" in said[0]
