"""What Nastran's matrix files, DMIG cards and OUTPUT4, have in common."""

from __future__ import annotations

import re
from collections.abc import Mapping

from ..typing import Sparse
from .model import Labels, Role, StoredMatrix
from .source import MatrixFile

SYMMETRIC = 6
LARGEST_GRID = 2**31 - 1
REAL = (1, 2)
# K, M or B of a set of freedoms: KGG, MAA, BDD, K2PP, and KAAX as EXTSEOUT writes it.
_OF_A_SET = re.compile(r"[KMB][12]?([A-Z])\1X?")
_DIFFERENTIAL = re.compile(r"KD(?!D$)")  # KDGG, …; KDD is all of the stiffness, of the d-set
_NOTE = "The matrix is stored as complex numbers; all imaginary parts are 0."


def check_form(source: MatrixFile, form: int, accepted: tuple[int, ...], forms: Mapping[int, str]) -> None:
    """Raises CaseError for a form that is not accepted; forms: what the others are called."""
    if form not in accepted:
        shown = f"{form} ({forms[form]})" if form in forms else f"{form}, which is not known"
        source.refuse(f"has form {shown}; accepted: 1 (square) and 6 (symmetric)")


def named(
    source: MatrixFile, matrix: Sparse, labels: Labels | None, form: int, kind: int, notes: tuple[str, ...]
) -> StoredMatrix:
    """A matrix with what its name, form and kind say.

    The name begins with K, M or B; but K4GG and its like hold structural damping, Σ GE·K of elements, whose forces are
    i·K4·u, and KDGG and its like the differential stiffness of a load, of which a name does not tell for which load.
    """
    roles: dict[str, Role] = {"K": "stiffness", "M": "mass", "B": "damping"}
    name = source.name.upper()
    role, unsaid = roles.get(name[:1]), ""
    if name.startswith("K4"):
        role = None
        unsaid = (
            "by its name (K4…) it is structural damping, no stiffness; near an angular frequency omega it is viscous "
            'damping: role = "damping", factor = "1/omega"; leave it out, or give the role that it is to have'
        )
    elif _DIFFERENTIAL.match(name):
        role = None
        unsaid = (
            "by its name (KD…) it is differential stiffness, part of K only where the load acts that it is of; "
            'leave it out, or give role = "stiffness"'
        )
    return StoredMatrix(
        matrix,
        source.path.name,
        labels,
        role,
        "symmetric" if form == SYMMETRIC else "general",
        source.name,
        notes if kind in REAL else (*notes, _NOTE),
        certain=_OF_A_SET.fullmatch(name) is not None,
        unsaid=unsaid,
    )
