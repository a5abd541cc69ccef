"""Processes of this computer, each with one BLAS thread and a pipe of its own. Imports nothing that computes: who
starts them need not wait for that."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import sys
from collections.abc import Callable, Generator
from typing import Any

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def spawned(target: Callable[..., object], name: str, *given: Any) -> tuple[Any, Any]:
    """A new process with one BLAS thread, ``target(pipe, *given)`` in it, and our end of the pipe."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=target, args=(theirs, *given), name=name, daemon=True)
    with one_thread_each(), main_left_out():
        process.start()
    theirs.close()  # so that the pipe ends with the process
    return process, ours


@contextlib.contextmanager
def one_thread_each() -> Generator[None]:
    """Processes that start here compute with one thread: there are as many as cores."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextlib.contextmanager
def main_left_out() -> Generator[None]:
    """Processes that start here do not import the script that starts them, which would start a study again where it
    lacks ``if __name__ == "__main__"``; nothing of it is needed."""
    main = sys.modules["__main__"].__dict__
    before = {name: main[name] for name in ("__file__", "__spec__") if name in main}
    main.pop("__file__", None)
    main["__spec__"] = None
    try:
        yield
    finally:
        main.update(before)
