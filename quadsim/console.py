"""The output of commands: results go to stdout, progress and errors to stderr."""

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

from rich.console import (
    Console,
    ConsoleOptions,
    ConsoleRenderable,
    RenderableType,
    RenderHook,
    RenderResult,
)
from rich.markup import escape
from rich.table import Table

from quadsim.files.json_values import without_nan

# Control characters but tabs and new lines
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")
COLOUR = re.compile("\x1b[^m]*m")
COMPILING = "compiling the planner for this machine, once: some 15 s"


class UsageError(ValueError):
    """The error of an invalid command line: the flag, the expected and the given value."""


def prepare_process() -> None:
    """Prepare a command: open closed streams, shorten warnings to a line, and open no windows."""
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
    """Open streams that the shell has closed with `>&-`, or a file would get their number."""
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

    They are written as one string, so that a reader that closes the pipe causes a single
    BrokenPipeError, rather than an exit by rich.
    """
    sys.stdout.write(_printed(console_of(file=sys.stdout), parts))
    sys.stdout.flush()


def as_text(*parts: RenderableType, columns: int = 100) -> str:
    """Return the output of `emit` without colours, for a terminal of this width in columns."""
    console = console_of(file=StringIO(), width=columns, color_system=None)
    return _printed(console, parts).rstrip("\n")


def _printed(console: Console, parts: Iterable[RenderableType]) -> str:
    """Return the output of a console, without spaces at the ends of lines."""
    with console.capture() as captured:
        for part in parts:
            console.print(part, soft_wrap=isinstance(part, str))
    lines = captured.get().split("\n")[:-1]
    return "".join(line.rstrip() + "\n" for line in lines)


def console_of(**options: Any) -> Console:
    """Return a console that escapes the control characters of texts, which may come from files.

    The console's own colours are not affected.

    Args:
        options: options of rich's Console.
    """
    console = Console(highlight=False, **options)
    console.push_render_hook(_PlainTexts())
    return console


class _PlainTexts(RenderHook):
    """A hook that escapes the control characters of everything that a console prints."""

    def process_renderables(self, renderables: list[ConsoleRenderable]) -> list[ConsoleRenderable]:
        return [_PlainText(renderable) for renderable in renderables]


class _PlainText:
    """A printed object whose texts have escaped control characters."""

    def __init__(self, inner: ConsoleRenderable):
        self._inner = inner

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for part in console.render(self._inner, options):
            # Rich moves the cursor of a live line by parts that are no text.
            yield part if part.control else part._replace(text=plain(part.text))


def progress_console() -> Console:
    """Return a console on stderr for a progress line that is rewritten.

    It treats stderr as a terminal only if it is one, even if FORCE_COLOR asks for colours.
    """
    return console_of(stderr=True, force_terminal=sys.stderr.isatty())


def width() -> int:
    """Return the terminal's width in columns, else the number in COLUMNS, or 80."""
    return Console(file=sys.stdout).width


def plain_table(*heads: str, left: Collection[int] = (), no_wrap: bool = False) -> Table:
    """Return an empty table without lines, with a dimmed head.

    Args:
        heads: headings of the columns.
        left: indices of the columns with text; the other columns have numbers.
        no_wrap: whether each cell is kept on one line.
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
    """Return a text with escaped control characters, so that none of them reaches the terminal.

    Control characters may come from names and files.
    """
    return CONTROL.sub(_escaped, text)


def _escaped(found: re.Match[str]) -> str:
    return repr(found[0])[1:-1]


@contextmanager
def uninterrupted() -> Iterator[list[int]]:
    """Delay Ctrl-C and SIGTERM to the end of the context, which then raises KeyboardInterrupt.

    The context yields the list of delayed signals.
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
