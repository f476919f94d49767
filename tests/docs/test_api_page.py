"""The API reference has every public name once, and an example of each that runs as a doctest.

Examples that make the same call share what it returns: the same arguments give the same flights to
the last bit, which tests/config/test_spec.py claims.
"""

import doctest
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from types import ModuleType
from typing import Any

import pytest
import yaml

import quadsim
from docs.api_reference import FOLDER, OVERVIEW, Section, first_sentence, overview, public_name
from quadsim import controllers
from tests.docs.pages import ROOT

SECTIONS = [
    Section(f"{FOLDER}{path.name}", path.read_text())
    for path in sorted((ROOT / "docs" / FOLDER).glob("*.md"))
]
ENTRIES = [path for section in SECTIONS for path in section.entries]
# Modules of entries that an extra installs.
NEEDS = {"quadsim.learn": "gymnasium", "quadsim.learn.stable_baselines": "stable_baselines3"}
OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
# Functions whose results examples share
SHARED = ("compare", "compare_heats", "fly", "race", "sweep")


def entry(path: str) -> Any:
    """Return the object of an entry."""
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


def missing(sections: list[Section], package: ModuleType) -> set[str]:
    """Return the public names of a package that are on none of the pages."""
    described = {path.rpartition(".")[2] for section in sections for path in section.entries}
    # a table of numbers has no docstring: it is described in a sentence
    text = "".join(section.text for section in sections)
    in_sentences = {name for name in package.__all__ if f"`{package.__name__}.{name}`" in text}
    return set(package.__all__) - described - in_sentences


def repeated(sections: list[Section]) -> list[str]:
    """Return the names that stand more than once on the pages."""
    names = Counter(path.rpartition(".")[2] for one in sections for path in one.entries)
    return [name for name, count in names.items() if count > 1]


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
def test_the_pages_have_every_public_name(package):
    assert missing(SECTIONS, package) == set()
    for section in SECTIONS:
        others = [other for other in SECTIONS if other is not section]
        own = {path.rpartition(".")[2] for path in section.entries}
        assert missing(others, package) >= own & set(package.__all__)


def test_no_name_stands_twice_on_the_pages():
    assert repeated(SECTIONS) == []
    assert repeated([*SECTIONS, Section("twice.md", "::: quadsim.api.fly\n")]) == ["fly"]


def test_the_menu_has_every_page_of_the_reference():
    menu = yaml.safe_load((ROOT / "mkdocs.yml").read_text())["nav"]
    (reference,) = (part["Reference"] for part in menu if "Reference" in part)
    (pages,) = (part["API"] for part in reference if "API" in part)
    addresses = [address for page in pages for address in page.values()]
    assert sorted(addresses) == sorted([OVERVIEW, *(section.address for section in SECTIONS)])
    titles = {address: title for page in pages for title, address in page.items()}
    assert [one.address for one in SECTIONS if titles[one.address] != one.title] == []


def test_the_overview_links_to_every_entry():
    page = overview(SECTIONS, lambda path: f"What {path} does: all. More.\n\nDetails.")
    rows = [f"| [`{p.rpartition('.')[2]}`][{p}] | What {p} does: all. |" for p in ENTRIES]
    assert [line for line in page.splitlines() if line.startswith("| [")] == rows
    assert [one.address for one in SECTIONS if f"## [{one.title}]({one.address})" not in page] == []


def test_a_sentence_does_not_end_at_an_abbreviation():
    assert (
        first_sentence("By Kim et al. 2022 in\n1.5 pages. More.")
        == "By Kim et al. 2022 in 1.5 pages."
    )
    assert first_sentence("No period") == "No period."


def test_the_public_name_of_an_entry_is_the_same_object():
    plain = [path for path in ENTRIES if not path.startswith(tuple(NEEDS))]
    assert len(plain) > 80
    assert [path for path in plain if entry(public_name(path)) is not entry(path)] == []
    assert public_name("quadsim.api.fly") == "quadsim.fly"
    assert public_name("quadsim.controllers.costs.crash") == "quadsim.controllers.crash"


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
