"""What Nastran's matrix files, DMIG cards and OUTPUT4, have in common."""

from __future__ import annotations

from collections.abc import Mapping

from ..typing import Sparse
from .model import Labels, Role, StoredMatrix
from .source import MatrixFile

SYMMETRIC = 6
LARGEST_GRID = 2**31 - 1
REAL = (1, 2)
_NOTE = "The matrix is stored as complex numbers; all imaginary parts are 0."


def check_form(source: MatrixFile, form: int, accepted: tuple[int, ...], forms: Mapping[int, str]) -> None:
    """Raises CaseError for a form that is not accepted; forms: what the others are called."""
    if form not in accepted:
        shown = f"{form} ({forms[form]})" if form in forms else f"{form}, which is not known"
        source.refuse(f"has form {shown}; accepted: 1 (square) and 6 (symmetric)")


def named(
    source: MatrixFile, matrix: Sparse, labels: Labels | None, form: int, kind: int, notes: tuple[str, ...]
) -> StoredMatrix:
    """A matrix with what its name, form and kind say."""
    roles: dict[str, Role] = {"K": "stiffness", "M": "mass", "B": "damping"}
    return StoredMatrix(
        matrix,
        source.path.name,
        labels,
        roles.get(source.name[:1].upper()),
        "symmetric" if form == SYMMETRIC else "general",
        source.name,
        notes if kind in REAL else (*notes, _NOTE),
    )
