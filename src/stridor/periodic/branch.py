"""Branches of cycles, and what changes along them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from .crossings import Halfway, crossings
from .cycle import Cycle, same_word

Kind = Literal[
    "fold", "period doubling", "torus", "branching", "stability changes with the contacts",
    "more of it grows with the contacts", "less of it grows with the contacts", "sticking begins",
    "sticking ends", "reversal of slip begins", "reversal of slip ends", "separation begins", "separation ends",
    "contacts change in another order", "multipliers pass or jump, undecided",
]  # fmt: skip
WORDS = {"stick": "sticking", "reversal": "reversal of slip", "separation": "separation"}


@dataclass(frozen=True)
class Bifurcation:
    """What changes along a branch between two neighbouring cycles of it: mu_before, mu_after their friction
    coefficients, in the order of the branch, frequency_hz of the first. A fold is a cycle itself, and has its μ twice.

    kind: "fold" (μ turns back), "period doubling" (a multiplier leaves or enters at −1), "torus" (a pair of them),
    "branching" (one at 1 without a fold), "stability changes with the contacts" (where contacts change in another way
    behind, multipliers jump), "more of it grows with the contacts" and "less of it grows with the contacts" (they jump,
    and it is unstable before and behind), "multipliers pass or jump, undecided" (contacts change in another way there,
    and cycles closed in between do not tell whether multipliers jump or pass the circle), or what begins or ends:
    "sticking", "reversal of slip", "separation"; "contacts change in another order" where none of these does.
    harmonics: of a sticking or a reversal that begins or ends by harmonic balance, those of the cycle that has it: they
    tell none that is shorter than one over them of the period, so that shorter ones begin before and end behind; None
    elsewhere.
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
    onset that it begins at, None where it begins at none; folds: numbers of the cycles at which μ turns back;
    reached_from: how the first cycle of it was found that the others were followed from."""

    cycles: tuple[int, ...]
    begins: str
    ends: str
    onset: int | None
    folds: tuple[int, ...]
    bifurcations: tuple[Bifurcation, ...]
    reached_from: str = ""

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "cycles": list(self.cycles),
            "begins": self.begins,
            "ends": self.ends,
            "onset": self.onset,
            "folds": list(self.folds),
            "bifurcations": [b.to_json() for b in self.bifurcations],
            "reached_from": self.reached_from,
        }


def bifurcations(
    cycles: Sequence[Cycle], folds: Sequence[int], halfway: Halfway | None = None
) -> tuple[Bifurcation, ...]:
    """What changes along cycles in the order of their branch; folds: which of them are folds; halfway: closes a cycle
    of the branch in the middle of the μ of two others, None where it cannot."""
    found: list[Bifurcation] = []
    crossed = crossings(cycles, folds, halfway)
    for k, cycle in enumerate(cycles):
        if k in folds:
            found.append(Bifurcation("fold", cycle.mu, cycle.mu, cycle.frequency_hz))
        if k + 1 < len(cycles):
            other = cycles[k + 1]
            found += [
                Bifurcation(kind, cycle.mu, other.mu, cycle.frequency_hz, _told(kind, cycle, other))
                for kind in _between(cycle, other)
            ]
        found += [
            Bifurcation(kind, cycles[first].mu, cycles[last].mu, cycles[first].frequency_hz)
            for kind, first, last in crossed if last == k + 1
        ]  # fmt: skip
    return tuple(found)


def _told(kind: Kind, one: Cycle, other: Cycle) -> int | None:
    """The harmonics that decide when sticks and reversals are long enough to be told, None where all are."""
    if not kind.startswith(("sticking", "reversal")):
        return None
    having = other if kind.endswith("begins") else one
    return having.harmonics if having.method == "harmonic" else None


def _between(one: Cycle, other: Cycle) -> list[Kind]:
    found: list[Kind] = []
    for kind, word in WORDS.items():
        if (kind in one.kinds) != (kind in other.kinds):
            found.append(f"{word} {'begins' if kind in other.kinds else 'ends'}")  # type: ignore[arg-type]  # ty: ignore[invalid-argument-type]
    return found if found or _alike(one, other) else ["contacts change in another order"]


def _alike(one: Cycle, other: Cycle) -> bool:
    """Series of harmonics tell when a contact changes only to a share of the period: the order is no news."""
    return same_word(one, other) or "harmonic" in (one.method, other.method)
