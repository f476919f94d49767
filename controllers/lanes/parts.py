"""Common parts of the generated text of rollouts and learning environments."""

from __future__ import annotations

from collections.abc import Callable
from textwrap import indent
from typing import Any, NamedTuple

import numpy as np

from quadsim.controllers.costs import NumberTuple
from quadsim.controllers.lanes import FAST
from quadsim.controllers.lanes.layout import LANES
from quadsim.controllers.lanes.text import Writer
from quadsim.controllers.lanes.trace import Graph, trace
from quadsim.dynamics.named_tuples import flat, flat_names

HEADER = """
import math
import numpy as np
from numba import njit
from quadsim.controllers.lanes.compiled import INNER, inner, kept
from quadsim.controllers.lanes.sharing import share

F = np.{dtype}
FAST = set({fast})
L = {lanes}  # samples, or vehicles, that stand side by side in a block
inline = njit(**INNER, forceinline=True)

@inline
def select(condition, a, b):
    return a if condition else b

@inline
def lower(a, b):
    return a if a < b else b

@inline
def higher(a, b):
    return a if a > b else b
"""


class Point(NamedTuple):
    """A position in the world [m]."""

    x: float
    y: float
    z: float


def header(dtype: type) -> str:
    """Return the beginning of a generated module whose numbers have a NumPy type."""
    return HEADER.format(dtype=np.dtype(dtype).name, lanes=LANES, fast=sorted(FAST))


def fill(template: str, **parts: str | int) -> str:
    """Return the template with its places filled.

    Args:
        template: text with places `<name>`. A place alone on its line takes a part of several
            lines, each indented like the place; an empty part leaves no line.
        parts: the texts by the names of their places.
    """
    lines = []
    for line in template.strip("\n").split("\n"):
        name = line.strip()
        is_place = name.startswith("<") and name.endswith(">") and name[1:-1] in parts
        if is_place:
            part = str(parts[name[1:-1]]).strip("\n")
            if part:
                indentation = line[: -len(line.lstrip())]
                lines.append(indent(part, indentation))
            continue
        for place, part in parts.items():
            line = line.replace(f"<{place}>", str(part))
        lines.append(line)
    return "\n".join(lines) + "\n"


def read(kind: type, name: str, where: str, writer: Writer) -> str:
    """Return lines that read the used numbers of a record, such as `p_x = numbers[2]`.

    Args:
        kind: the NamedTuple.
        name: prefix of the variables, as in `Graph.record`.
        where: the expression that is read, with {k} for the number of the field.
        writer: the writer of the lines that use the numbers.
    """
    names = [f"{name}_{field}" for field in flat_names(kind)]
    lines = [f"{each} = {where.format(k=k)}" for k, each in enumerate(names) if each in writer.read]
    return "\n".join(lines)


def store(values: Any, where: str, writer: Writer) -> str:
    """Return lines that store each number of a record, such as `state[0, l] = px`.

    Args:
        values: the record, of symbols.
        where: the target of the assignment, with {k} for the number of the field.
        writer: the writer of the lines that compute the numbers.
    """
    lines = [f"{where.format(k=k)} = {writer(value)}" for k, value in enumerate(flat(values))]
    return "\n".join(lines)


# Rare: a sample that has reached its target goes on to the next row. `reached` is a lane array.
NEXT_TARGETS = """
any_reached = np.int32(0)
for l in range(L):
    any_reached |= reached[l]
if any_reached > 0:
    for l in range(L):
        if reached[l] > 0 and row[l] < last_row:
            row[l] += 1
            <count>
            for k in range(<numbers>):
                target[k, l] = targets[row[l], k]
"""


def next_targets(numbers: int | str, count: str = "") -> str:
    """Return the loop that moves samples to their next target row.

    Args:
        numbers: length of a target row.
        count: a line that counts the targets reached; empty: they are not counted.
    """
    return fill(NEXT_TARGETS, numbers=numbers, count=count)


class LineTest(NamedTuple):
    """The test of a straight line from p0 to p1 against the obstacle o, as text."""

    read_obstacle: str  # lines that read the obstacle's numbers, the same for all lanes
    lines: str  # lines of the test
    touches: str  # the condition that the lines compute


def line_test(touches: Callable, row: type[NumberTuple], p0: str, p1: str, around: str) -> LineTest:
    """Return the text of an obstacle test.

    Args:
        touches: function of (p0, p1, row) that returns whether the line touches the row's obstacle.
        row: the NamedTuple of an obstacle's numbers, its box first: x_low, y_low, z_low, x_high,
            y_high, z_high.
        p0, p1: expressions of the coordinates of the line's ends, with {k} for the axis.
        around: the text that surrounds the test.
    """
    graph = Graph()
    start = graph.record(Point, "p0", p0)
    end = graph.record(Point, "p1", p1)
    obstacle = graph.record(row, "obstacle")
    hit = trace(touches, start, end, obstacle)
    writer = Writer(around)
    lines = writer.lines([hit])
    # The obstacle's box is tested before these lines, so its numbers are read too.
    writer.read |= {f"obstacle_{side}" for side in row._fields[:6]}
    return LineTest(
        read_obstacle=read(row, "obstacle", "obstacles[o, {k}]", writer),
        lines=lines,
        touches=writer(hit),
    )
