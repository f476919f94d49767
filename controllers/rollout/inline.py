"""From a plain function over scalars to the source of its lane twin.

`lane_source` writes a function and everything it calls as one module text in which every number is of
the lanes' precision: a bare literal would be float64 for numba and cost a third of the speed.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable

# What the words of a system or cost become in a lane. numpy's own where, minimum and maximum
# allocate on scalars; these become selects.
WORDS = {
    "sqrt": "math.sqrt",
    "exp": "math.exp",
    "where": "select",
    "minimum": "lower",
    "maximum": "higher",
    "abs": "abs",
}


class _Typed(ast.NodeTransformer):
    """Numbers become F(number), words become their lane twins; an index stays an integer."""

    def __init__(self, renamed: dict[str, str]):
        self._renamed = renamed

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        number = isinstance(node.value, int | float) and not isinstance(node.value, bool)
        return ast.Call(ast.Name("F", ast.Load()), [node], []) if number else node

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        return node

    def visit_Name(self, node: ast.Name) -> ast.AST:
        if node.id in WORDS:
            return ast.parse(WORDS[node.id], mode="eval").body
        return ast.Name(self._renamed.get(node.id, node.id), node.ctx)


def lane_source(function: Callable, name: str = "", done: dict[str, str] | None = None) -> dict[str, str]:
    """Name -> source text of the function and of the module constants and functions it uses, in order.

    name: of the function in the text; what it uses is named after it, so that two modules may use one name.
    """
    done, name = {} if done is None else done, name or function.__name__
    tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    assert isinstance(tree, ast.FunctionDef)
    renamed = {}
    for used, value in inspect.getclosurevars(function).globals.items():
        if used in WORDS:
            continue
        renamed[used] = f"{name}_{used}"
        if isinstance(value, int | float):
            done[renamed[used]] = f"{renamed[used]} = F({value!r})"
        elif inspect.isfunction(value):
            lane_source(value, renamed[used], done)
        else:
            raise TypeError(
                f"{function.__module__}.{function.__name__}: a lane cannot use {used!r} ({type(value).__name__})"
            )
    if ast.get_docstring(tree) is not None:
        tree.body = tree.body[1:]
    tree.name, tree.returns = name, None
    for argument in tree.args.args:
        argument.annotation = None
    done[name] = "@inline\n" + ast.unparse(ast.fix_missing_locations(_Typed(renamed).visit(tree)))
    return done
