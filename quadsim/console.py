"""Two streams: results on stdout, progress and errors on stderr; what they need; and the one look
of tables."""

from __future__ import annotations

import json
import os
import re
import signal
import sys
import warnings
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console, RenderableType
from rich.markup import escape
from rich.table import Table

from quadsim.files.json_values import without_nan

CONTROL = re.compile(r"(?!\x1b\[[\d;]*m)[\x00-\x08\x0b-\x1f\x7f-\x9f]")
COMPILING = "compiling the planner for this machine, once: some 20 s"


class UsageError(ValueError):
    """A command line that cannot be used. One line: the flag, what was expected, what was given."""


def prepare_process() -> None:
    """Streams that can be written to, warnings of one line, and no window."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # like Ctrl-C
    # `>&-` closes one: the next file to be opened would take its place, and the output
    for handle in range(3):
        try:
            os.fstat(handle)
        except OSError:
            os.dup2(os.open(os.devnull, os.O_RDWR), handle)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name) or open(os.devnull, "w")  # noqa: SIM115 (it lives to the end)
        stream.reconfigure(errors="replace")  # an ASCII terminal gets question marks
        setattr(sys, name, stream)
    # figures are files; matplotlib cannot be loaded with a backend it does not know
    os.environ["MPLBACKEND"] = "agg"
    warnings.showwarning = _show_warning


def _show_warning(message: Any, *_: object) -> None:
    """Its first line, without colours."""
    if sys.stderr:
        plain = re.sub("\x1b[^m]*m", "", str(message)).strip()
        sys.stderr.write(f"warning: {plain.splitlines()[0]}\n")


def emit(*parts: RenderableType) -> None:
    """Print results. As one string, so that a reader who leaves early is one BrokenPipeError, not
    rich's exit."""
    console = Console(file=sys.stdout, highlight=False)
    with console.capture() as captured:
        for part in parts:
            console.print(part, soft_wrap=isinstance(part, str))
    sys.stdout.write(
        "".join(line.rstrip() + "\n" for line in plain(captured.get()).split("\n")[:-1])
    )
    sys.stdout.flush()


def progress_console() -> Console:
    """stderr, for what moves: only in a terminal, though FORCE_COLOR may ask for colours in a file
    too."""
    return Console(stderr=True, highlight=False, force_terminal=sys.stderr.isatty())


def width() -> int:
    """Columns of the terminal; 80 where stdout is none, unless COLUMNS says otherwise."""
    return Console(file=sys.stdout).width


def plain_table(*heads: str, left: Collection[int] = (), no_wrap: bool = False) -> Table:
    """Without lines, the head dimmed; the columns `left` are of text, the others of numbers."""
    table = Table(box=None, header_style="dim", padding=(0, 2, 0, 0), pad_edge=False)
    for i, head in enumerate(heads):
        table.add_column(escape(head), justify="left" if i in left else "right", no_wrap=no_wrap)
    return table


def emit_json(value: object) -> None:
    sys.stdout.write(json.dumps(without_nan(value), indent=1, allow_nan=False) + "\n")
    sys.stdout.flush()


def complain(line: str) -> None:
    sys.stderr.write(plain(line) + "\n")
    sys.stderr.flush()


def plain(text: str) -> str:
    """Control characters of names and files escaped, so that none reaches the terminal; colours of
    rich stay."""
    return CONTROL.sub(lambda found: repr(found[0])[1:-1], text)


@contextmanager
def uninterrupted() -> Iterator[list[int]]:
    """Ctrl-C and SIGTERM wait until what is inside is done: then KeyboardInterrupt comes. Gives
    those that wait."""
    came: list[int] = []
    signals = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(s, lambda number, _: came.append(number)) for s in signals]
    try:
        yield came
    finally:
        for s, handler in zip(signals, before, strict=True):
            signal.signal(s, handler)
    if came:
        raise KeyboardInterrupt
