"""No module imports, directly or through others, a module that imports it, inside functions as little as at the top."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import stridor

ROOT = Path(stridor.__file__).parent


def names() -> dict[str, Path]:
    """Modules by their dotted names, packages by the name of their folder."""
    found = {}
    for path in ROOT.rglob("*.py"):
        parts = path.relative_to(ROOT.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imported(name: str, path: Path, known: Mapping[str, Path]) -> set[str]:
    """Modules of ours that a module imports wherever it does, but for types alone."""
    package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    found: set[str] = set()
    waiting: list[ast.AST] = [ast.parse(path.read_text(encoding="utf-8"))]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            continue
        if isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else []
            base = ".".join([*above, *(node.module or "").split(".")]).strip(".")
            found |= {full if (full := f"{base}.{a.name}") in known else base for a in node.names}
        waiting.extend(ast.iter_child_nodes(node))
    return (found & set(known)) - {name}


def ordered(graph: Mapping[str, set[str]]) -> list[str]:
    return list(TopologicalSorter(graph).static_order())


def test_modules_can_be_put_in_an_order() -> None:
    known = names()
    assert len(ordered({name: imported(name, path, known) for name, path in known.items()})) == len(known)


def test_a_circle_is_found(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text("def f():\n    from .b import g\n")
    (tmp_path / "b.py").write_text("from . import a\n")
    known = {"p.a": tmp_path / "a.py", "p.b": tmp_path / "b.py"}
    with pytest.raises(CycleError):
        ordered({name: imported(name, path, known) for name, path in known.items()})
