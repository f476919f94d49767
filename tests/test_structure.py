"""No two modules import each other, directly or through others."""

import grimp

PACKAGES = ("quadsim",)


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
