"""Functions called once with symbols: the written lines compute what the functions compute, and
what cannot be traced is one line that says where and what to write instead."""

import linecache
import math
import operator
import re
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy
import numpy as np
import pytest
from numpy import arctan2, cos, exp, log, maximum, minimum, sin, sqrt, tan, tanh, where

from quadsim.controllers.lanes.text import Writer
from quadsim.controllers.lanes.trace import KNOWN, Graph, TraceError, trace, trace_number
from quadsim.dynamics.named_tuples import flat

HERE = "test_trace.py"
NUMPY = SimpleNamespace(
    sqrt=np.sqrt,
    exp=np.exp,
    log=np.log,
    sin=np.sin,
    cos=np.cos,
    tan=np.tan,
    asin=np.arcsin,
    acos=np.arccos,
    atan=np.arctan,
    atan2=np.arctan2,
    sinh=np.sinh,
    cosh=np.cosh,
    tanh=np.tanh,
)
MEANS = {  # the names of the generated module, in float64
    "F": np.float64,
    "np": np,
    "math": NUMPY,
    "select": lambda condition, a, b: a if condition else b,
    "lower": lambda a, b: a if a < b else b,
    "higher": lambda a, b: a if a > b else b,
}


def written(function, names, around=""):
    """Return the lines for a function of these variables, and the expressions of its results."""
    graph = Graph()
    writer = Writer(around)
    results = list(flat(trace(function, *(graph.variable(name) for name in names))))
    lines = writer.lines(results)
    return lines, [writer(result) for result in results]


def compiled(function, names):
    """Return the function that the written lines make, of the same arguments."""
    lines, results = written(function, names)
    body = [*lines.splitlines(), f"return ({', '.join(results)},)"]
    scope = dict(MEANS)
    exec(f"def run({', '.join(names)}):\n    " + "\n    ".join(body), scope)
    return scope["run"]


def runs_alike(function, rows, ulps=0):
    """Return whether the written lines give what the function gives, to the last bit or to some of
    its units."""
    names = [f"argument_{k}" for k in range(len(rows[0]))]
    run = compiled(function, names)
    pairs = [(run(*row), tuple(flat(function(*row)))) for row in rows]
    found, expected = np.array(pairs, float).swapaxes(0, 1)
    return bool((abs(found - expected) <= ulps * np.spacing(abs(expected))).all())


# Each keeps the numbers in a range where it is defined, so that no result overflows.
OPERATIONS = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": lambda a, b: tanh(a) * b,
    "div": lambda a, b: a / (abs(b) + 0.5),
    "number": lambda a, b: 0.3 - 2 * (a - b) / 7.5,
    "neg": lambda a, b: -a,
    "pos": lambda a, b: +b,
    "abs": lambda a, b: abs(a),
    "power": lambda a, b: tanh(a) ** 2 - sin(b) ** 2,
    "min": minimum,
    "max": maximum,
    "sqrt": lambda a, b: sqrt(abs(a)),
    "exp": lambda a, b: exp(minimum(a, 2.0)),
    "log": lambda a, b: log(abs(a) + 0.1),
    "sin": lambda a, b: sin(a),
    "cos": lambda a, b: cos(b),
    "tan": lambda a, b: tan(tanh(a)),
    "tanh": lambda a, b: tanh(a),
    "arctan2": arctan2,
    "where": lambda a, b: where(a < b, a, -b),
    "less or equal": lambda a, b: where((a <= b) & (a >= -1.0), b, 2.0),
    "greater": lambda a, b: where((a > b) | (b < 0.2), 1.0, a),
    "not": lambda a, b: where(~((a > 0.0) & (b > 0.0)), a, 0.5),
    "equal": lambda a, b: where((a == b) | ((a > 0) != (b > 0)), a + b, b),
    "logical": lambda a, b: where(
        np.logical_not(np.logical_or(a > 1.0, np.logical_and(a > 0.0, b > 0.0))), a, b
    ),
}


# NumPy's functions of one or two numbers, in ranges where they are defined.
FUNCTIONS = {
    np.sqrt: lambda a, b: np.sqrt(abs(a)),
    np.exp: lambda a, b: np.exp(a),
    np.log: lambda a, b: np.log(abs(a) + 0.1),
    np.sin: lambda a, b: np.sin(a),
    np.cos: lambda a, b: np.cos(a),
    np.tan: lambda a, b: np.tan(np.tanh(a)),
    np.arcsin: lambda a, b: np.arcsin(0.99 * np.tanh(a)),
    np.arccos: lambda a, b: np.arccos(0.99 * np.tanh(a)),
    np.arctan: lambda a, b: np.arctan(a),
    np.arctan2: lambda a, b: np.arctan2(a, b),
    np.sinh: lambda a, b: np.sinh(a),
    np.cosh: lambda a, b: np.cosh(a),
    np.tanh: lambda a, b: np.tanh(a),
    np.hypot: lambda a, b: np.hypot(a, b),
    np.sign: lambda a, b: np.sign(a) + np.sign(a * 0.0),
    np.floor: lambda a, b: np.floor(a),
    np.ceil: lambda a, b: np.ceil(a),
    np.mod: lambda a, b: np.mod(a, 0.75),
    np.square: lambda a, b: np.square(a),
    np.power: lambda a, b: np.power(a, 3),
    np.clip: lambda a, b: np.clip(a, -0.5, b),
    np.fmin: lambda a, b: np.fmin(a, b),
    np.fmax: lambda a, b: np.fmax(a, b),
    np.minimum: lambda a, b: np.minimum(a, b),
    np.maximum: lambda a, b: np.maximum(a, b),
    np.radians: lambda a, b: np.radians(a),
    np.degrees: lambda a, b: np.degrees(a),
    np.where: lambda a, b: np.where((a > b) & ~(b < 0.0), a, b),
    abs: lambda a, b: abs(a),
    divmod: lambda a, b: a % 2.5 + 7.0 % (abs(b) + 1.0),
}


@pytest.mark.compiled
def test_compiled_functions_are_numpys_within_the_rounding_of_float32():
    from quadsim.controllers.lanes.compiled import load_module
    from quadsim.controllers.lanes.layout import LANES
    from quadsim.controllers.lanes.parts import header

    graph = Graph()
    writer = Writer()
    a, b = (graph.input(name, f"given[{k}, l]") for k, name in enumerate("ab"))
    results = [trace_number(function, a, b) for function in FUNCTIONS.values()]
    lines = writer.lines(results).splitlines()
    lines += [f"found[{k}, l] = {writer(result)}" for k, result in enumerate(results)]
    source = [
        header(np.float32),
        "@njit(fastmath=FAST, error_model='numpy')",
        "def run(given, found):",
        "    for l in range(L):",
        *(f"        {line}" for line in lines),
    ]
    module = load_module("functions_of_numpy", "\n".join(source))
    given = np.random.default_rng(3).uniform(-3.0, 3.0, (2, LANES)).astype(np.float32)
    found = np.empty((len(FUNCTIONS), LANES), np.float32)
    module.run(given, found)
    for function, row in zip(FUNCTIONS, found, strict=True):
        expected = FUNCTIONS[function](*given.astype(float))
        np.testing.assert_allclose(row, expected, rtol=3e-6, atol=3e-6, err_msg=str(function))


def test_the_docs_name_every_function_that_can_be_traced():
    page = (Path(__file__).parents[2] / "docs/concepts.md").read_text()
    named = {f.__name__ for f in FUNCTIONS if f not in (abs, divmod, np.fmin, np.fmax)}
    names = {"remainder": "mod"}
    for name in {names.get(name, name) for name in named}:
        assert re.search(rf"\b{name}\b", KNOWN), name
        assert f"`{name}`" in page, name


def random_function(seed):
    """Return a function of three numbers: some thirty operations, each on numbers that were
    computed before."""
    rng = np.random.default_rng(seed)
    program = [
        (str(rng.choice(list(OPERATIONS))), *rng.integers(0, k + 3, 2).tolist()) for k in range(30)
    ]

    def function(a, b, c):
        values = [a, b, c]
        for name, i, k in program:
            values.append(OPERATIONS[name](values[i], values[k]))
        return tuple(values[-5:])

    return function


def random_rows(seed, n=40):
    return list(np.random.default_rng(seed).normal(0.0, 1.5, (n, 3)))


@pytest.mark.parametrize("seed", range(30))
def test_the_written_lines_compute_what_the_function_computes(seed):
    assert runs_alike(random_function(seed), random_rows(seed))


ORDERS = {  # text of an expression -> a function that is written so
    "a - (b - c)": lambda a, b, c: a - (b - c),
    "a - b - c": lambda a, b, c: a - b - c,
    "a + (b + c)": lambda a, b, c: a + (b + c),
    "a / (b * c)": lambda a, b, c: a / (b * c),
    "a / b * c": lambda a, b, c: a / b * c,
    "a * (b * c)": lambda a, b, c: a * (b * c),
    "(a + b) * c": lambda a, b, c: (a + b) * c,
    "-(a + b)": lambda a, b, c: -(a + b),
    "-a * b": lambda a, b, c: -a * b,
    "-(a * b)": lambda a, b, c: -(a * b),
    "F(1.0) - a": lambda a, b, c: 1 - a,
    "(a < b) & (b < c)": lambda a, b, c: (a < b) & (b < c),
    "a + b < b + c": lambda a, b, c: a + b < b + c,
    "(a < b) == (b < c)": lambda a, b, c: (a < b) == (b < c),
    "not (a < b) == (b < c)": lambda a, b, c: ~((a < b) == (b < c)),
    "(a < b) & ((b < c) | (c < a))": lambda a, b, c: (a < b) & ((b < c) | (c < a)),
    "(a < b) & (b < c) | (c < a)": lambda a, b, c: (a < b) & (b < c) | (c < a),
    "(not a < b) & (b < c)": lambda a, b, c: ~(a < b) & (b < c),
    "select(a < b, a, b - c)": lambda a, b, c: where(a < b, a, b - c),
    "higher(lower(a, b), F(0.5))": lambda a, b, c: maximum(minimum(a, b), 0.5),
    "abs(a) - abs(b - c)": lambda a, b, c: abs(a) - np.fabs(b - c),
    "a * a * a": lambda a, b, c: a**3,
}


@pytest.mark.parametrize("expected", ORDERS)
def test_the_order_of_operations_is_that_of_the_source(expected):
    """Also where Python would read a chain, as of two comparisons, in another way."""
    lines, (result,) = written(ORDERS[expected], "abc")
    assert (f"{lines}\n" if lines else "") + result in (expected, f"value = {expected}\nvalue")
    powers = "a * a * a" in expected  # NumPy's own power may round otherwise
    assert runs_alike(ORDERS[expected], random_rows(0), ulps=2 if powers else 0)


@pytest.mark.parametrize(
    "expected", ["a - (b - c)", "a + (b + c)", "a / (b * c)", "(a + b) * c", "-(a + b)"]
)
def test_lines_without_the_parentheses_would_be_found(expected, monkeypatch):
    """Also a sum of which the order of the terms changes the rounding alone."""
    monkeypatch.setattr(Writer, "_within", lambda writer, value, binding: writer(value))
    assert not runs_alike(ORDERS[expected], random_rows(0))


class Pair(NamedTuple):
    first: float
    second: float


class Pairs(NamedTuple):
    left: Pair
    right: Pair
    apart: float


def halved(a, b):
    middle = (a + b) / 2
    return Pairs(Pair(a, middle), Pair(middle, b), abs(a - b))


def test_equal_operations_on_equal_operands_are_computed_once():
    """In whatever function they stand, as two terms that ask for the same quantity."""

    def both(a, b, c):
        one = halved(a, b).left.second * c
        two = halved(a, b).right.first * c
        return one + two

    lines, results = written(both, "abc")
    assert (lines + results[0]).count("a + b") == 1
    assert (lines + results[0]).count("* c") == 1
    assert runs_alike(both, random_rows(1))


def test_operands_in_another_order_or_of_another_sign_are_other_operations():
    lines, results = written(lambda a, b: (a + b, b + a, a + 0.0, a + -0.0), "ab")
    assert lines.count("=") == 4
    assert len(set(results)) == 4


def test_what_no_result_needs_is_not_written():
    def wasteful(a, b):
        unused = sin(a) * 3.0
        assert unused is not None
        return b * 2.0

    lines, _ = written(wasteful, "ab")
    assert "sin" not in lines


def test_records_within_records_go_in_and_come_out():
    graph = Graph()
    pairs = graph.record(Pairs, "pairs", "numbers[{k}]")
    found = trace(
        lambda p: Pairs(p.right, Pair(p.left.first * 2.0, p.apart), 1.0 - p.left.second), pairs
    )
    assert isinstance(found, Pairs)
    assert isinstance(found.left, Pair)
    writer = Writer()
    lines = writer.lines(flat(found))
    assert "pairs_left_second = numbers[1]" in lines
    assert "pairs_apart = numbers[4]" in lines
    assert [writer(value) for value in flat(found)][:2] == [
        "pairs_right_first",
        "pairs_right_second",
    ]


def test_a_helper_that_returns_a_record_names_its_numbers():
    def apart(a, b):
        found = halved(a, b)
        return found.left.second * found.apart

    lines, _ = written(apart, "ab")
    assert "middle = (a + b) / F(2.0)" in lines


def test_numbers_of_closures_modules_and_numpy_are_written_as_numbers():
    gain, wide, whole, zero_d = np.float64(0.25), np.float32(0.5), np.int64(3), np.array(2.0)

    def function(a, b):
        low = numpy.minimum(np.maximum(minimum(a, gain), wide - 2), whole)
        return (
            np.sqrt(low * low + math.pi) * gain
            + np.float64(1.5) * b
            + whole / zero_d
            - np.float64(2.0) * a
        )

    assert runs_alike(function, list(np.random.default_rng(0).normal(size=(20, 2))))
    lines, (result,) = written(function, "ab")
    assert repr(math.pi) in lines + result
    assert "float" not in lines + result


def test_loops_of_fixed_length_and_conditions_on_numbers_are_unrolled():
    def horner(a, b):
        total = 0.0
        for k, factor in enumerate((1.0, -0.5, 0.25)):
            total = total * a + factor if k else factor * b
        return total

    assert runs_alike(horner, list(np.random.default_rng(0).normal(size=(20, 2))))


def test_variables_have_the_names_of_the_source():
    def drag(speed, lift):
        square = speed * speed
        force = 0.5 * square * lift
        limited = minimum(force, 3.0)
        return limited + square

    lines, _ = written(drag, ("speed", "lift"))
    assert re.findall(r"^(\w+) =", lines, re.MULTILINE)[:3] == ["square", "force", "limited"]


def test_a_name_that_is_taken_gets_a_number():
    """By the text around, by what the lines call, by a variable of the text around, by another
    function."""

    def inner(a):
        total = a * 3.0
        return total + total

    def outer(a, weight_b):
        select = a + 1.0
        total = inner(select)
        F = total * select
        cost = where(weight_b < F, F, select)
        weight_b = cost * 2.0
        lambda_ = weight_b + cost
        return weight_b + lambda_ + sin(weight_b)

    names = ("a", "weight_b")
    lines, _ = written(outer, names, around="for l in range(L): cost[l] = state[0, l] + total")
    assigned = re.findall(r"^(\w+) =", lines, re.MULTILINE)
    assert len(assigned) == len(set(assigned))
    assert not {"select", "F", "cost", "total", "a", "weight_b"} & set(assigned)
    assert {"select_2", "F_2", "cost_2", "total_2", "weight_b_2", "lambda_"} <= set(assigned)
    assert runs_alike(outer, list(np.random.default_rng(0).normal(size=(20, 2))))


def branch(a, b):
    if a > b:  # here
        return a
    return b


def both_hold(a, b):
    return where(a > 0.0 and b > 0.0, a, b)  # here


def chained(a, b):
    return where(0.0 < a < b, a, b)  # here


def negated(a, b):
    return where(not a > b, a, b)  # here


def smallest(a, b):
    return min(a, b)  # here


def inner_branch(a, b):
    return branch(a, b)  # not here: the line of the branch itself is named


def as_float(a, b):
    return float(a) + b  # here


def root_of_math(a, b):
    return math.sqrt(a * b)  # here


def summed(a, b):
    return sum(a)  # here


def unpacked(a, b):
    first, second = a  # here
    return first + second * b


def rounded(a, b):
    return np.round(a) + b  # here


def clipped_into(a, b):
    return np.clip(a, -b, b, out=None)  # here


def joined_numbers(a, b):
    return where((a > b) & b, a, b)  # here


def joined_without_parentheses(a, b):
    return where(a > 0.0 | b > 1.0, a, b)  # here


def inverted(a, b):
    return where(~a, a, b)  # here


def raised(a, b):
    return np.power(2.0, a) + b  # here


def cubic_root(a, b):
    return np.cbrt(a) + b  # here


def fractional(a, b):
    return (a + b) ** 0.5  # here


def inverse(a, b):
    return b * a**-1  # here


def places(a, b):
    return np.where(a > b)  # here


def listed(a, b):
    return a + [1.0]  # noqa: RUF005  # here


def rows(a, b):
    return a * np.ones(3)  # here


def worded(a, b):
    return where(a > b, a, "b")  # here


def unlimited(a, b):
    return where(a > b, a, np.inf)  # here


def undefined(a, b):
    return a * math.nan + b  # here


def misspelt(a, b):
    return Pair(a, b).thrid  # here


def divided(a, b):
    return a + 1 / 0  # here


def indexed(a, b):
    return a[0] + b  # here


REFUSED = {  # function -> what its message has to say
    branch: r"write numpy\.where\(condition, a, b\)",
    both_hold: r"& or \|",
    chained: r"& or \|",
    negated: r"condition is not known",
    smallest: r"numpy\.minimum or numpy\.maximum",
    as_float: r"known are arithmetic",
    root_of_math: r"functions of math .*write NumPy's, such as numpy\.sin; known are .*sqrt",
    summed: r"a scalar was taken for a sequence",
    unpacked: r"a scalar was taken for a sequence",
    rounded: r"numpy\.round is not known; known are .*floor",
    clipped_into: r"numpy\.clip is known as numpy\.clip\(a, low, high\) alone",
    joined_numbers: r"&, .* join conditions, and one side is a number",
    joined_without_parentheses: r"join conditions.*in parentheses",
    inverted: r"join conditions",
    raised: r"2\.0\*\*x is not known: write exp",
    cubic_root: r"numpy\.cbrt is not known; known are",
    fractional: r"x\*\*0\.5 is not known, .*: write products, sqrt",
    inverse: r"x\*\*-1 is not known, .*: write products, sqrt",
    places: r"numpy\.where is not known|three",
    listed: r"expected a number or a scalar of the rollout, got list",
    rows: r"expected a number or a scalar of the rollout, got ndarray",
    worded: r"expected a number or a scalar of the rollout, got str 'b'",
    unlimited: r"inf is not finite.*1e30",
    undefined: r"nan is not finite",
    misspelt: r"AttributeError: .*thrid",
    divided: r"ZeroDivisionError: division by zero",
    indexed: r"TypeError: 'Symbol' object is not subscriptable",
}


def refused(function):
    graph = Graph()
    with pytest.raises(TraceError) as caught:
        trace_number(function, graph.variable("a"), graph.variable("b"))
    message = str(caught.value)
    assert "\n" not in message
    assert isinstance(caught.value, TypeError)
    return message


@pytest.mark.parametrize("function", REFUSED, ids=lambda function: function.__name__)
def test_what_cannot_be_traced_is_a_line_that_names_function_place_and_way_out(function):
    message = refused(function)
    assert message.startswith(f"{__name__}.{function.__name__}: ")
    assert re.search(REFUSED[function], message), message
    file, line = re.search(rf"(\S*{HERE}):(\d+): ", message).groups()
    assert linecache.getline(file, int(line)).endswith("# here\n")


def test_a_branch_in_a_helper_is_named_by_its_own_line():
    message = refused(inner_branch)
    assert message.startswith(f"{__name__}.inner_branch: ")
    line = int(re.search(rf"{HERE}:(\d+): ", message).group(1))
    assert linecache.getline(__file__, line).strip() == "if a > b:  # here"


def forgetful(a, b):
    a + b


def several(a, b):
    return a, b


def text_of(a, b):
    return "a + b"


@pytest.mark.parametrize(
    ("function", "found"),
    [(forgetful, "None: is a return missing"), (several, "tuple"), (text_of, "str 'a")],
    ids=["nothing", "two numbers", "text"],
)
def test_a_result_that_is_no_number_is_a_line_that_names_the_function(function, found):
    message = refused(function)
    line = function.__code__.co_firstlineno
    assert message.startswith(
        f"{__name__}.{function.__name__}: {__file__}:{line}: expected it to return "
    )
    assert found in message


@pytest.mark.parametrize("value", [0.5, 2, True, np.float64(0.25), np.array(1.5)])
def test_a_result_that_does_not_depend_on_the_arguments_is_a_number(value):
    found = trace_number(lambda a: value, Graph().variable("a"))
    assert found == value
    assert type(found) in (float, bool)


def test_tracing_leaves_the_profiler_as_it_was():
    seen = []

    def profiler(*event):
        seen.append(event)

    before = sys.getprofile()
    sys.setprofile(profiler)
    try:
        written(halved, "ab")
        refused(branch)
        kept = sys.getprofile()
    finally:
        sys.setprofile(before)
    assert kept is profiler
