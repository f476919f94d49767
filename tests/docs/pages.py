"""Read README.md and docs/*.md: the sections of a page, its examples, results and commands.

A page follows these conventions:

* Code in a language is fenced with its name. A command line begins with a word of PROGRAMS, in a
  block or between backticks in a sentence.
* A block without a language holds commands, or the output of a command, and a line of commands may
  begin with "$ ". A drawing or a formula with decimal numbers is fenced as `text`.
* A table of results has right-aligned columns.
* A result belongs to the nearest commands above it in its section.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
PROGRAMS = (
    "race", "make", "python", "pytest", ".venv/bin/python", "printf", "pip", "dask", "sqlite3",
)  # fmt: skip
# A sentence that names a command without arguments mentions it, unless it is one of these.
COMPLETE = {"race courses", "race vehicles", "race sensings", "race bench"}

HEADING = re.compile(r"#{1,6} ")
FENCE = re.compile(r" *```(\w*)")
SPAN = re.compile(r"`([^`]+)`")
ALIGNMENT = re.compile(r"\|[-:| ]+\|$")
DECIMAL = re.compile(r"\d\.\d")
# "  # ..." behind a command.
REMARK = re.compile(r"\s+# .*")


@dataclass
class Block:
    """A piece of a page: prose, code in a language ("" if it has none), or a table."""

    page: str
    line: int
    kind: str
    lines: list[str] = field(default_factory=list)

    @property
    def name(self) -> str:
        """Return the page and line, for messages."""
        return f"{self.page}:{self.line}"

    @property
    def commands(self) -> list[str]:
        """Return the command lines that stand in the block."""
        if self.kind == "prose":
            # A span may be broken over two lines.
            text = " ".join(line.strip() for line in self.lines)
            found = [span for span in SPAN.findall(text) if not _is_mention(span)]
        elif self.kind == "":
            found = [REMARK.sub("", line.strip().removeprefix("$ ")) for line in self.lines]
        else:
            found = []
        return [command for command in found if is_command(command)]

    @property
    def output(self) -> list[str]:
        """Return the lines of a block without a language that are no commands."""
        return [line for line in self.lines if line.strip() and not _is_entered(line)]

    @property
    def is_result(self) -> bool:
        """Return whether a command has printed the block, or what its rows hold."""
        if self.kind == "table":
            return "-:" in self.lines[1]
        if self.kind != "":
            return False
        return any(map(DECIMAL.search, self.output)) or (
            bool(self.output) and any(line.strip().startswith("$ ") for line in self.lines)
        )

    @property
    def rows(self) -> list[list[str]]:
        """Return the cells of a table; the first row has the heads of the columns."""
        lines = [self.lines[0], *self.lines[2:]]
        return [[cell.strip() for cell in line.strip()[1:-1].split("|")] for line in lines]


@dataclass
class Result:
    """Printed numbers, and the block with the commands that made them; None if there is none."""

    block: Block
    source: Block | None

    @property
    def commands(self) -> list[str]:
        """Return the commands that made the numbers."""
        return self.source.commands if self.source else []


def is_command(line: str) -> bool:
    """Return whether a line begins with the name of a program."""
    program, _, arguments = line.partition(" ")
    return program in PROGRAMS and bool(arguments)


def blocks(path: Path) -> list[list[Block]]:
    """Return the sections of a page, each a list of its blocks."""
    return [_blocks(path, *section) for section in _sections(path.read_text().splitlines())]


def results(path: Path) -> list[Result]:
    """Return the printed results of a page."""
    found = []
    for section in blocks(path):
        source = None
        for block in section:
            if block.is_result:
                own = block if block.commands else source
                found.append(Result(block, own))
            elif block.commands:
                source = block
    return found


def _sections(lines: list[str]) -> Iterator[tuple[int, list[str]]]:
    """Yield the number of the first line and the lines of each section."""
    start = 0
    fenced = False
    for i, line in enumerate(lines):
        if FENCE.match(line):
            fenced = not fenced
        if HEADING.match(line) and not fenced:
            yield start, lines[start:i]
            start = i
    yield start, lines[start:]


def _blocks(path: Path, start: int, lines: list[str]) -> list[Block]:
    found: list[Block] = []
    fenced = False
    page = path.relative_to(ROOT).as_posix()
    for i, line in enumerate(lines, start + 1):
        match = FENCE.match(line)
        if match and not fenced:
            found.append(Block(page, i, match[1]))
        if match:
            fenced = not fenced
        elif fenced:
            found[-1].lines.append(line)
        else:
            _add(found, Block(page, i, _kind(line, found), [line]))
    return [block for block in found if any(line.strip() for line in block.lines)]


def _kind(line: str, found: list[Block]) -> str:
    """Return the kind of a line outside fences."""
    if line.startswith("|"):
        return "table"
    # Lines of a list are indented by two spaces, code by four.
    if line.startswith("    "):
        return ""
    if not line.strip() and found and found[-1].kind == "":
        return ""
    return "prose"


def _add(found: list[Block], block: Block) -> None:
    """Append a line to the last block if it continues it, else as a new block."""
    last = found[-1] if found else None
    continues = last is not None and last.kind == block.kind
    # An empty line ends a paragraph.
    if continues and last and block.kind == "prose" and not last.lines[-1].strip():
        continues = False
    if continues and last:
        last.lines += block.lines
    else:
        found.append(block)


def _is_mention(span: str) -> bool:
    """Return whether a sentence only names a command, without saying what to enter."""
    return span.startswith("race ") and span.count(" ") == 1 and span not in COMPLETE


def _is_entered(line: str) -> bool:
    """Return whether a line of a block is a command."""
    return is_command(REMARK.sub("", line.strip().removeprefix("$ ")))
