"""Processes of this computer, each with one BLAS thread and a pipe of its own. Imports nothing that computes: who
starts them need not wait for that."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Generator
from functools import cache
from typing import Any

_one_at_a_time = threading.Lock()
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def spawned(target: Callable[..., object], name: str, *given: Any) -> tuple[Any, Any]:
    """A new process with one BLAS thread, ``target(pipe, *given)`` in it, and our end of the pipe."""
    return _started("spawn", target, name, given)


def forked(target: Callable[..., object], name: str, *given: Any, loaded: str) -> tuple[Any, Any]:
    """As `spawned`, on Linux off a process that has imported the module ``loaded``: each new one costs no imports.

    It lives as long as this process and what came off it. On other systems libraries do not stand being forked.
    """
    if sys.platform == "linux":
        try:
            with one_thread_each(), main_left_out(), _forked_off(_server(os.getpid(), loaded)):
                return _started("forkserver", _surrounded, name, (dict(os.environ), target, *given))
        except (EOFError, OSError):
            pass  # it was killed meanwhile
    return spawned(target, name, *given)


def prepared(loaded: str) -> None:
    """Begin what processes will be forked off, which imports ``loaded`` while this process goes on."""
    if sys.platform != "linux":
        return
    with contextlib.suppress(OSError), one_thread_each(), main_left_out(), _forked_off(_server(os.getpid(), loaded)):
        pass


def _surrounded(pipe: Any, environment: dict[str, str], target: Callable[..., object], *given: Any) -> None:
    """In the environment that there is now, not that of the time when the first process was forked."""
    os.environ.clear()
    os.environ.update(environment)
    target(pipe, *given)


def _started(method: str, target: Callable[..., object], name: str, given: tuple[Any, ...]) -> tuple[Any, Any]:
    context: Any = multiprocessing.get_context(method)
    ours, theirs = context.Pipe()
    try:
        process = context.Process(target=target, args=(theirs, *given), name=name, daemon=True)
        with one_thread_each(), main_left_out():
            process.start()
    finally:
        theirs.close()  # so that the pipe ends with the process
    return process, ours


@cache
def _server(process: int, loaded: str) -> Any:
    """The one that processes are forked off, of a process by its number: one that is forked itself has its own.

    It is not Python's own, which others may use and which would have our number of threads.
    """
    from multiprocessing.forkserver import ForkServer

    del process
    server: Any = ForkServer()
    server.set_forkserver_preload([loaded])
    return server


@contextlib.contextmanager
def _forked_off(server: Any) -> Generator[None]:
    """Let the method "forkserver" fork off this one. It hears no Ctrl-C, which is for the process that has it."""
    from multiprocessing import forkserver

    module: Any = forkserver
    path = {"PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path)), "PYTHONSAFEPATH": "1"}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        with _environment(path):  # it is to import what this process would
            server.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    with _one_at_a_time:  # what two threads take turns to put back would stay
        usual = module.connect_to_new_process
        module.connect_to_new_process = server.connect_to_new_process
        try:
            yield
        finally:
            module.connect_to_new_process = usual


def one_thread_each() -> contextlib.AbstractContextManager[None]:
    """Processes that start here compute with one thread: there are as many as cores."""
    return _environment(dict.fromkeys(THREADS, "1"))


@contextlib.contextmanager
def _environment(values: dict[str, str]) -> Generator[None]:
    """Processes that start here have these in their environment."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
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
