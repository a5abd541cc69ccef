"""How many threads the dense linear algebra may use."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager

SMALL = 3000


@contextmanager
def calm(size: int) -> Generator[None, None, None]:
    """One BLAS thread while matrices are small.

    At some hundreds of freedoms a second thread wins nothing, and where other work shares the cores its
    busy waiting makes an analysis ten times slower (29 s against 283 s for the shipped case, measured with
    four other processes on two cores).
    """
    if size > SMALL:
        yield
        return
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1, user_api="blas"):
        yield
