"""The two streams of a command, and the look of its tables.

Results go to stdout, progress and errors to stderr.
"""

from __future__ import annotations

import json
import os
import re
import signal
import sys
import warnings
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from io import StringIO
from typing import Any

from rich.console import Console, RenderableType
from rich.markup import escape
from rich.table import Table

from quadsim.files.json_values import without_nan

# Control characters, but not the colours of rich
CONTROL = re.compile(r"(?!\x1b\[[\d;]*m)[\x00-\x08\x0b-\x1f\x7f-\x9f]")
COLOUR = re.compile("\x1b[^m]*m")
COMPILING = "compiling the planner for this machine, once: some 15 s"


class UsageError(ValueError):
    """A command line that cannot be used. One line: the flag, what was expected, what was given."""


def prepare_process() -> None:
    """Make streams that can be written to, warnings of one line, and no window."""
    # SIGTERM, and a terminal that is closed, end a command like Ctrl-C
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    if signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:  # nohup ignores it
        signal.signal(signal.SIGHUP, signal.default_int_handler)
    _open_closed_streams()
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            # It lives to the end of the process
            stream = open(os.devnull, "w")  # noqa: SIM115
            setattr(sys, name, stream)
        # An ASCII terminal gets question marks
        stream.reconfigure(errors="replace")
    # Figures are files; matplotlib cannot be loaded with a backend it does not know
    os.environ["MPLBACKEND"] = "agg"
    warnings.showwarning = _show_warning


def _open_closed_streams() -> None:
    """Open what the shell has closed with `>&-`: the next file would take its number."""
    for handle in range(3):
        try:
            os.fstat(handle)
        except OSError:
            os.dup2(os.open(os.devnull, os.O_RDWR), handle)


def _show_warning(message: Any, *_: object) -> None:
    """Write the first line of a warning, without colours."""
    if sys.stderr:
        text = COLOUR.sub("", str(message)).strip()
        sys.stderr.write(f"warning: {text.splitlines()[0]}\n")


def emit(*parts: RenderableType) -> None:
    """Print results.

    They are written as one string, so that a reader who leaves early is one BrokenPipeError, not an
    exit by rich.
    """
    sys.stdout.write(_printed(Console(file=sys.stdout, highlight=False), parts))
    sys.stdout.flush()


def as_text(*parts: RenderableType, columns: int = 100) -> str:
    """Return what `emit` prints, without colours, for a terminal of so many columns."""
    console = Console(file=StringIO(), width=columns, color_system=None, highlight=False)
    return _printed(console, parts).rstrip("\n")


def _printed(console: Console, parts: Iterable[RenderableType]) -> str:
    """Return what a console prints, without spaces at the ends of lines."""
    with console.capture() as captured:
        for part in parts:
            console.print(part, soft_wrap=isinstance(part, str))
    lines = plain(captured.get()).split("\n")[:-1]
    return "".join(line.rstrip() + "\n" for line in lines)


def progress_console() -> Console:
    """Return stderr for a line that moves.

    It counts as a terminal only where it is one, though FORCE_COLOR may ask for colours in a file.
    """
    return Console(stderr=True, highlight=False, force_terminal=sys.stderr.isatty())


def width() -> int:
    """Return the columns of the terminal; 80 without one, unless COLUMNS names another number."""
    return Console(file=sys.stdout).width


def plain_table(*heads: str, left: Collection[int] = (), no_wrap: bool = False) -> Table:
    """Return an empty table without lines, with a dimmed head.

    Args:
        heads: headings of the columns.
        left: indices of the columns of text; the others are of numbers.
        no_wrap: keep each cell on one line.
    """
    table = Table(box=None, header_style="dim", padding=(0, 2, 0, 0), pad_edge=False)
    for i, head in enumerate(heads):
        justify = "left" if i in left else "right"
        table.add_column(escape(head), justify=justify, no_wrap=no_wrap)
    return table


def emit_json(value: object) -> None:
    """Print a result as JSON, null for nan and infinity."""
    sys.stdout.write(json.dumps(without_nan(value), indent=1, allow_nan=False) + "\n")
    sys.stdout.flush()


def complain(line: str) -> None:
    """Write a line to stderr."""
    sys.stderr.write(plain(line) + "\n")
    sys.stderr.flush()


def plain(text: str) -> str:
    """Return a text whose control characters are escaped, so that none reaches the terminal.

    They may come from names and files. The colours of rich stay.
    """
    return CONTROL.sub(_escaped, text)


def _escaped(found: re.Match[str]) -> str:
    return repr(found[0])[1:-1]


@contextmanager
def uninterrupted() -> Iterator[list[int]]:
    """Let Ctrl-C and SIGTERM wait until what is inside is done; then raise KeyboardInterrupt.

    It gives the list of the signals that wait.
    """
    waiting: list[int] = []

    def note(number: int, _: object) -> None:
        waiting.append(number)

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield waiting
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if waiting:
        raise KeyboardInterrupt
