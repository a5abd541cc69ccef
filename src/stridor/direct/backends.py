"""Which sparse direct solvers are installed, and which one to use."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable
from typing import Any, Protocol

from ..errors import CaseError
from ..typing import Sparse

VARIABLE = "STRIDOR_SOLVER"


class Backend(Protocol):
    """A factorised matrix of n rows as one of the programs keeps it."""

    memory_bytes: int
    inertia: int | None

    def solve(self, right: Any, transpose: bool) -> Any:
        """One unrefined solve of right (n, r), of the matrix's own type; may overwrite it."""
        ...

    def free(self) -> None:
        """Give the memory of the factors back."""
        ...


class Breakdown(Exception):
    """A program found a pivot of zero."""


# In the order they are tried: module that has to be importable, and how to install it.
PACKAGES = {
    "mumps": (
        "mumps",
        'pip install "stridor[mumps]" (on Debian after apt install libmumps-seq-dev gfortran pkg-config)',
    ),
    "pardiso": ("pypardiso", 'pip install "stridor[pardiso]"'),
    "superlu": ("scipy", "comes with SciPy"),
}


def available() -> tuple[str, ...]:
    """Names of the solvers that are installed, the preferred one first; "superlu" is always among them."""
    return tuple(name for name, (module, _) in PACKAGES.items() if importlib.util.find_spec(module) is not None)


def choose(asked: str | None) -> str:
    """The solver to use: the one asked for, else that of the environment variable, else the first installed.

    Raises CaseError for a name that is unknown or not installed.
    """
    where = "solver" if asked is not None else f"environment variable {VARIABLE}"
    name = asked if asked is not None else os.environ.get(VARIABLE) or None
    installed = available()
    if name is None:
        return installed[0]
    if name not in PACKAGES:
        raise CaseError(where, name, f"no such solver; installed: {', '.join(installed)}")
    if name not in installed:
        raise CaseError(
            where, name, f"is not installed; {PACKAGES[name][1]}, or use one that is: {', '.join(installed)}"
        )
    return name


def start(name: str) -> Callable[[Sparse, bool, bool], Backend]:
    """The function (matrix, symmetric, saddle) → Backend of a solver; its package is imported here, not before.

    Raises CaseError where the package is there but does not load.
    """
    try:
        if name == "mumps":
            from .mumps_backend import MumpsFactor

            return MumpsFactor
        if name == "pardiso":
            from .pardiso_backend import PardisoFactor

            return PardisoFactor
    except (ImportError, OSError) as error:
        raise CaseError("solver", name, f"is installed but does not load ({error}); {PACKAGES[name][1]}") from error
    from .superlu_backend import SuperluFactor

    return SuperluFactor
