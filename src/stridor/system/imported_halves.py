"""Matrices of which a file probably holds one half only, though it does not say so.

Read as it stands, a triangle has the eigenvalues of its diagonal: frequencies without any coupling, and nothing in the
analysis that could tell. A stiffness with sliding contacts is never one, since elasticity couples both ways; a matrix
of the friction alone may be.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

import scipy.sparse as sp

from ..case import Case
from ..case.bodies import MatrixBody, MatrixTerm
from ..case.expression import parse_expression
from ..case.matrix_checks import MU
from ..errors import CaseError
from ..matrices.entries import couples_apart, lone
from ..matrices.model import StoredMatrix
from ..matrices.source import counted
from ..typing import Sparse

# Below these a stiffness may be a triangle by chance: [[k, mu*k], [0, k]].
_LEAST_FREEDOMS, _LEAST_ENTRIES = 3, 2
_MARKS = {
    ".mtx": 'say "symmetric" in place of "general" in its first line',
    ".gz": 'say "symmetric" in place of "general" in its first line',
    ".op4": "write it as form 6",
    ".pch": "write it as form 6",
    ".bdf": "write it as form 6",
    ".dmig": "write it as form 6",
    ".hb": "write it as RSA",
    ".rb": "write it as rsa",
    ".rua": "write it as RSA",
    ".matrix": "write it as RSA",
}


def half_doubts(
    case: Case, where: str, body: MatrixBody, stored: Sequence[StoredMatrix], matrices: Sequence[Sparse]
) -> tuple[str, ...]:
    """What is doubtful about the terms of a body, ``stored`` with their roles and on one order of freedoms
    ``matrices`` (n, n) each, a sentence for each file that may hold a half.

    Raises CaseError for a mass of which one half is there, and for a stiffness that no term completes.
    """
    said: list[str] = []
    for k, (term, found) in enumerate(zip(body.terms, stored, strict=True)):
        if found.lone is None:
            continue
        names = _names(case, term, where) if couples_apart(found.matrix) else ()
        apart = MU in names
        if found.role == "mass":
            if not apart and not _completed(stored, matrices):
                accepted = f"is a mass, and {_held(found)}; a mass is symmetric: {_mend(found)}"
                raise CaseError(f"{where}.terms.{k}.file", found.source, accepted)
        elif not (term.one_sided or found.declared):
            if found.role == "stiffness" and _is_all(found, stored, matrices):
                accepted = (
                    f"is the stiffness, and {_held(found)}: as it stands nothing would be coupled; {_mend(found)}. If "
                    "it is meant so, say one_sided = true in its term"
                )
                raise CaseError(f"{where}.terms.{k}.file", found.source, accepted)
            if found.role == "damping" or not (apart or (names and _few(found))):
                said.append(
                    f"{found.source}: {_held(found)}; if that is one half of a matrix, {_mend(found)}; if it is meant "
                    "so, say one_sided = true in its term"
                )
    return tuple(dict.fromkeys(said))


def _completed(stored: Sequence[StoredMatrix], matrices: Sequence[Sparse]) -> bool:
    """Whether terms together fill both sides of the mass."""
    return lone(_together(stored, matrices, "mass")) is None


def _is_all(found: StoredMatrix, stored: Sequence[StoredMatrix], matrices: Sequence[Sparse]) -> bool:
    """Whether a stiffness of which nothing has a counterpart is the whole one: no other term but those of friction,
    which take forces of some freedoms from others, couples anything back."""
    assert found.lone is not None, "asked for where it has some"
    if _few(found):
        return False
    if couples_apart(found.matrix):
        return False
    elastic = [(s, m) for s, m in zip(stored, matrices, strict=True) if s.lone is None or not couples_apart(s.matrix)]
    return lone(_together([s for s, _ in elastic], [m for _, m in elastic], "stiffness")) is not None


def _few(found: StoredMatrix) -> bool:
    """Whether so little of it is one-sided that it may be so by chance."""
    return found.matrix.shape[0] < _LEAST_FREEDOMS or sum(found.lone or ()) < _LEAST_ENTRIES


def _together(stored: Sequence[StoredMatrix], matrices: Sequence[Sparse], role: str) -> Sparse:
    """The places of all entries of a role."""
    total = sp.csr_array(matrices[0].shape)
    for found, matrix in zip(stored, matrices, strict=True):
        if found.role == role:
            total = sp.csr_array(total + abs(matrix))
    return total


def _names(case: Case, term: MatrixTerm, where: str) -> Collection[str]:
    """Numbers that the term's factor names: friction, or a parameter."""
    if not isinstance(term.factor, str):
        return ()
    return parse_expression(term.factor, (*case.parameters, MU), where).names


def _held(found: StoredMatrix) -> str:
    assert found.lone is not None, "asked for where it has some"
    below, above = found.lone
    if below and above:
        return f"none of its {below + above} entries off the diagonal has a counterpart across it"
    many = counted(below or above, "entry", "entries")
    return f"it holds {many} {'below' if below else 'above'} the diagonal and none {'above' if below else 'below'}"


def _mend(found: StoredMatrix) -> str:
    mark = _MARKS.get(Path(found.source).suffix.lower())
    if found.program is not None:
        mark = "say TYPE=SYMMETRIC in its *MATRIX INPUT line" if found.program == "Abaqus" else None
    return "give the whole matrix" + (f", or, if it is symmetric, {mark}" if mark else "")
