"""No two modules import each other, and tests with marks of their own stand where make looks."""

from pathlib import Path

import grimp

PACKAGES = ("quadsim",)
TESTS = Path(__file__).parent
# The files and folders that DOCUMENTS of the Makefile names
DOCUMENTS = ("test_notebooks.py", "test_examples.py", "docs")


def test_no_modules_import_each_other():
    """Imports inside functions count, those for type checkers alone do not."""
    graph = grimp.build_graph(*PACKAGES, exclude_type_checking_imports=True, cache_dir=None)
    edges = [
        (module, imported)
        for module in graph.modules
        for imported in graph.find_modules_directly_imported_by(module)
    ]
    assert len(edges) > len(graph.modules)
    cycles = [edge for edge in edges if graph.chain_exists(importer=edge[1], imported=edge[0])]
    assert cycles == []


def test_tests_of_documents_stand_where_make_docs_check_looks():
    """Tests behind the firmware need no such check: the conftest of their folder marks them."""
    marked = {
        path.relative_to(TESTS).parts[0]
        for path in TESTS.rglob("test_*.py")
        if "pytest.mark.docs\n" in path.read_text()
    }
    assert marked == set(DOCUMENTS)
    words = " ".join(f"tests/{name}" for name in DOCUMENTS)
    assert f"DOCUMENTS := {words}\n" in (TESTS.parent / "Makefile").read_text()
