"""No circles: which module imports which, at the top, inside functions and for type checkers alike."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import networkx as nx
import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = tuple(sorted(path.parent.name for path in (ROOT / "circuitkit").glob("*/__init__.py")))


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


FILES = {module_name(path): path for path in (ROOT / "circuitkit").rglob("*.py")}


def imported(name: str) -> Iterator[str]:
    """The modules of circuitkit that a module imports, wherever it does so."""
    for node in ast.walk(ast.parse(FILES[name].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in FILES)
        elif isinstance(node, ast.ImportFrom) and node.module in FILES:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            yield from inner.intersection(FILES)
            if not inner <= FILES.keys():  # something else than modules, so of the package itself
                yield node.module


@pytest.mark.parametrize("package", PACKAGES)
def test_no_module_imports_one_that_imports_it(package):
    inside = [name for name in FILES if f"{name}.".startswith(f"circuitkit.{package}.")]
    graph = nx.DiGraph((name, other) for name in inside for other in imported(name) if other in inside)
    circles = [sorted(part) for part in nx.strongly_connected_components(graph) if len(part) > 1]
    assert not circles


@pytest.mark.parametrize("package", PACKAGES)
def test_an_import_inside_a_function_says_why(package):
    bare = []
    for path in sorted((ROOT / "circuitkit" / package).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        functions = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)]
        for node in {inner for each in functions for inner in ast.walk(each)}:
            is_import = isinstance(node, ast.Import | ast.ImportFrom)
            if is_import and "  # " not in text.splitlines()[node.lineno - 1]:
                bare.append(f"{path}:{node.lineno}")
    assert not bare
