"""The parts that `run` and `report` are made of, and which of them are asked for."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from ..agreement import PARTS as OF_COMPARISON
from ..errors import CaseError
from .asked import names_of

PARTS = ("modes", "onsets", "sensitivities", "countermeasures", "simulate", "compare", "report")
OF_RUN = ("modes", "onsets", "simulate", "compare", "report")
OF_REPORT = ("modes", "onsets", "sensitivities", "countermeasures", "report")


@dataclass(frozen=True)
class RunParts:
    """What is computed: names of PARTS, and of the comparison its own parts (`agreement.PARTS`).

    What is left out is not computed; what is there of it from an earlier call on the same case is shown.
    """

    names: frozenset[str]
    of_comparison: frozenset[str] = frozenset(OF_COMPARISON)
    critical_named: bool = False

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def comparison(self, *, critical: bool, run: bool) -> frozenset[str]:
        """Parts of the comparison; critical: whether the case asks for the critical friction, run: whether there is a
        full run."""
        out = (set() if critical or self.critical_named else {"critical"}) | (set() if run else {"run"})
        return self.of_comparison - out


def chosen_parts(
    only: str | Collection[str] | None = None,
    skip: str | Collection[str] | None = None,
    default: Collection[str] = OF_RUN,
) -> RunParts:
    """The parts named, or those of ``default``, without those skipped. Parts of the comparison may be named alone;
    its full run takes `simulate` with it. Raises CaseError for other names, and where nothing is left."""
    named, left = _names(only, "only"), _names(skip, "skip")
    if both := named & left:
        raise CaseError("skip", ", ".join(sorted(both)), "is among those to be computed alone, too; leave one out")
    names = named or set(default)
    inner = names & set(OF_COMPARISON)
    of_comparison = (inner if inner and "compare" not in names else set(OF_COMPARISON)) - left
    if inner:
        names |= {"compare"} | ({"simulate"} if "run" in inner else set())
    if not of_comparison:
        left |= {"compare"}
    if named and "report" not in left:
        # The page shows what there is, whatever was asked for.
        names |= {"report"}
    found = (names & set(PARTS)) - left
    if not found:
        raise CaseError("skip", ", ".join(sorted(left)), f"leaves nothing to do; parts: {', '.join(PARTS)}")
    return RunParts(frozenset(found), frozenset(of_comparison), "critical" in inner)


def _names(given: str | Collection[str] | None, where: str) -> set[str]:
    """Names as given, several with commas in one. Raises CaseError."""
    texts = names_of(() if given is None else given, where, none=True)
    names = [name.strip() for text in texts for name in text.split(",")]
    for name in names:
        if name not in (*PARTS, *OF_COMPARISON):
            accepted = f"{', '.join(PARTS)}; of the comparison {', '.join(OF_COMPARISON)}"
            raise CaseError(where, name, accepted)
    return set(names)
