"""Workers of a Dask cluster: batches are its tasks, so that scheduling costs little beside the work.

Rows go back through the scheduler's client to the one process that writes the store. The case travels as text; files
that it names, and the reduced model, must be found under the same path by all workers.
"""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Iterable, Iterator
from typing import Any

from ..errors import AnalysisError
from .rows import Row
from .task import SampleBatch, Task, answered, died, program

PATIENCE = 15.0  # seconds for a scheduler to answer
AHEAD = 2  # batches that each worker is given at a time
TRIES = 3


class ClusterWorkers:
    """The workers that a scheduler has, those that join later too. A context. Raises AnalysisError where distributed is
    not installed, the scheduler does not answer, it has no workers, or one has another stridor."""

    def __init__(self, task: Task, address: str) -> None:
        self.task, self.address, self.lost = task, address, 0
        self._distributed = _distributed()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of versions, which are compared below
                self._client = self._distributed.Client(address, timeout=PATIENCE, set_as_default=False)
        except Exception as error:  # of many kinds, by transport
            raise AnalysisError(
                f"the scheduler {address} does not answer within {PATIENCE:g} s ({_first_line(error)}): is it running, "
                "and can it be reached from here?"
            ) from None
        try:
            self.count = self._checked()
        except BaseException:
            self._client.close()
            raise

    def _checked(self) -> int:
        """How many threads of workers there are. Raises AnalysisError for none, and for another stridor."""
        threads = sum(self._client.nthreads().values())
        if not threads:
            raise AnalysisError(f"the scheduler {self.address} has no workers: start some (dask worker {self.address})")
        own = program()
        for worker, other in self._client.run(_program, on_error="return").items():
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
        self._client.close()

    def answers(self, batches: Iterable[SampleBatch]) -> Iterator[dict[int, Row]]:
        """Rows as batches are done. Raises AnalysisError where a worker has another stridor, or the scheduler is
        gone."""
        waiting, again = iter(batches), deque[SampleBatch]()
        running: dict[Any, SampleBatch] = {}
        done = self._distributed.as_completed(loop=self._client.loop)
        while True:
            while len(running) < AHEAD * self.count:
                batch = again.popleft() if again else next(waiting, None)
                if batch is None:
                    break
                future = self._client.submit(_answered, self.task, batch, pure=False)
                running[future] = batch
                done.add(future)
            if not running:
                return
            future = next(done)
            yield self._taken(future, running.pop(future), again)

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
