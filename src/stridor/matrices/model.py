"""A matrix as a file holds it: numbers, what the file says of its freedoms, and what was noticed in reading."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..typing import IntArray, Sparse

Role = Literal["mass", "damping", "stiffness"]


@dataclass(frozen=True)
class Labels:
    """What the freedoms (n,) are called: node (n,) as the other program numbers it, negative for internal freedoms;
    direction (n,) 1 to 6 for translations and rotations, 0 for scalar and internal freedoms."""

    node: IntArray
    direction: IntArray


@dataclass(frozen=True)
class StoredMatrix:
    """A square real matrix (n, n) csr from the file ``source``.

    labels: names of the freedoms, None where the file gives none. role and form: what the file itself says, None where
    it says nothing; a matrix stored as "symmetric" has been completed from its half. name: that of the matrix in the
    file. notes: what the user should know, one sentence each; those that are a `Doubt` may have changed numbers.
    program: "Abaqus" or "CalculiX" where only that program writes such a file. declared: whether the file says in so
    many words that the matrix is not symmetric, as other formats do of whatever they hold. lone: how many entries are
    below and above the diagonal where none of them has a counterpart across it, as of a half; None where some have.
    certain: whether the role is what the program itself calls the matrix, not only read from a first letter. unsaid:
    why a matrix without a role has none, where its name says what it is, and which role to give.
    """

    matrix: Sparse
    source: str
    labels: Labels | None = None
    role: Role | None = None
    form: Literal["symmetric", "general"] | None = None
    name: str | None = None
    notes: tuple[str, ...] = ()
    program: Literal["Abaqus", "CalculiX"] | None = None
    declared: bool = False
    lone: tuple[int, int] | None = None
    certain: bool = True
    unsaid: str = ""
