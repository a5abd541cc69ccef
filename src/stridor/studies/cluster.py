"""Workers of a Dask cluster: batches are its tasks, so that scheduling costs little beside the work.

Rows go back through the scheduler's client to the one process that writes the store. The case travels as text; files
that it names, and the reduced model, must be found under the same path by all workers.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import queue
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from ..errors import AnalysisError
from .rows import Row
from .task import SampleBatch, Task, answered, died, program

PATIENCE = 15.0  # seconds for a scheduler to answer, and without any worker until that is said
LOOK = 0.5  # seconds between looks at what came, at Ctrl-C and at whether anybody computes
AHEAD = 2  # batches that each worker is given at a time
TRIES = 3


class ClusterWorkers:
    """The workers that a scheduler has, those that join later too. A context. say is told where nobody computes any
    more. Raises AnalysisError where distributed is not installed, the scheduler does not answer, it has no workers, or
    one has another stridor."""

    def __init__(self, task: Task, address: str, say: Callable[[str], None] = lambda _: None) -> None:
        self.task, self.address, self.lost, self._say = task, address, 0, say
        self._distributed = _distributed()
        self._levels = _quiet()
        self._client: Any = None
        try:
            self._client = self._connected()
            self.count = self._checked()
        except BaseException:
            self._close()
            raise

    def _connected(self) -> Any:
        """Raises AnalysisError for a scheduler that does not answer."""
        try:
            with ThreadPoolExecutor(1) as apart:  # a notebook has a loop of its own running
                apart.submit(asyncio.run, _answering(self.address)).result()
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of versions, which are compared below
                return self._distributed.Client(self.address, timeout=PATIENCE, set_as_default=False)
        except Exception as error:  # of many kinds, by transport
            why = _first_line(error) if str(error) else "it takes the connection and says nothing"
            raise AnalysisError(
                f"the scheduler {self.address} does not answer within {PATIENCE:g} s ({why}): is it running, and can "
                "it be reached from here?"
            ) from None

    def _close(self) -> None:
        """Leave the cluster, which may not hear it any more."""
        if self._client is not None:
            with contextlib.suppress(Exception):
                self._client.close(timeout=2)
        for name, level in self._levels.items():
            logging.getLogger(name).setLevel(level)

    def _checked(self) -> int:
        """How many threads of workers there are. Raises AnalysisError for none, and for another stridor."""
        try:
            threads = sum(self._client.nthreads().values())
            others = self._client.run(_program, on_error="return") if threads else {}
        except Exception as error:  # of many kinds, by transport
            raise AnalysisError(f"the scheduler {self.address} is gone: {_first_line(error)}") from error
        if not threads:
            raise AnalysisError(f"the scheduler {self.address} has no workers: start some (dask worker {self.address})")
        own = program()
        for worker, other in others.items():
            if isinstance(other, OSError):
                continue  # it has just died; whoever comes in its place is asked with its first batch
            if isinstance(other, BaseException):
                raise AnalysisError(
                    f"worker {worker} cannot import stridor ({_first_line(other)}); install this version ({own}) on all"
                )
            if other != own:
                raise AnalysisError(
                    f"worker {worker} has another stridor ({other}) than this study ({own}); install the same "
                    "on all"
                )
        return threads

    @property
    def words(self) -> str:
        """Who computes, and where that can be watched."""
        workers = len(self._client.nthreads())
        link = f", dashboard {self._client.dashboard_link}" if self._client.dashboard_link else ""
        return f"{workers} worker{'' if workers == 1 else 's'} of {self.address}{link}"

    def __enter__(self) -> ClusterWorkers:
        return self

    def __exit__(self, *_: object) -> None:
        self._close()

    def answers(self, batches: Iterable[SampleBatch]) -> Iterator[dict[int, Row]]:
        """Rows as batches are done, and none of them every now and then, for who looks at Ctrl-C. Raises AnalysisError
        where a worker has another stridor, or the scheduler is gone."""
        waiting, again = iter(batches), deque[SampleBatch]()
        running: dict[Any, SampleBatch] = {}
        done, heard = queue.SimpleQueue[Any](), time.monotonic()
        while True:
            while len(running) < AHEAD * self.count:
                batch = again.popleft() if again else next(waiting, None)
                if batch is None:
                    break
                future = self._client.submit(_answered, self.task, batch, pure=False)
                running[future] = batch
                future.add_done_callback(done.put)
            if not running:
                return
            try:
                future = done.get(timeout=LOOK)
            except queue.Empty:
                if time.monotonic() - heard > PATIENCE:
                    heard = self._looked()
                yield {}
                continue
            heard = time.monotonic()
            yield self._taken(future, running.pop(future), again)

    def _looked(self) -> float:
        """Say so where nobody computes; returns when that was looked at."""
        ends = "Ctrl-C ends the study with what is done"
        try:
            known = self._client.sync(self._client.scheduler.ncores, callback_timeout=5)
        except Exception:  # whatever keeps it from answering
            self._say(f"warning: the scheduler {self.address} does not answer; rows wait for it ({ends})")
        else:
            if not known:
                self._say(
                    f"warning: the scheduler {self.address} has no workers any more; rows wait until some come ({ends})"
                )
        return time.monotonic()

    def _taken(self, future: Any, batch: SampleBatch, again: deque[SampleBatch]) -> dict[int, Row]:
        """The rows of a task; of one that kills its workers, or was lost, another try row by row."""
        try:
            return future.result()
        except AnalysisError:
            raise
        except Exception as error:
            if future.status == "error" and not isinstance(error, self._distributed.KilledWorker):
                raise AnalysisError(f"a task of the cluster failed: {_first_line(error)}") from error
            if self._client.status != "running":
                raise AnalysisError(f"the scheduler {self.address} is gone: {_first_line(error)}") from error
            self.lost += 1
            if len(batch.places) == 1 and batch.tries + 1 >= TRIES:
                return died(batch)
            again.extend(batch.alone())
            return {}


def _quiet() -> dict[str, int]:
    """Have the library log nothing: a scheduler that is gone is told by us, once. Returns the levels that were."""
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == "distributed"]
    levels = {name: logging.getLogger(name).level for name in names}
    for name in names:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    return levels


async def _answering(address: str) -> None:
    """Have a scheduler say who it is. Raises TimeoutError where it takes the connection and does not, as one does that
    was stopped: the library waits for that without end."""
    from distributed.core import rpc

    async def asked() -> None:
        async with rpc(address) as scheduler:
            await scheduler.identity(n_workers=0)

    await asyncio.wait_for(asked(), PATIENCE)


def _program() -> str:
    """That of a worker."""
    return program()


def _answered(task: Task, batch: SampleBatch) -> dict[int, Row]:
    return dict(answered(task, batch))


def _first_line(error: BaseException) -> str:
    lines = str(error).strip().splitlines()
    return lines[0][:200] if lines else type(error).__name__


def _distributed() -> Any:
    try:
        import distributed
    except ImportError as error:
        need = "--scheduler needs distributed, which is not installed: pip install 'stridor[cluster]'"
        raise AnalysisError(need) from error
    return distributed
