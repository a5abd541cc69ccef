"""Whether a motion is one that nothing resists, or one whose resistance numbers do not tell: stiffnesses lie too far
apart for the digits of double precision."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..system import System
from ..typing import Array, IntArray

FREE = 1e-10  # of the terms of a body's own rows: what a motion leaves of them that its stiffness does not resist
DROWNED = 1e-11  # of the largest terms of any row: a resistance of which rounding there leaves no digits
APART = 1e13  # between entries on the diagonal: as `direct.factor` takes matrices as singular

MEND = "check the measures, moduli and units of what is there (the body, springs, ties), or make it softer"


@dataclass(frozen=True)
class Moved:
    """What a motion moves most, in words and as freedoms (k,); resisted: whether its own stiffness resists that. apart:
    what to say where the resistance drowns in rounding of something else, "" where it does not."""

    who: str
    freedoms: IntArray
    resisted: bool
    apart: str


def moved_most(system: System, motion: Array) -> Moved:
    """What a motion (n,) moves most, and whether its stiffness, contacts not included, resists that."""
    freedom = int(np.argmax(np.abs(motion)))
    who, freedoms = owner(system, freedom)
    size = float(np.abs(motion[freedom])) or 1.0
    x = motion / size
    force, terms = np.abs(system.stiffness @ x), abs(system.stiffness) @ np.abs(x)
    resistance, own = float(force[freedoms].max()), float(terms[freedoms].max())
    if not resistance > FREE * own:
        return Moved(who, freedoms, resisted=False, apart="")
    stiffest = int(np.argmax(terms))
    if resistance > DROWNED * float(terms[stiffest]):
        return Moved(who, freedoms, resisted=True, apart="")
    diagonal = np.abs(system.stiffness.diagonal())
    share = resistance / float(terms[stiffest])
    apart = (
        "stiffnesses lie too far apart for the 16 digits of a number: the stiffness matrix has "
        f"{diagonal[stiffest]:.3g} at {_named(system, stiffest)} and {float(diagonal[freedoms].max()):.3g} at most at "
        f"{who}; what {who} resists a motion with is {share:.1g} of the terms there and drowns in their rounding; "
        f"{MEND}"
    )
    return Moved(who, freedoms, resisted=True, apart=apart)


def far_apart(system: System) -> str:
    """What to say of a stiffness matrix whose diagonal, of displacements or of rotations, reaches farther than double
    precision; "" of others."""
    diagonal = np.abs(system.stiffness.diagonal())
    turns = np.array([name.endswith("rotation") for name in system.dof_names], dtype=bool)
    for kind in (~turns, turns) if len(turns) == len(diagonal) else (np.ones(len(diagonal), dtype=bool),):
        among = np.flatnonzero(kind & (diagonal > 0))
        if not len(among):
            continue
        low, high = among[np.argmin(diagonal[among])], among[np.argmax(diagonal[among])]
        if diagonal[high] > APART * diagonal[low]:
            return (
                "stiffnesses lie too far apart for the 16 digits of a number: the stiffness matrix has "
                f"{diagonal[high]:.3g} at {_named(system, int(high))}, {diagonal[high] / diagonal[low]:.1g} times the "
                f"{diagonal[low]:.3g} at {_named(system, int(low))}; {MEND}"
            )
    return ""


def owner(system: System, freedom: int) -> tuple[str, IntArray]:
    """The body that a freedom is of, in words, and its freedoms (k,); of what is no body, the freedom."""
    for body in (*system.lines, *system.solids):
        if np.any(body.freedoms == freedom):
            return f"body {body.name}", np.asarray(body.freedoms).ravel()
    return _named(system, freedom), np.array([freedom])


def _named(system: System, freedom: int) -> str:
    return system.dof_names[freedom] if freedom < len(system.dof_names) else f"freedom {freedom}"
