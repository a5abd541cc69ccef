"""The processes of one MPI run: the first runs the program, the others hold their rows of its large matrices.

What all have to do together the first one orders by a few whole numbers, then sends what belongs to it. The others wait
for orders asleep: MPI's own calls would keep a core busy with waiting.
"""

from __future__ import annotations

import signal
import sys
import time
import traceback
from collections.abc import Generator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import numpy as np

from ..typing import IntArray

ORDER, DATA = 1, 2  # tags of messages
LENGTH = 6  # whole numbers in an order
# Counts of a message are 32-bit numbers for MPI; this many entries of any type stay far below that in bytes, too.
CHUNK = 1 << 26
# A process that waits looks for orders after a twentieth of the time that it has waited, but not more rarely than this.
LONGEST_SLEEP = 5e-3


class Ranks:
    """All processes of a communicator of mpi4py; number tells which one this is, the first has 0."""

    def __init__(self, communicator: Any) -> None:
        self._communicator = communicator
        self.number = int(communicator.Get_rank())
        self.size = int(communicator.Get_size())

    def bounds(self, rows: int) -> IntArray:
        """First row of each process's share of a matrix, and the number of rows at the end (size + 1,)."""
        return np.arange(self.size + 1, dtype=np.int64) * rows // self.size

    def order(self, *numbers: int) -> None:
        """Tell all others what to do next; only the first process gives orders."""
        message = np.zeros(LENGTH, dtype=np.int64)
        message[: len(numbers)] = numbers
        for other in range(1, self.size):
            self._communicator.Send(message, dest=other, tag=ORDER)

    def next_order(self) -> list[int]:
        """Wait, asleep, for the next order."""
        began = time.monotonic()
        while not self._communicator.Iprobe(source=0, tag=ORDER):
            time.sleep(min(LONGEST_SLEEP, 2e-5 + 0.05 * (time.monotonic() - began)))
        message = np.empty(LENGTH, dtype=np.int64)
        self._communicator.Recv(message, source=0, tag=ORDER)
        return [int(number) for number in message]

    def send(self, array: Any, to: int) -> None:
        """Send an array, of whatever length, to the process that calls `receive` with its size and type."""
        flat = np.ascontiguousarray(array).reshape(-1)
        for first in range(0, len(flat), CHUNK):
            self._communicator.Send(flat[first : first + CHUNK], dest=to, tag=DATA)

    def receive(self, shape: tuple[int, ...], kind: Any, source: int = 0) -> Any:
        """The array that another process sends."""
        array = np.empty(shape, dtype=kind)
        flat = array.reshape(-1)
        for first in range(0, len(flat), CHUNK):
            self._communicator.Recv(flat[first : first + CHUNK], source=source, tag=DATA)
        return array

    def alike(self, words: object) -> bool:
        """Do all processes have the same words? To be asked in all of them."""
        return all(other == words for other in self._communicator.allgather(words))

    def abort(self, error: BaseException) -> None:
        """Say what failed here, then end all processes: the others wait for this one and cannot know."""
        traceback.print_exception(error)
        who = f" in process {self.number} of {self.size}" if self.size > 1 else ""
        print(f"stridor: the sparse solver failed{who}: {error or type(error).__name__}", file=sys.stderr, flush=True)
        self._communicator.Abort(1)


def deaf_to_interrupts() -> None:
    """Leave Ctrl-C to the first process, which tells the others what follows from it."""
    try:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    except ValueError:  # another thread than the main one, which interrupts do not reach
        return


@contextmanager
def undisturbed() -> Generator[None, None, None]:
    """Let Ctrl-C wait until what the processes do together is done: half of it would leave the others waiting."""
    arrived: list[tuple[int, Any]] = []
    before: Any = signal.getsignal(signal.SIGINT)
    try:
        if before is not None:  # set outside Python, it could not be put back
            signal.signal(signal.SIGINT, lambda number, frame: arrived.append((number, frame)))
    except ValueError:  # another thread than the main one
        before = None
    try:
        yield
    finally:
        if before is not None:
            signal.signal(signal.SIGINT, before)
    if arrived and callable(before):
        before(*arrived[0])


def all_processes() -> Any:
    """MPI's communicator of all processes of this run, alone without mpiexec. Raises ImportError."""
    try:
        return import_module("mpi4py.MPI").COMM_WORLD
    except RuntimeError as error:  # mpi4py finds no MPI library
        raise ImportError(str(error)) from error


def only_this() -> Any:
    """MPI's communicator of this process alone."""
    return import_module("mpi4py.MPI").COMM_SELF
