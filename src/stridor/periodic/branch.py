"""Branches of cycles, and what changes along them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from .cycle import Cycle

Kind = Literal[
    "fold", "period doubling", "torus", "branching", "stability changes with the contacts", "sticking begins",
    "sticking ends", "reversal of slip begins", "reversal of slip ends", "separation begins", "separation ends",
    "contacts change in another order",
]  # fmt: skip
WORDS = {"stick": "sticking", "reversal": "reversal of slip", "separation": "separation"}
REAL = 1e-6  # of a multiplier: its imaginary part where it is real


@dataclass(frozen=True)
class Bifurcation:
    """What changes along a branch between two neighbouring cycles of it: mu_before, mu_after their friction
    coefficients, in the order of the branch, frequency_hz of the first. A fold is a cycle itself, and has its μ twice.

    kind: "fold" (μ turns back), "period doubling" (a multiplier leaves or enters at −1), "torus" (a pair of them),
    "branching" (one at 1 without a fold), "stability changes with the contacts" (where contacts change in another way
    behind, multipliers jump), or what begins or ends: "sticking", "reversal of slip", "separation";
    "contacts change in another order" where none of these does. harmonics: of a sticking or a reversal that
    begins or ends by harmonic balance, those of the cycle that has it: they tell none that is shorter than one over
    them of the period, so that shorter ones begin before and end behind; None elsewhere.
    """

    kind: Kind
    mu_before: float
    mu_after: float
    frequency_hz: float
    harmonics: int | None = None

    @property
    def sentence(self) -> str:
        """In words."""
        if self.kind == "fold":
            return f"fold at μ = {self.mu_before:.6g}"
        between = f"between μ = {self.mu_before:.6g} and {self.mu_after:.6g}"
        if self.harmonics is not None:
            what, happens = self.kind.rsplit(maxsplit=1)
            told = f"1/{self.harmonics} of the period, which {self.harmonics} harmonics tell"
            return f"{what} of {told}, {happens} {between}"
        return f"{self.kind} {between}"

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return dict(vars(self))


@dataclass(frozen=True)
class CycleBranch:
    """A branch that was followed: cycles (k,) the numbers of its cycles (from 0) in the order of the branch, begins and
    ends: why there is no more of it before the first and behind the last, in words; onset: the number (from 0) of the
    onset that it begins at, None where it begins at none; folds: numbers of the cycles at which μ turns back."""

    cycles: tuple[int, ...]
    begins: str
    ends: str
    onset: int | None
    folds: tuple[int, ...]
    bifurcations: tuple[Bifurcation, ...]

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "cycles": list(self.cycles),
            "begins": self.begins,
            "ends": self.ends,
            "onset": self.onset,
            "folds": list(self.folds),
            "bifurcations": [b.to_json() for b in self.bifurcations],
        }


def bifurcations(cycles: Sequence[Cycle], folds: Sequence[int]) -> tuple[Bifurcation, ...]:
    """What changes along cycles in the order of their branch; folds: which of them are folds."""
    found: list[Bifurcation] = []
    for k, cycle in enumerate(cycles):
        if k in folds:
            found.append(Bifurcation("fold", cycle.mu, cycle.mu, cycle.frequency_hz))
        if k + 1 < len(cycles):
            found += [
                Bifurcation(kind, cycle.mu, cycles[k + 1].mu, cycle.frequency_hz, _told(kind, cycle, cycles[k + 1]))
                for kind in _between(cycle, cycles[k + 1], fold=k in folds or k + 1 in folds)
            ]
    return tuple(found)


def _told(kind: Kind, one: Cycle, other: Cycle) -> int | None:
    """The harmonics that decide when sticks and reversals are long enough to be told, None where all are."""
    if not kind.startswith(("sticking", "reversal")):
        return None
    having = other if kind.endswith("begins") else one
    return having.harmonics if having.method == "harmonic" else None


def _between(one: Cycle, other: Cycle, *, fold: bool) -> list[Kind]:
    found: list[Kind] = []
    for kind, word in WORDS.items():
        if (kind in one.kinds) != (kind in other.kinds):
            found.append(f"{word} {'begins' if kind in other.kinds else 'ends'}")  # type: ignore[arg-type]
    # Series of harmonics tell when a contact changes only to a share of the period: the order is no news.
    alike = same_word(one, other) or "harmonic" in (one.method, other.method)
    if not found and not alike:
        found.append("contacts change in another order")
    if one.stable is None or other.stable is None or one.stable == other.stable or fold:
        return found
    if not alike:
        return [*found, "stability changes with the contacts"]
    unstable = one if other.stable else other
    largest = complex(unstable.multipliers[0])
    if abs(largest.imag) > REAL * abs(largest):
        return [*found, "torus"]
    return [*found, "period doubling" if largest.real < 0.0 else "branching"]


def same_word(one: Cycle, other: Cycle) -> bool:
    """Whether the same contacts change in the same order, wherever the period begins."""
    first, second = one.word, other.word
    if len(first) != len(second):
        return False
    twice = second * 2
    return not first or any(twice[k : k + len(first)] == first for k in range(len(first)))


