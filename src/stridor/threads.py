"""How many threads the dense linear algebra may use: one.

Dense problems here have some hundred unknowns, and a second BLAS thread waits busily more than it works: modes of a pad
on a disc with 13 845 freedoms took 93 s of CPU and 74 s by the clock with two threads on two cores, 50 and 55 s with
one; beside other work the clock said 155 s instead of 54. Whole machines are filled by running cases side by side.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, wraps
from importlib import import_module
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

OURS = ("numpy", "scipy")


def one_thread(call: Callable[P, R]) -> Callable[P, R]:
    """Let an analysis use one BLAS thread. Sparse direct solvers that bring a BLAS of their own keep theirs."""

    @wraps(call)
    def calm(*args: P.args, **kwargs: P.kwargs) -> R:
        with _libraries().limit(limits=1, user_api="blas"):
            return call(*args, **kwargs)

    return calm


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
