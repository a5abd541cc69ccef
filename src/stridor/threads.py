"""How many threads the dense linear algebra may use: one.

Dense problems here have some hundred unknowns, and a second BLAS thread waits busily more than it works: modes of a pad
on a disc with 13 845 freedoms took 93 s of CPU and 74 s by the clock with two threads on two cores, 50 and 55 s with
one; beside other work the clock said 155 s instead of 54. Whole machines are filled by running cases side by side.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import cache, wraps
from importlib import import_module
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

OURS = ("numpy", "scipy")
MANY = 150_000  # unknowns from which on the dense parts of a sparse factor are worth several threads


def one_thread(call: Callable[P, R]) -> Callable[P, R]:
    """Let an analysis use one BLAS thread. Sparse direct solvers that bring a BLAS of their own: `for_factor`."""

    @wraps(call)
    def calm(*args: P.args, **kwargs: P.kwargs) -> R:
        with limited():
            return call(*args, **kwargs)

    return calm


def limited() -> AbstractContextManager[Any]:
    """As long as it is open what `one_thread` does: for a whole command."""
    return _libraries().limit(limits=1, user_api="blas")


def for_factor(unknowns: int) -> AbstractContextManager[Any]:
    """What a direct solver that takes the BLAS of the machine may use while it eliminates or solves: one thread up to
    `MANY` unknowns, then what the machine has or OPENBLAS_NUM_THREADS says."""
    return nullcontext() if unknowns > MANY else _every_library().limit(limits=1, user_api="blas")


@cache
def _every_library() -> Any:
    """As `_libraries`, with that of the solver, which is loaded by then."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


@cache
def _libraries() -> Any:
    """The libraries loaded, looked for once: that takes longer than a small eigenproblem."""
    from threadpoolctl import ThreadpoolController

    import_module("scipy.linalg")  # brings a BLAS of its own
    found = ThreadpoolController()
    paths = [library["filepath"] for library in found.info()]
    ours = [path for path in paths if any(name in path for name in OURS)]
    # Where all share one library, as in a conda environment, there is nothing to tell apart.
    return found.select(filepath=ours) if ours else found


def available_cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
