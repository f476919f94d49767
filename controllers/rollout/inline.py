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

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        number = isinstance(node.value, int | float) and not isinstance(node.value, bool)
        return ast.Call(ast.Name("F", ast.Load()), [node], []) if number else node

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        return node

    def visit_Name(self, node: ast.Name) -> ast.AST:
        return ast.parse(WORDS[node.id], mode="eval").body if node.id in WORDS else node


def lane_source(function: Callable, done: dict[str, str] | None = None) -> dict[str, str]:
    """Name -> source text of the function and of the module constants and functions it uses, in order."""
    done = {} if done is None else done
    tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    assert isinstance(tree, ast.FunctionDef)
    for name, value in inspect.getclosurevars(function).globals.items():
        if name in WORDS or name in done:
            continue
        if isinstance(value, int | float):
            done[name] = f"{name} = F({value!r})"
        elif inspect.isfunction(value):
            lane_source(value, done)
        else:
            raise TypeError(
                f"{function.__module__}.{function.__name__}: a lane cannot use {name!r} ({type(value).__name__})"
            )
    if ast.get_docstring(tree) is not None:
        tree.body = tree.body[1:]
    tree.returns = None
    for argument in tree.args.args:
        argument.annotation = None
    done[tree.name] = "@inline\n" + ast.unparse(ast.fix_missing_locations(_Typed().visit(tree)))
    return done
