"""The shape of the code: no import cycle between modules, no file too small to be one, no function too long to read."""

import ast
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("quadsim", "controllers", "web")
FILES = sorted(p for package in PACKAGES for p in (ROOT / package).rglob("*.py"))
LEAST, LONGEST = 15, 40  # lines of a file, of a function
EQUATIONS = ("step", "terms")  # models and costs: one equation after the other, inlined into the compiled lanes


def cycles(graph: dict[str, set[str]]) -> list[list[str]]:
    """One path through each group of modules that import each other, found by a search in depth."""
    found, done = [], set()

    def visit(module: str, path: list[str]) -> None:
        if module in path:
            found.append([*path[path.index(module) :], module])
        elif module not in done:
            for imported in sorted(graph[module]):
                visit(imported, [*path, module])
            done.add(module)

    for module in sorted(graph):
        visit(module, [])
    return found


def test_a_cycle_is_found_and_a_diamond_is_none():
    assert cycles({"a": {"b", "c"}, "b": {"d"}, "c": {"d"}, "d": set()}) == []
    assert cycles({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == [["b", "c", "b"]]


def test_no_modules_import_each_other():
    """Imports inside functions count, those for type checkers alone do not."""
    graph = grimp.build_graph(*PACKAGES, exclude_type_checking_imports=True, cache_dir=None)
    imports = {m: graph.find_modules_directly_imported_by(m) for m in graph.modules}
    assert len(imports) >= len(FILES)
    assert [" -> ".join(cycle) for cycle in cycles(imports)] == []


def length(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines without the docstring."""
    doc = function.body[0] if ast.get_docstring(function) else None
    return function.end_lineno - function.lineno + 1 - (doc.end_lineno - doc.lineno + 1 if doc else 0)


def test_the_length_of_a_function_is_told_without_its_docstring():
    (function,) = ast.parse('def f(\n    x,\n):\n    """One.\n\n    Two.\n    """\n    return x\n').body
    assert length(function) == 4


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_a_file_is_worth_opening_and_its_functions_can_be_read(path):
    text = path.read_text(encoding="utf-8")
    assert path.name == "__init__.py" or len(text.splitlines()) >= LEAST
    functions = [n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)]
    long = {f.name: length(f) for f in functions if length(f) > LONGEST and f.name not in EQUATIONS}
    assert long == {}
