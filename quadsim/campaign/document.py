"""Results as documents: blocks that are printed, shown in a notebook, stored and sent to the page.

A document is a value without a medium. `renderables` gives it for a terminal, `markdown` and `html`
as text, and msgspec as JSON, from which the page builds its own elements.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeVar

import msgspec
from rich.console import Group, RenderableType
from rich.markup import escape
from rich.padding import Padding

from quadsim.console import as_text, plain_table, width
from quadsim.figures import html
from quadsim.figures.style import save_figure, write_figure
from quadsim.record.whole_files import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Columns of the terminal: left of a table or a line, between the columns of a table, and the least
# width of a text that wraps
INDENT = 2
GAP = 2
TEXT = 24
NAME_LENGTH = 120  # most characters of the names that stand in the name of a report's files

Item = TypeVar("Item")


class Heading(msgspec.Struct, frozen=True, tag="heading"):
    """The subject of the next blocks, and the conditions of its flights."""

    text: str
    detail: str = ""
    # 1 for a part of the document, 2 for a part of a part
    level: int = 1


class Line(msgspec.Struct, frozen=True, tag="line"):
    """A result as a line of text."""

    text: str


class Note(msgspec.Struct, frozen=True, tag="note"):
    """A remark that has to be read with the tables."""

    text: str


class Table(msgspec.Struct, frozen=True, tag="table"):
    """A table of text: columns of text are aligned left, columns of numbers right."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    # columns of text; all but the first may wrap at spaces
    texts: tuple[int, ...] = (0,)

    @classmethod
    def of(
        cls,
        items: Sequence[Item],
        columns: Mapping[str, Callable[[Item], str]],
        texts: tuple[int, ...] = (0,),
    ) -> Self:
        """Return a table with one row for each item.

        Args:
            items: what the rows are about.
            columns: head of each column, and the function that returns its cell for an item.
            texts: the columns of text.
        """
        rows = tuple(tuple(cell(item) for cell in columns.values()) for item in items)
        return cls(tuple(columns), rows, texts)


class Picture(msgspec.Struct, frozen=True, tag="picture"):
    """The place of the document's figure, and its description for screen readers."""

    described: str


Block = Heading | Line | Note | Table | Picture


class Document(msgspec.Struct, frozen=True):
    """The blocks of a result, from top to bottom."""

    blocks: tuple[Block, ...]

    def renderables(self) -> list[RenderableType]:
        """Return the parts that a console prints, with empty lines between them; no pictures."""
        parts: list[RenderableType] = []
        for blocks in _paragraphs([b for b in self.blocks if not isinstance(b, Picture)]):
            if parts:
                parts.append("")
            parts += map(_printed, blocks)
        return parts

    def markdown(self, picture: str) -> str:
        """Return the document as Markdown, with a link to the file of its picture."""
        paragraphs = [
            "\n".join(_as_markdown(block, picture) for block in blocks)
            for blocks in _paragraphs(self.blocks)
        ]
        return "\n\n".join(paragraphs) + "\n"

    def html(self, figure: Figure | None) -> str:
        """Return the document as HTML for a notebook, with its figure."""
        return html.block(*(_as_html(block, figure) for block in self.blocks))

    def save(self, folder: Path, stem: str, figure: Figure) -> list[Path]:
        """Write the document as Markdown and JSON, and its figure as PNG and SVG.

        Args:
            folder: folder for the files.
            stem: name of the files without its ending.
            figure: the figure.

        Returns:
            The files: Markdown, JSON, PNG, SVG.

        Raises:
            RunError: the folder cannot be written.
        """
        figures = write_figure(figure, folder, stem)
        text = folder / f"{stem}.md"
        write_whole(text, self.markdown(figures[0].name).encode())
        blocks = folder / f"{stem}.json"
        write_whole(blocks, msgspec.json.encode(self))
        return [text, blocks, *figures]


class Documented(ABC):
    """A result that is shown as a document: by `print`, in a notebook, and in files."""

    @abstractmethod
    def document(self) -> Document:
        """Return the tables and remarks of the result."""

    @abstractmethod
    def as_json(self) -> dict[str, Any]:
        """Return the numbers as plain dictionaries; a number that is not known is None."""

    @abstractmethod
    def _drawn(self) -> Figure:
        """Draw the figure of the result."""

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw the result.

        Args:
            path: a file to write: .png, .svg or .pdf; None writes nothing.
        """
        figure = self._drawn()
        if path is not None:
            save_figure(figure, Path(path))
        return figure

    def save(self, folder: Path, stem: str) -> list[Path]:
        """Write the result as Markdown, JSON, PNG and SVG, and return the files.

        Args:
            folder: folder for the files.
            stem: name of the files without its ending.

        Raises:
            RunError: the folder cannot be written.
        """
        return self.document().save(folder, stem, self._drawn())

    def __str__(self) -> str:
        return as_text(*self.document().renderables())

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the tables, their remarks, and the figure."""
        document = self.document()
        return document.html(self._drawn() if document.blocks else None)


def file_stem(names: Sequence[str], digits: str) -> str:
    """Return the name of a report's files without its ending.

    Args:
        names: what the report is about.
        digits: hex digits that tell it from reports with other flags.
    """
    joined = "_".join(names)[:NAME_LENGTH]
    return f"{re.sub('[/=:+]', '-', joined)}_{digits}"


def _paragraphs(blocks: Sequence[Block]) -> Iterator[list[Block]]:
    """Yield lines that follow each other together, notes too, and every other block alone."""
    for kind, together in groupby(blocks, type):
        if kind in (Line, Note):
            yield list(together)
        else:
            yield from ([block] for block in together)


def _printed(block: Block) -> RenderableType:
    """Return a block as a console prints it."""
    match block:
        case Heading(text, detail):
            return f"[bold]{escape(text)}[/]  {escape(detail)}"
        case Line(text):
            return f"{' ' * INDENT}{escape(text)}"
        case Note(text):
            return f"{' ' * INDENT}[dim]{escape(text)}[/]"
        case Table():
            return Padding(as_table(block), (0, 0, 0, INDENT), expand=False)
        case Picture():
            return ""


def _as_markdown(block: Block, picture: str) -> str:
    match block:
        case Heading(text, detail, level):
            sentence = f"\n\n{detail[0].upper()}{detail[1:]}." if detail else ""
            return f"{'#' * (level + 1)} {text}{sentence}"
        case Line(text) | Note(text):
            return f"* {text}"
        case Table():
            return as_markdown(block)
        case Picture():
            return f"![]({picture})"


def _as_html(block: Block, figure: Figure | None) -> str:
    match block:
        case Heading(text, detail, level):
            tag = f"h{level + 3}"
            below = html.paragraph(detail) if detail else ""
            return f"<{tag}>{html.text(text)}</{tag}>{below}"
        case Line(text) | Note(text):
            return html.paragraph(text)
        case Table(head, rows, texts):
            return html.table([cell.replace("\n", " ") for cell in head], rows, texts)
        case Picture(described):
            return html.image(figure, described) if figure else ""


def as_markdown(table: Table) -> str:
    """Return a table as Markdown."""
    rule = ("---", *["---:"] * (len(table.head) - 1))
    lines = [[cell.replace("\n", " ") for cell in row] for row in (table.head, rule, *table.rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def as_table(table: Table, columns: int | None = None) -> Group:
    """Return a table in a form that a console prints.

    A table that is too wide becomes several, one below the other, each with the first column. No
    word is broken.

    Args:
        table: what to print.
        columns: the width of the terminal; None: of this one.
    """
    room = (width() if columns is None else columns) - INDENT
    widths = [_least_width(table, i) for i in range(len(table.head))]
    # The first column is a name, which is broken if it leaves no room for another column.
    widths[0] = min(widths[0], max(TEXT, room - GAP - max(widths[1:])))
    shown: list[RenderableType] = []
    for part in _parts(widths, room):
        shown += ["", _part_of(table, part, widths)]
    return Group(*shown[1:])


def _least_width(table: Table, column: int) -> int:
    """Return the least width of a column in which no word is broken."""
    cells = [row[column] for row in table.rows]
    lines = [*table.head[column].split("\n"), *cells]
    longest = max(map(len, lines))
    if column not in table.texts[1:]:
        return longest
    words = [len(word) for line in lines for word in line.split()]
    return min(longest, max(TEXT, *words))


def _parts(widths: Sequence[int], room: int) -> list[list[int]]:
    """Return the columns of each part, which all begin with the first column."""
    parts = [[0]]
    for column in range(1, len(widths)):
        needed = sum(widths[k] + GAP for k in (*parts[-1], column)) - GAP
        if len(parts[-1]) > 1 and needed > room:
            parts.append([0])
        parts[-1].append(column)
    return parts


def _part_of(table: Table, part: Sequence[int], widths: Sequence[int]) -> RenderableType:
    shown = plain_table()
    for column in part:
        text = column in table.texts
        shown.add_column(
            escape(table.head[column]),
            justify="left" if text else "right",
            no_wrap=not text,
            overflow="fold",
            min_width=widths[column],
        )
    for row in table.rows:
        shown.add_row(*(escape(row[column]) for column in part))
    return shown
