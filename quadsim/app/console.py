"""Two streams: results on stdout, progress and errors on stderr."""

from __future__ import annotations

import json
import sys

from rich.console import Console, RenderableType


def emit(*parts: RenderableType) -> None:
    """Print results. As one string, so that a reader who leaves early is one BrokenPipeError, not rich's exit."""
    console = Console(file=sys.stdout, highlight=False)
    with console.capture() as captured:
        for part in parts:
            console.print(part, soft_wrap=isinstance(part, str))
    sys.stdout.write("".join(line.rstrip() + "\n" for line in captured.get().splitlines()))
    sys.stdout.flush()


def width() -> int:
    """Columns of the terminal; 80 where stdout is none, unless COLUMNS says otherwise."""
    return Console(file=sys.stdout).width


def emit_json(value: object) -> None:
    sys.stdout.write(json.dumps(value, indent=1, allow_nan=False) + "\n")
    sys.stdout.flush()


def complain(line: str) -> None:
    sys.stderr.write(line + "\n")
    sys.stderr.flush()
