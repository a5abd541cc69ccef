"""Which sparse direct solvers are installed, and which one to use."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable, Iterator

from ..errors import CaseError
from ..typing import Sparse
from .interface import SLEPC_BUILD, Backend

VARIABLE = "STRIDOR_SOLVER"


# In the order they are tried: modules that have to be importable, and how to install them.
PACKAGES = {
    "mumps": (
        ("mumps",),
        'pip install "python-mumps>=0.0.4" (on Debian after apt install libmumps-seq-dev libopenblas-dev gfortran '
        "pkg-config; with conda: conda install -c conda-forge python-mumps)",
    ),
    "pardiso": (("pypardiso",), 'pip install "pypardiso>=0.4.6"'),
    "superlu": (("scipy",), "comes with SciPy"),
    "slepc": (("petsc4py", "mpi4py"), f'pip install "stridor[slepc]"; {SLEPC_BUILD}'),
}
# Taken only where it is asked for: it makes the processes of an MPI run one.
ON_REQUEST = ("slepc",)


def available() -> tuple[str, ...]:
    """Names of the solvers that are installed, the preferred one first; "superlu" is always among them.

    "slepc" never is, as it serves only those who ask for it.
    """
    return tuple(_preferred())


def _preferred() -> Iterator[str]:
    """One after the other: to look for a package that is not there takes long."""
    return (name for name in PACKAGES if name not in ON_REQUEST and installed(name))


def installed(name: str) -> bool:
    """Are the packages of a solver there?"""
    return all(importlib.util.find_spec(module) is not None for module in PACKAGES[name][0])


def choose(asked: str | None) -> str:
    """The solver to use: the one asked for, else that of the environment variable, else the first installed.

    Raises CaseError for a name that is unknown or not installed.
    """
    where = "solver" if asked is not None else f"environment variable {VARIABLE}"
    name = asked if asked is not None else os.environ.get(VARIABLE) or None
    if name is None:
        return next(_preferred())
    if name in PACKAGES and installed(name):
        return name
    present = tuple(known for known in PACKAGES if installed(known))
    if name not in PACKAGES:
        raise CaseError(where, name, f"no such solver; installed: {', '.join(present)}")
    raise CaseError(where, name, f"is not installed; {PACKAGES[name][1]}, or use one that is: {', '.join(present)}")


def join() -> None:
    """Make the processes of an MPI run one program: returns in the first; the others work for it, end with it.

    For scripts that use "slepc" and do more than computing: call it first. Otherwise the others go on until the first
    factorisation. Raises CaseError where "slepc" is not installed.
    """
    start(choose("slepc"))


def start(name: str) -> Callable[[Sparse, bool, bool], Backend]:
    """The function (matrix, symmetric, saddle) → Backend of a solver; its package is imported here, not before.

    Of the processes of an MPI run only the first returns with "slepc"; the others work for it until it ends, and end.
    Raises CaseError where the package is there but does not load.
    """
    try:
        if name == "mumps":
            from .mumps_backend import MumpsFactor

            return MumpsFactor
        if name == "pardiso":
            from .pardiso_backend import PardisoFactor

            return PardisoFactor
        if name == "slepc":
            from .slepc_backend import SlepcFactor, join

            join()
            return SlepcFactor
    except (ImportError, OSError) as error:
        raise CaseError("solver", name, f"is installed but does not load ({error}); {PACKAGES[name][1]}") from error
    from .superlu_backend import SuperluFactor

    return SuperluFactor
