"""After `System` nobody asks what kind of system it is: sources and steppers say what they refuse, results say who
answered, and all others ask for facts."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import stridor
from stridor.system import System

SOURCES = Path(stridor.__file__).parent
KINDS = {"assembled", "beyond_points", "general", "kind", "is_assembled", "is_general"}
# Who says by facts alone which systems it takes.
REFUSING = {"modal/source.py", "temporal/steppers/exact/stepper.py", "temporal/steppers/modal/stepper.py"}


def modules() -> Iterator[tuple[str, ast.Module]]:
    for path in sorted(SOURCES.rglob("*.py")):
        name = path.relative_to(SOURCES).as_posix()
        if not name.startswith("system/"):
            yield name, ast.parse(path.read_text(encoding="utf-8"))


def is_system(node: ast.expr) -> bool:
    """system, self.system, machine._system, work.system(), settings.system(…), …"""
    if isinstance(node, ast.Call):
        return is_system(node.func)
    name = node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""
    return name.strip("_").endswith("system")


def asked(tree: ast.AST) -> list[str]:
    """Kinds asked of systems in a module, by attribute or by getattr."""
    found = [n.attr for n in ast.walk(tree) if isinstance(n, ast.Attribute) and n.attr in KINDS and is_system(n.value)]
    calls = [n for n in ast.walk(tree) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)]
    words = [a.value for n in calls if n.func.id in ("getattr", "hasattr") and is_system(n.args[0])  # type: ignore[attr-defined]
             for a in n.args[1:] if isinstance(a, ast.Constant)]  # fmt: skip
    return found + [str(w) for w in words if w in KINDS]


def test_no_module_asks_a_system_for_its_kind() -> None:
    assert {name: found for name, tree in modules() if (found := asked(tree))} == {}
    assert not KINDS & set(dir(System))
    assert not KINDS & set(System.__dataclass_fields__)


@pytest.mark.parametrize(
    "text", ["if system.assembled: pass", "x = work.system().general", "y = self._system.beyond_points",
             "getattr(system, 'assembled', False)"],
)  # fmt: skip
def test_a_module_that_does_is_found(text: str) -> None:
    assert len(asked(ast.parse(text))) == 1


def test_only_sources_and_steppers_say_what_a_complete_basis_takes() -> None:
    """The facts are weighed in one place; the others ask who answers, not what the system would need."""
    users = {
        name for name, tree in modules() for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and any(a.name == "no_complete_basis" for a in node.names)
    }  # fmt: skip
    assert users == REFUSING


def test_unsymmetric_matrices_are_a_fact() -> None:
    plain = System.from_matrices(np.eye(2), None, [[2.0, 1.0], [1.0, 2.0]])
    skew = System.from_matrices(np.eye(2), None, [[2.0, 1.0], [-1.0, 2.0]])
    assert plain.symmetric_definite
    assert not plain.not_symmetric_definite
    assert not skew.symmetric_definite
    assert skew.not_symmetric_definite == "the stiffness matrix is not symmetric"
