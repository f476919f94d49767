"""The API page has every public name, and an example of each that runs as a doctest.

Examples that make the same call share what it returns: the same arguments give the same flights to
the last bit, which tests/config/test_spec.py claims.
"""

import doctest
import re
from collections.abc import Callable, Iterator, Mapping
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
# Functions whose results examples share
SHARED = ("compare", "compare_heats", "fly", "race", "sweep")


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


def is_plain(value: Any) -> bool:
    """Return whether equal texts of a value mean equal values."""
    if isinstance(value, Mapping):
        return all(map(is_plain, value.values()))
    if isinstance(value, list | tuple):
        return all(map(is_plain, value))
    return value is None or isinstance(value, str | int | float)


@pytest.fixture(scope="session")
def shared() -> dict[str, Any]:
    """Return {name: function} that flies equal calls once."""
    known: dict[str, Any] = {}

    def sharing(name: str) -> Callable[..., Any]:
        function = getattr(quadsim, name)

        def called(*arguments: Any, **settings: Any) -> Any:
            if not is_plain([arguments, settings]):
                return function(*arguments, **settings)
            call = repr((name, arguments, settings))
            if call not in known:
                known[call] = function(*arguments, **settings)
            return known[call]

        return called

    return {name: sharing(name) for name in SHARED}


@pytest.mark.parametrize("package", [quadsim, controllers], ids=lambda package: package.__name__)
def test_the_page_has_every_public_name(package):
    described = {path.rpartition(".")[2] for path in ENTRIES}
    # a table of numbers has no docstring: it is described in a sentence
    in_sentences = {name for name in package.__all__ if f"`{package.__name__}.{name}`" in PAGE}
    assert set(package.__all__) - described - in_sentences == set()


@pytest.mark.docs
@pytest.mark.parametrize("path", ENTRIES)
def test_an_entry_has_an_example_that_prints_what_it_says(path, shared, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    tests = list(examples(path))
    # After the examples are found: their functions are still those of the page.
    for name, function in shared.items():
        monkeypatch.setattr(quadsim, name, function, raising=False)
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
