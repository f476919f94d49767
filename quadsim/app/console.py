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
            console.print(part)
    sys.stdout.write(captured.get())
    sys.stdout.flush()


def emit_json(value: object) -> None:
    sys.stdout.write(json.dumps(value, indent=1, allow_nan=False) + "\n")
    sys.stdout.flush()


def complain(line: str) -> None:
    sys.stderr.write(line + "\n")
    sys.stderr.flush()
