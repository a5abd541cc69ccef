"""What laws, contact, elements, statics and runs are described by, and what they answer with, cannot be written to."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil

import pytest

# Work in progress: what a run or a look at it counts up.
CHANGING = {
    "temporal.steppers.modal.machine.Machine", "temporal.steppers.sparse.machine.Machine", "temporal.pace.Pace",
    "temporal.observe.LineShape", "temporal.phase_results.PhaseResults",
}  # fmt: skip


@pytest.mark.parametrize("package", ["contact", "fe", "laws", "sliding", "temporal"])
def test_descriptions_and_results_cannot_be_written_to(package: str) -> None:
    top = importlib.import_module(f"stridor.{package}")
    found: dict[str, bool] = {}
    for module in (top.__name__, *(m.name for m in pkgutil.walk_packages(top.__path__, f"{top.__name__}."))):
        for name, kind in vars(importlib.import_module(module)).items():
            if inspect.isclass(kind) and kind.__module__ == module and dataclasses.is_dataclass(kind):
                frozen = kind.__dataclass_params__.frozen  # type: ignore[attr-defined]
                found[f"{module.removeprefix('stridor.')}.{name}"] = frozen
    assert found
    assert {name for name, frozen in found.items() if not frozen} == {n for n in CHANGING if n.startswith(package)}
