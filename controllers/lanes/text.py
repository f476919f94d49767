"""Write a traced graph as Python assignments for Numba, with variables named as in the source.

    gate_along = gate_nx * dx + gate_ny * dy + gate_nz * dz
    span = abs(after_along - before_along)

Every number is written in the lanes' precision, F(0.5): a bare literal would be float64 and cost a
third of the speed. Choices become calls of `select`, `lower` and `higher` (see HELPERS) on computed
operands, so that a lane loop has no branch and LLVM vectorises it.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable, Sequence
from typing import Any

from quadsim.controllers.lanes.trace import Symbol, Value

# Names that the lines use; the header of a generated module defines them.
HELPERS = frozenset({"select", "lower", "higher", "abs", "math", "np", "F", "L"})

BINARY = {
    "add": "+",
    "sub": "-",
    "mul": "*",
    "div": "/",
    "lt": "<",
    "le": "<=",
    "gt": ">",
    "ge": ">=",
    "eq": "==",
    "ne": "!=",
    "and": "&",
    "or": "|",
}
CALLS = {
    "abs": "abs",
    "min": "lower",
    "max": "higher",
    "where": "select",
    "sqrt": "math.sqrt",
    "exp": "math.exp",
    "log": "math.log",
    "sin": "math.sin",
    "cos": "math.cos",
    "tan": "math.tan",
    "asin": "math.asin",
    "acos": "math.acos",
    "atan": "math.atan",
    "atan2": "math.atan2",
    "sinh": "math.sinh",
    "cosh": "math.cosh",
    "tanh": "math.tanh",
    "floor": "np.floor",  # math.floor returns a whole number of 64 bits
}
UNARY = {"neg": "-", "not": "not "}
# Precedence of Python's operators: comparisons bind less tightly than | and &.
COMPARISON = 1
BINDING = {
    "not": 0,
    **dict.fromkeys(("lt", "le", "gt", "ge", "eq", "ne"), COMPARISON),
    "or": 3,
    "and": 4,
    **dict.fromkeys(("add", "sub"), 5),
    **dict.fromkeys(("mul", "div"), 6),
    "neg": 7,
}
TIGHTEST = 99  # precedence of a call, a name or a number
LEAVES = ("input", "variable")


class Writer:
    """Writes assignments for the nodes that some results need.

    Each node is written once, in the order of recording.

    Args:
        around: the surrounding text, whose names are not used for new variables.
    """

    def __init__(self, around: str = ""):
        self._taken = {*re.findall(r"\w+", around), *HELPERS, *keyword.kwlist}
        # Number of a node -> its variable
        self._names: dict[int, str] = {}
        # Number of a node -> number of operations with this operand
        self._uses: dict[int, int] = {}
        # Variables of the surrounding text that the lines use
        self.read: set[str] = set()
        # Number of arithmetic operations of the lines
        self.operations = 0

    def lines(self, results: Iterable[Any]) -> str:
        """Return the assignments for some results, without those that were written before.

        Args:
            results: symbols, or plain numbers, which need no line.
        """
        symbols = [result for result in results if isinstance(result, Symbol)]
        needed = self._needed(symbols)
        self.operations += sum(node.kind not in LEAVES for node in needed)
        self._count_uses(needed, symbols)
        self._taken |= {node.name for node in needed if node.kind == "variable"}
        lines: list[str] = []
        section = ""
        for node in needed:
            if node.kind == "variable":
                self._names[node.number] = node.name
                self.read.add(node.name)
                continue
            if node.kind != "input" and not self._is_variable(node):
                continue
            if node.section != section:
                section = node.section
                lines.append(f"# {section}")
            expression = node.args[0] if node.kind == "input" else self._operation(node)
            self._names[node.number] = self._free_name(node.name or node.hint or "value")
            lines.append(f"{self._names[node.number]} = {expression}")
        return "\n".join(lines)

    def __call__(self, value: Value) -> str:
        """Return the expression of a number, or of a symbol whose lines have been written."""
        if isinstance(value, bool):
            return str(value)
        if not isinstance(value, Symbol):
            return f"F({float(value)!r})"
        if value.number in self._names:
            return self._names[value.number]
        return self._operation(value)

    def _needed(self, results: Sequence[Symbol]) -> list[Symbol]:
        """Return the nodes on which results depend and that have no variable yet, in order."""
        found: dict[int, Symbol] = {}
        todo = list(results)
        while todo:
            node = todo.pop()
            if node.number in found or node.number in self._names:
                continue
            found[node.number] = node
            if node.kind not in LEAVES:
                todo += [arg for arg in node.args if isinstance(arg, Symbol)]
        return [found[number] for number in sorted(found)]

    def _count_uses(self, needed: Sequence[Symbol], results: Sequence[Symbol]) -> None:
        """Count the operations in which each node is an operand."""
        for node in needed:
            if node.kind in LEAVES:
                continue
            for arg in node.args:
                if isinstance(arg, Symbol):
                    self._uses[arg.number] = self._uses.get(arg.number, 0) + 1

        # A result is read by other lines, so it is a variable and not part of an expression.
        for result in results:
            self._uses[result.number] = self._uses.get(result.number, 0) + 2

    def _is_variable(self, node: Symbol) -> bool:
        """Return whether a node gets a variable; otherwise it is part of an expression.

        A node gets a variable if it has a name in the source, or several uses.
        """
        return bool(node.name) or self._uses.get(node.number, 0) > 1

    def _operation(self, node: Symbol) -> str:
        """Return the expression of an operation."""
        if node.kind in BINARY:
            binding = BINDING[node.kind]
            # Python reads a < b < c as a chain.
            is_comparison = binding == COMPARISON
            left = self._within(node.args[0], binding + 1 if is_comparison else binding)
            right = self._within(node.args[1], binding + 1)
            return f"{left} {BINARY[node.kind]} {right}"
        if node.kind in UNARY:
            return f"{UNARY[node.kind]}{self._within(node.args[0], BINDING[node.kind])}"
        return f"{CALLS[node.kind]}({', '.join(map(self, node.args))})"

    def _within(self, value: Value, binding: int) -> str:
        """Return an operand, in parentheses if its precedence is below `binding`.

        The order of operations is thus the same as in the source.
        """
        text = self(value)
        if not isinstance(value, Symbol) or value.number in self._names:
            return text
        binds_less = BINDING.get(value.kind, TIGHTEST) < binding
        return f"({text})" if binds_less else text

    def _free_name(self, wished: str) -> str:
        """Return the desired name, with a number appended if it is taken."""
        name = wished
        number = 1
        while name in self._taken:
            number += 1
            name = f"{wished}_{number}"
        self._taken.add(name)
        return name
