"""How often the program computes what it should compute once."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import pytest

from stridor.sliding import solution, stretches
from stridor.system import build, uncoupled


def count(monkeypatch: pytest.MonkeyPatch, function: Callable[..., Any]) -> list[tuple[Any, ...]]:
    """A list that gets the arguments of every call of a function of stridor, whoever has imported it."""
    calls: list[tuple[Any, ...]] = []

    def counted(*args: Any, **kwargs: Any) -> Any:
        calls.append((*args, *sorted(kwargs.items())))
        return function(*args, **kwargs)

    for name, module in list(sys.modules.items()):
        if name.startswith("stridor"):
            for key in [key for key, value in vars(module).items() if value is function]:
                monkeypatch.setattr(module, key, counted)
    return calls


class Counts:
    """Calls of what builds systems, solves equilibria and the modes without contacts."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        import stridor.app.pipeline  # noqa: F401 - what a run is made of is there to be counted

        self.built = count(monkeypatch, build.build_system)
        self.bases = count(monkeypatch, uncoupled._solved)
        self.nodes = count(monkeypatch, solution.steady_sliding)
        assert stretches.steady_sliding is solution.steady_sliding

    def check(self) -> None:
        """Assert that nothing was computed twice: one system, one basis with and one without damping, and no
        equilibrium of one system at one μ again."""
        assert len(self.built) == 1
        assert len(self.bases) <= 2
        asked = [_question(call) for call in self.nodes if not _of_a_phase(call)]
        assert len(asked) == len(set(asked))
        assert self.nodes


def _question(call: tuple[Any, ...]) -> tuple[Any, ...]:
    """The system, which the call keeps alive, the μ of an equilibrium, and who has to touch."""
    named = dict(call[1:])
    held = named.get("held")
    return id(call[0]), named.get("mu"), None if held is None else held.tobytes()


def _of_a_phase(call: tuple[Any, ...]) -> bool:
    """Whether loads are those of a phase, which is another question."""
    named = dict(call[1:])
    return any(named.get(key) is not None for key in ("load_factors", "motion_factors"))
