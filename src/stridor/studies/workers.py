"""Worker processes of this computer, each with one BLAS thread and a pipe of its own.

A pool of `concurrent.futures` is lost as a whole with one of its processes and does not say which task it was at. Here
each worker tells its rows as they are done, so that of a worker that dies only the row that it was at is computed
again, by itself, and a row that kills worker after worker is one that failed.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from typing import Any

from ..errors import AnalysisError
from .processes import forked
from .rows import Row
from .task import SampleBatch, Task, answered, died

TRIES = 3  # of a row by itself, at which a worker dies
EVERY = 0.25  # seconds between the results that a worker sends
LOADED = __name__.rpartition(".")[0] + ".loaded"  # what workers need, imported once for all of them
PATIENCE = 5.0  # seconds that a worker has to end


Answer = Callable[[Task, SampleBatch], Iterator[tuple[int, Row]]]


@dataclass
class _Worker:
    process: Any
    pipe: Any  # a Connection, or on Windows a PipeConnection
    batch: SampleBatch | None = None
    done: dict[int, Row] = field(default_factory=dict[int, Row])


class LocalWorkers:
    """Processes that answer batches. Use as a context; they end with it, and with the process that has them."""

    def __init__(self, task: Task, count: int, answer: Answer = answered) -> None:
        self.task, self.count, self.answer = task, count, answer
        self.lost = 0
        self._workers: list[_Worker] = []

    @property
    def words(self) -> str:
        """Who computes."""
        return f"{self.count} worker process{'' if self.count == 1 else 'es'} of this computer"

    def __enter__(self) -> LocalWorkers:
        return self

    def __exit__(self, *_: object) -> None:
        for worker in self._workers:
            with contextlib.suppress(OSError):
                worker.pipe.close()
        until = time.monotonic() + PATIENCE
        for worker in self._workers:
            worker.process.join(0.1)
        for worker in self._workers:
            if worker.process.is_alive():
                worker.process.terminate()
        for worker in self._workers:
            worker.process.join(max(until - time.monotonic(), 0.1))
            if worker.process.is_alive():
                worker.process.kill()
        self._workers = []

    def answers(self, batches: Iterable[SampleBatch]) -> Iterator[dict[int, Row]]:
        """Rows as they are done, of batches that are taken one by one. Raises AnalysisError where a worker cannot do
        any of it."""
        waiting, again = iter(batches), deque[SampleBatch]()
        while True:
            self._hand_out(waiting, again)
            busy = [w for w in self._workers if w.batch is not None]
            if not busy:
                return
            for pipe in wait([w.pipe for w in busy], timeout=1.0):
                worker = next(w for w in busy if w.pipe is pipe)
                rows = self._received(worker, again)
                if rows:
                    yield rows

    def _hand_out(self, waiting: Iterator[SampleBatch], again: deque[SampleBatch]) -> None:
        """Give every worker that has nothing to do a batch; start workers while there is work."""
        while True:
            idle = next((w for w in self._workers if w.batch is None), None)
            if idle is None and len(self._workers) >= self.count:
                return
            batch = again.popleft() if again else next(waiting, None)
            if batch is None:
                return
            worker = idle or self._started()
            worker.batch, worker.done = batch, {}
            with contextlib.suppress(OSError):  # who has died meanwhile is noticed when it is listened to
                worker.pipe.send(batch)

    def _received(self, worker: _Worker, again: deque[SampleBatch]) -> dict[int, Row]:
        """What a worker says: rows, that a batch is done, or nothing more at all."""
        batch = worker.batch
        assert batch is not None, "only those with a batch are listened to"
        try:
            kind, content = worker.pipe.recv()
        except (EOFError, OSError):
            return self._buried(worker, batch, again)
        if kind == "error":
            raise AnalysisError(content)
        if kind == "done":
            worker.batch = None
        worker.done.update(content)
        return content

    def _buried(self, worker: _Worker, batch: SampleBatch, again: deque[SampleBatch]) -> dict[int, Row]:
        """What is done about a worker that died: another try of what it had not answered, row by row."""
        self.lost += 1
        self._workers.remove(worker)
        worker.process.join(PATIENCE)
        left = batch.without(worker.done)
        if len(batch.places) == 1 and batch.tries + 1 >= TRIES:
            return died(batch)
        again.extend(left.alone())
        return {}

    def _started(self) -> _Worker:
        worker = _Worker(*forked(_work, "stridor study", self.task, self.answer, loaded=LOADED))
        self._workers.append(worker)
        return worker


def _work(pipe: Any, task: Task, answer: Answer) -> None:
    """What a worker does until its pipe ends, as it does with the process that has it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that has the workers
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with contextlib.suppress(EOFError, OSError):
        while True:
            batch = pipe.recv()
            rows: dict[int, Row] = {}
            last = time.monotonic()
            try:
                for number, row in answer(task, batch):
                    rows[number] = row
                    if time.monotonic() - last > EVERY:
                        pipe.send(("rows", rows))
                        rows, last = {}, time.monotonic()
            except AnalysisError as error:
                pipe.send(("error", str(error)))
                return
            pipe.send(("done", rows))


def _end_with_parent() -> None:
    """A row may take hours: it is not gone on with for a process that was killed."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
