"""The shape of the code: no import cycle between modules."""

from pathlib import Path

import grimp

ROOT = Path(__file__).parent.parent
PACKAGES = ("quadsim", "controllers", "web")
FILES = sorted(p for package in PACKAGES for p in (ROOT / package).rglob("*.py"))


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
