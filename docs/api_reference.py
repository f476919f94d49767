"""The API reference: the entries of its pages, and the tables of its overview, made from them.

The pages in docs/api/ hold one line `::: quadsim.api.fly` for each entry, which mkdocstrings
replaces by the entry's docstring. Their order is that of the navigation in mkdocs.yml.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from importlib import import_module

OVERVIEW = "api.md"
FOLDER = "api/"

# "::: quadsim.api.fly"
ENTRY = re.compile(r"^::: (\S+)$", re.MULTILINE)
TITLE = re.compile(r"^# (.*)$", re.MULTILINE)
# The period at the end of a sentence, not that of "et al."
PERIOD = re.compile(r"(?<!\bal)\.(?= |$)")
# The heading of an entry, and the name in it
HEADING = re.compile(
    r'(?P<start><h2 id="(?P<path>quadsim\.[\w.]+)" class="doc doc-heading">.*?)'
    r'(?P<name><span class="doc doc-object-name)',
    re.DOTALL,
)


@dataclass(frozen=True)
class Section:
    """A page of the reference.

    Attributes:
        address: its file, seen from docs/.
        text: its Markdown.
    """

    address: str
    text: str

    @property
    def title(self) -> str:
        """Return the page's heading."""
        found = TITLE.search(self.text)
        if found is None:
            raise ValueError(f"{self.address}: expected a heading, # Title")
        return found[1]

    @property
    def entries(self) -> list[str]:
        """Return the paths of the page's entries, as in "quadsim.api.fly"."""
        return ENTRY.findall(self.text)


def overview(sections: Iterable[Section], docstring: Callable[[str], str]) -> str:
    """Return a table of the names of each section, with the first sentence of their docstrings.

    Args:
        sections: the pages of the reference.
        docstring: returns the docstring of the object with a path.
    """
    return "\n\n".join("\n".join(_table(section, docstring)) for section in sections) + "\n"


def _table(section: Section, docstring: Callable[[str], str]) -> Iterator[str]:
    yield f"## [{section.title}]({section.address})"
    yield ""
    yield "| name | description |"
    yield "|---|---|"
    for path in section.entries:
        name = path.rpartition(".")[2]
        sentence = first_sentence(docstring(path)).replace("|", r"\|")
        yield f"| [`{name}`][{path}] | {sentence} |"


def first_sentence(docstring: str) -> str:
    """Return the first sentence of a docstring, on one line."""
    paragraph = " ".join(docstring.strip().partition("\n\n")[0].split())
    return PERIOD.split(paragraph, maxsplit=1)[0] + "."


def public_name(path: str) -> str:
    """Return the path by which users import an object, as in "quadsim.fly" of "quadsim.api.fly".

    It is the outermost package whose `__all__` has the name, and the path itself if none has.
    """
    module, _, name = path.rpartition(".")
    parts = module.split(".")
    for depth in range(1, len(parts)):
        package = ".".join(parts[:depth])
        if name in getattr(import_module(package), "__all__", ()):
            return f"{package}.{name}"
    return path


def with_public_names(page_html: str, section: Section) -> str:
    """Return a page whose headings of entries have the module that a name is imported from.

    Args:
        page_html: the page as mkdocstrings writes it.
        section: its source.

    Raises:
        ValueError: not every entry has a heading, as when mkdocstrings writes another HTML.
    """

    def heading(found: re.Match[str]) -> str:
        module = public_name(found["path"]).rpartition(".")[0]
        return f'{found["start"]}<span class="module">{module}.</span><wbr>{found["name"]}'

    named, count = HEADING.subn(heading, page_html)
    if count != len(section.entries):
        raise ValueError(
            f"{section.address}: expected a heading <h2> for each of {len(section.entries)} "
            f"entries, found {count}"
        )
    return named
