"""What every sparse direct solver offers, and how it says that it cannot."""

from __future__ import annotations

from typing import Any, Protocol


class Backend(Protocol):
    """A factorised matrix of n rows as one of the programs keeps it."""

    memory_bytes: int

    @property
    def inertia(self) -> int | None:
        """Number of negative pivots of a real symmetric matrix; None where it is not told."""
        ...

    def solve(self, right: Any, transpose: bool) -> Any:
        """One unrefined solve of right (n, r), of the matrix's own type; may overwrite it."""
        ...

    def free(self) -> None:
        """Give the memory of the factors back."""
        ...


class Breakdown(Exception):
    """A program found a pivot of zero."""


SLEPC_BUILD = (
    "PETSc must be built with complex numbers, double precision and MUMPS (on Debian: apt install "
    "libpetsc-complex-dev libslepc-complex-dev; then set PETSC_DIR and SLEPC_DIR to theirs and install petsc4py and "
    "slepc4py of the same version)"
)
