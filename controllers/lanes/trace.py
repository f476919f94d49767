"""Record the arithmetic of a plain function by calling it once with symbols instead of numbers.

Steps, cost terms, rewards and observations are plain Python functions over named scalars (see
`quadsim.dynamics`). Called with a `Symbol` for each scalar, such a function builds an expression
graph: every operator and every NumPy function that it applies adds a node.
`quadsim.controllers.lanes.text` writes the graph as the body of a compiled loop.

    graph = Graph()
    x = graph.record(State, "x")             # State(px=x_px, py=x_py, ...)
    x_next = trace(step, x, u, p, dt)        # a State of symbols

Because the function itself is called, records (NamedTuples), properties, helper functions, loops of
fixed length and numbers held by closures need no translation. A branch on a symbol cannot be
recorded, because the symbol has no value yet: it raises a `TraceError` with the function, the line
and an alternative.

Equal operations on equal operands are one node, so that terms may compute the same quantity, a
gate's frame for example, without computing it twice.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import isfinite
from types import FrameType
from typing import Any

import numpy as np

from quadsim.dynamics.named_tuples import flat_names, is_record, unflat

# The operations that NumPy's functions record.
UFUNCS = {
    np.add: "add",
    np.subtract: "sub",
    np.multiply: "mul",
    np.true_divide: "div",
    np.negative: "neg",
    np.absolute: "abs",
    np.fabs: "abs",
    np.minimum: "min",
    np.fmin: "min",
    np.maximum: "max",
    np.fmax: "max",
    np.sqrt: "sqrt",
    np.exp: "exp",
    np.log: "log",
    np.sin: "sin",
    np.cos: "cos",
    np.tan: "tan",
    np.arcsin: "asin",
    np.arccos: "acos",
    np.arctan: "atan",
    np.arctan2: "atan2",
    np.sinh: "sinh",
    np.cosh: "cosh",
    np.tanh: "tanh",
    np.floor: "floor",
    np.less: "lt",
    np.less_equal: "le",
    np.greater: "gt",
    np.greater_equal: "ge",
    np.equal: "eq",
    np.not_equal: "ne",
    np.logical_and: "and",
    np.bitwise_and: "and",
    np.logical_or: "or",
    np.bitwise_or: "or",
    np.logical_not: "not",
    np.invert: "not",
}
KNOWN = (
    "arithmetic, comparisons joined by & and |, abs, and NumPy's where, minimum, maximum, clip, "
    "sign, floor, ceil, mod, square, power, sqrt, hypot, exp, log, sin, cos, tan, arcsin, arccos, "
    "arctan, arctan2, sinh, cosh, tanh, radians, degrees"
)
CONDITIONS = ("lt", "le", "gt", "ge", "eq", "ne", "and", "or", "not")  # what they return
LARGEST_POWER = 4  # x**n with a whole n up to this is written as products


class TraceError(TypeError):
    """The error of a function that cannot be compiled for the rollouts.

    The message names the function and the line, and suggests an alternative.
    """


class Symbol:
    """A scalar without a value yet: an input of a graph, or an operation on operands.

    Args:
        graph: the graph of this node.
        kind: an operation, "input" or "variable".
        args: operands, Symbols and numbers; for an input the expression from which it is read.
        number: number of earlier nodes, which orders the graph topologically.
    """

    __slots__ = ("args", "graph", "hint", "kind", "name", "number", "section")

    def __init__(self, graph: Graph, kind: str, args: tuple[Any, ...], number: int):
        self.graph = graph
        self.kind = kind
        self.args = args
        self.number = number
        # Name of the first variable in the source that held this symbol
        self.name = ""
        # Name of the function that returned this symbol, used if no variable held it
        self.hint = ""
        # Section of the generated text
        self.section = graph.section

    def __repr__(self) -> str:
        return f"Symbol({self.name or self.kind})"

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Symbol:
        if method == "__call__" and not options:
            if ufunc in UFUNCS:
                return self.graph.apply(UFUNCS[ufunc], *inputs)
            if ufunc in COMPOSED:
                return COMPOSED[ufunc](*inputs)
        raise trace_error(f"numpy.{ufunc.__name__} is not known; known are {KNOWN}")

    def __array_function__(
        self, function: Callable, types: Any, args: tuple[Any, ...], options: dict[str, Any]
    ) -> Symbol:
        if function is np.where and len(args) == 3 and not options:
            return self.graph.apply("where", *args)
        if function is np.clip:
            return self._clipped(*args[1:], **options)
        raise trace_error(f"numpy.{function.__name__} is not known; known are {KNOWN}")

    def _clipped(self, *limits: Any, **options: Any) -> Symbol:
        """Return the symbol of np.clip(self, low, high); the limits may be keywords."""
        names = {"a_min": "min", "a_max": "max"}
        given = dict(zip(("min", "max"), limits, strict=False))
        given |= {names.get(name, name): limit for name, limit in options.items()}
        if len(limits) > 2 or not given.keys() <= {"min", "max"}:
            raise trace_error("numpy.clip is known as numpy.clip(a, low, high) alone")
        found = self
        if given.get("min") is not None:
            found = self.graph.apply("max", found, given["min"])
        if given.get("max") is not None:
            found = self.graph.apply("min", found, given["max"])
        return found

    def __add__(self, other: Any) -> Symbol:
        return self.graph.apply("add", self, other)

    def __radd__(self, other: Any) -> Symbol:
        return self.graph.apply("add", other, self)

    def __sub__(self, other: Any) -> Symbol:
        return self.graph.apply("sub", self, other)

    def __rsub__(self, other: Any) -> Symbol:
        return self.graph.apply("sub", other, self)

    def __mul__(self, other: Any) -> Symbol:
        return self.graph.apply("mul", self, other)

    def __rmul__(self, other: Any) -> Symbol:
        return self.graph.apply("mul", other, self)

    def __truediv__(self, other: Any) -> Symbol:
        return self.graph.apply("div", self, other)

    def __rtruediv__(self, other: Any) -> Symbol:
        return self.graph.apply("div", other, self)

    def __mod__(self, other: Any) -> Symbol:
        return _remainder(self, other)

    def __rmod__(self, other: Any) -> Symbol:
        return _remainder(other, self)

    def __pow__(self, exponent: Any) -> Symbol:
        is_number = isinstance(exponent, int | float | np.number)
        if not is_number or exponent not in range(1, LARGEST_POWER + 1):
            raise trace_error(
                f"x**{exponent!r} is not known, whole numbers from 1 to {LARGEST_POWER} are: write "
                "products, sqrt or exp(y * log(x))"
            )
        product = self
        for _ in range(int(exponent) - 1):
            product = product * self
        return product

    def __neg__(self) -> Symbol:
        return self.graph.apply("neg", self)

    def __pos__(self) -> Symbol:
        return self

    def __abs__(self) -> Symbol:
        return self.graph.apply("abs", self)

    def __invert__(self) -> Symbol:
        return self.graph.apply("not", self)

    def __and__(self, other: Any) -> Symbol:
        return self.graph.apply("and", self, other)

    def __rand__(self, other: Any) -> Symbol:
        return self.graph.apply("and", other, self)

    def __or__(self, other: Any) -> Symbol:
        return self.graph.apply("or", self, other)

    def __ror__(self, other: Any) -> Symbol:
        return self.graph.apply("or", other, self)

    def __lt__(self, other: Any) -> Symbol:
        return self.graph.apply("lt", self, other)

    def __le__(self, other: Any) -> Symbol:
        return self.graph.apply("le", self, other)

    def __gt__(self, other: Any) -> Symbol:
        return self.graph.apply("gt", self, other)

    def __ge__(self, other: Any) -> Symbol:
        return self.graph.apply("ge", self, other)

    def __eq__(self, other: object) -> Any:
        return self.graph.apply("eq", self, other)

    def __ne__(self, other: object) -> Any:
        return self.graph.apply("ne", self, other)

    __hash__ = object.__hash__

    def __bool__(self) -> bool:
        raise trace_error(
            "a condition is not known before the rollout, so if, and, or, not, min and max cannot "
            "be used: write numpy.where(condition, a, b), & or |, numpy.minimum or numpy.maximum"
        )

    def __float__(self) -> float:
        raise trace_error(
            "float() and functions of math or of another module need a number, and a scalar of the "
            f"rollout has no value yet: write NumPy's, such as numpy.sin; known are {KNOWN}"
        )

    __int__ = __index__ = __complex__ = __float__

    def __iter__(self) -> Iterator[Any]:
        raise trace_error("a scalar was taken for a sequence")


# A number or a condition in a traced function, known (float, bool) or not yet known (Symbol)
Value = Symbol | float | bool


def _remainder(a: Any, b: Any) -> Symbol:
    """Return a - b floor(a / b), the remainder with the sign of b."""
    return a - b * np.floor(a / b)


def _hypotenuse(a: Any, b: Any) -> Symbol:
    return np.sqrt(a * a + b * b)


def _sign(a: Symbol) -> Symbol:
    below = a.graph.apply("where", a < 0.0, -1.0, 0.0)
    return a.graph.apply("where", a > 0.0, 1.0, below)


def _ceiling(a: Symbol) -> Symbol:
    return -np.floor(-a)


def _square(a: Symbol) -> Symbol:
    return a * a


def _power(a: Any, exponent: Any) -> Symbol:
    if isinstance(a, Symbol):
        return a**exponent
    raise trace_error(f"{a!r}**x is not known: write exp(x * log(y))")


def _radians(a: Symbol) -> Symbol:
    return a * (np.pi / 180.0)


def _degrees(a: Symbol) -> Symbol:
    return a * (180.0 / np.pi)


# NumPy's functions that are composed of the operations above
COMPOSED: dict[np.ufunc, Callable[..., Symbol]] = {
    np.hypot: _hypotenuse,
    np.sign: _sign,
    np.ceil: _ceiling,
    np.remainder: _remainder,
    np.square: _square,
    np.power: _power,
    np.radians: _radians,
    np.deg2rad: _radians,
    np.degrees: _degrees,
    np.rad2deg: _degrees,
}


class Graph:
    """The recorded operations of traced functions, in order."""

    def __init__(self) -> None:
        self.nodes: list[Symbol] = []
        self.section = ""  # the part of the generated text that new nodes belong to
        self._known: dict[tuple, Symbol] = {}

    def variable(self, name: str) -> Symbol:
        """Return a symbol for a variable that the surrounding text assigns."""
        return self._new("variable", (), name)

    def input(self, name: str, expression: str) -> Symbol:
        """Return a symbol that is read from `expression` at its first use."""
        return self._new("input", (expression,), name)

    def record(self, kind: type, name: str, expression: str = "") -> Any:
        """Return a record of symbols, one for each field of the NamedTuple `kind`.

        Args:
            kind: the NamedTuple, whose fields may be records too.
            name: prefix of the variables: field `px` of the record `x` is the variable `x_px`.
            expression: expression from which each symbol is read, with `{k}` for the number of the
                field, counted through nested records; "": the symbols are variables that the
                surrounding text assigns.
        """
        names = [f"{name}_{field}" for field in flat_names(kind)]
        if expression:
            symbols = [self.input(each, expression.format(k=k)) for k, each in enumerate(names)]
        else:
            symbols = [self.variable(each) for each in names]
        return unflat(kind, iter(symbols))

    def apply(self, kind: str, *args: Any) -> Symbol:
        """Return the node of an operation on operands, which is made if it does not exist."""
        operands = tuple(operand(arg) for arg in args)
        if kind in ("and", "or", "not") and not all(map(is_condition, operands)):
            raise trace_error(
                "&, | and ~ join conditions, and one side is a number: write (a > 0) & (b < 1), in "
                "parentheses, or a * b for a product"
            )
        key = (kind, *(_key(each) for each in operands))
        if key not in self._known:
            self._known[key] = self._new(kind, operands)
        return self._known[key]

    def _new(self, kind: str, args: tuple[Any, ...], name: str = "") -> Symbol:
        """Return a new node."""
        symbol = Symbol(self, kind, args, len(self.nodes))
        symbol.name = name
        self.nodes.append(symbol)
        return symbol


def is_condition(value: Value) -> bool:
    """Return whether a value is a condition rather than a number."""
    if not isinstance(value, Symbol):
        return isinstance(value, bool)
    if value.kind == "where":
        return all(map(is_condition, value.args[1:]))
    return value.kind in CONDITIONS


def _key(value: Value) -> tuple:
    """Return a key that is equal for equal operands."""
    if isinstance(value, Symbol):
        return "symbol", value.number
    return type(value), repr(value)  # 0.0 and -0.0 are equal, but not the same


def operand(value: Any) -> Value:
    """Return a value as a Symbol, a bool or a finite float.

    Raises:
        TraceError: the value cannot be converted.
    """
    if isinstance(value, Symbol):
        return value
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        value = value.item()
    if isinstance(value, bool):
        return value
    if isinstance(value, int | float) and isfinite(value):
        return float(value)
    if isinstance(value, float):
        raise trace_error(
            f"{value} is not finite, and compiled code takes every number to be finite: write 1e30"
        )
    raise trace_error(
        f"expected a number or a scalar of the rollout, got {type(value).__name__} {value!r:.60}"
    )


def trace(function: Callable, *args: Any) -> Any:
    """Call a function with symbols and return its result.

    Intermediate results are named as in its source.

    Raises:
        TraceError: the function cannot be recorded, or fails.
    """
    try:
        with naming():
            return function(*args)
    except TraceError as error:
        raise TraceError(f"{label(function)}: {error}") from None
    except Exception as error:
        raise TraceError(f"{label(function)}: {_place()}{type(error).__name__}: {error}") from error


def trace_number(function: Callable, *args: Any) -> Value:
    """Call a function with symbols and return its result, a number or a condition.

    Raises:
        TraceError: the function cannot be recorded, fails, or returns another value.
    """
    return check_number(function, trace(function, *args))


def check_number(function: Callable, value: Any) -> Value:
    """Return the result of a traced function, a number or a condition.

    Raises:
        TraceError: the result is neither a number nor a condition.
    """
    if isinstance(value, tuple | list):
        raise wrong_result(function, "one number", value)
    try:
        return operand(value)
    except TraceError:
        raise wrong_result(function, "a number", value) from None


def wrong_result(function: Callable, expected: str, value: Any) -> TraceError:
    """Return the error of a function with an unexpected result."""
    code = getattr(function, "__code__", None)
    place = f"{code.co_filename}:{code.co_firstlineno}: " if code else ""
    found = f"{type(value).__name__} {value!r:.60}"
    if value is None:
        found = "None: is a return missing?"
    return TraceError(f"{label(function)}: {place}expected it to return {expected}, got {found}")


@contextmanager
def naming() -> Iterator[None]:
    """Name symbols after the local variables of the functions that run in this context."""
    before = sys.getprofile()

    def name_locals(frame: FrameType, event: str, value: Any) -> None:
        # At a call, name what the caller has computed after the caller's variables, before the
        # arguments of the called function can name it.
        named = frame.f_back if event == "call" else frame
        if event not in ("call", "return") or named is None or not _is_traced(named):
            return
        for name, local in named.f_locals.items():
            _name(name, local)
        function_name = frame.f_code.co_name
        # "<lambda>" cannot be the name of a variable.
        if event == "return" and function_name.isidentifier():
            _name(function_name, value, weakly=True)

    sys.setprofile(name_locals)
    try:
        yield
    finally:
        sys.setprofile(before)


def _is_traced(frame: FrameType) -> bool:
    """Return whether a frame belongs to a traced function rather than to this module or NumPy."""
    module = frame.f_globals.get("__name__", "")
    return frame.f_code.co_filename != __file__ and not module.startswith(
        ("numpy", "contextlib", "collections")
    )


def _name(name: str, value: Any, weakly: bool = False) -> None:
    """Name a symbol, or the symbols of a record, unless they have the name of a variable.

    Args:
        name: the name.
        value: a symbol, a record or a tuple; other values are ignored.
        weakly: whether a later name may replace this one.
    """
    if isinstance(value, Symbol):
        if weakly:
            value.hint = value.hint or name
        else:
            value.name = value.name or name
    elif is_record(type(value)):
        for field, inner in zip(value._fields, value, strict=True):
            _name(f"{name}_{field}", inner, weakly)
    elif isinstance(value, tuple):
        axes = "xyz" if len(value) == 3 else range(len(value))
        for axis, inner in zip(axes, value, strict=True):
            _name(f"{name}_{axis}", inner, weakly=True)


def label(function: Callable) -> str:
    """Return the module and name of a function, for errors."""
    name = getattr(function, "__qualname__", None) or type(function).__name__
    return f"{getattr(function, '__module__', '')}.{name}"


def trace_error(problem: str) -> TraceError:
    """Return an error with a problem, and the file and line of the source that caused it."""
    frame = sys._getframe()
    while frame.f_back is not None and frame.f_code.co_filename == __file__:
        frame = frame.f_back
    return TraceError(f"{frame.f_code.co_filename}:{frame.f_lineno}: {problem}")


def _place() -> str:
    """Return the file and line where a traced function raised the exception being handled."""
    traceback = sys.exc_info()[2]
    place = ""
    while traceback is not None:
        code = traceback.tb_frame.f_code
        if code.co_filename != __file__:
            place = f"{code.co_filename}:{traceback.tb_lineno}: "
        traceback = traceback.tb_next
    return place
