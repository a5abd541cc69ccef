"""How many threads the dense linear algebra may use."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, wraps
from importlib import import_module
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar

SMALL = 3000

P = ParamSpec("P")
R = TypeVar("R")


class Sized(Protocol):
    """Anything with a number of freedoms."""

    @property
    def size(self) -> int:
        """Number of freedoms."""
        ...


S = TypeVar("S", bound=Sized)


def one_thread_if_small(call: Callable[Concatenate[S, P], R]) -> Callable[Concatenate[S, P], R]:
    """Let an analysis of a small system use one BLAS thread.

    At some hundreds of freedoms a second thread wins nothing, and where other work shares the cores its
    busy waiting makes an analysis many times slower: all analyses of the shipped case took 283 s instead
    of 29 s beside four other processes on two cores.
    """

    @wraps(call)
    def calm(system: S, /, *args: P.args, **kwargs: P.kwargs) -> R:
        if system.size > SMALL:
            return call(system, *args, **kwargs)
        with _libraries().limit(limits=1, user_api="blas"):
            return call(system, *args, **kwargs)

    return calm


def one_thread(call: Callable[P, R]) -> Callable[P, R]:
    """Let a call whose dense matrices are small, whatever the system's size, use one BLAS thread.

    Eigenproblems of some hundred unknowns took 0.20 s instead of 0.025 s with two threads beside other work.
    """

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
    return ThreadpoolController()
