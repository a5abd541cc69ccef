"""What a worker is given: everything that rows are computed from, and which rows."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache

from ..case import Case, loads
from ..errors import AnalysisError
from ..study.case_key import sources_key
from ..study.provenance import versions
from ..threads import one_thread
from .reduced_rows import FrictionModels
from .rows import Row, failed, full_row
from .tables import Compute, Keep


@dataclass(frozen=True)
class Task:
    """A case as TOML, what is computed of each sample, and the folder of reduced models ("" none). program: of the
    stridor that asks."""

    case: str
    compute: Compute
    names: tuple[str, ...]
    keep: Keep
    model: str = ""
    program: str = ""

    def checked(self) -> None:
        """Raises AnalysisError in a process that has another stridor than the one that asks."""
        own = program()
        if self.program and self.program != own:
            raise AnalysisError(
                f"a worker has another stridor ({own}) than this study ({self.program}); install the same on all"
            )


@dataclass(frozen=True)
class SampleBatch:
    """Places of rows in the store, the values (k, p) of each, and which of them are solved in full as well. tries: how
    often a worker has died at it."""

    places: tuple[int, ...]
    values: tuple[tuple[float, ...], ...]
    confirm: tuple[bool, ...]
    tries: int = 0

    def alone(self) -> Iterator[SampleBatch]:
        """Each row by itself, tried once more."""
        for number, values, confirm in zip(self.places, self.values, self.confirm, strict=True):
            yield SampleBatch((number,), (values,), (confirm,), self.tries + 1)

    def without(self, done: Mapping[int, Row]) -> SampleBatch:
        """What is left of it."""
        left = [k for k, number in enumerate(self.places) if number not in done]
        return SampleBatch(
            tuple(self.places[k] for k in left),
            tuple(self.values[k] for k in left),
            tuple(self.confirm[k] for k in left),
            self.tries,
        )


def program() -> str:
    """Version and sources of the stridor that runs."""
    return f"{versions()['stridor']} {sources_key()[:12]}"


def answered(task: Task, batch: SampleBatch) -> Iterator[tuple[int, Row]]:
    """The rows of a batch, one after the other. Raises AnalysisError where the worker has another stridor."""
    task.checked()
    case = _case(task.case)
    reduced = None if not task.model else _reduced(task.model, task.case)
    for number, values, confirm in zip(batch.places, batch.values, batch.confirm, strict=True):
        yield number, _row(task, case, reduced, dict(zip(task.names, values, strict=True)), confirm=confirm)


@one_thread
def _row(task: Task, case: Case, reduced: FrictionModels | None, values: Mapping[str, float], *, confirm: bool) -> Row:
    if reduced is None:
        return full_row(case, task.compute, values, task.keep)
    started = time.perf_counter()
    row = reduced.row(values, task.keep)
    if row is None:
        return reduced.outside(full_row(case, task.compute, values, task.keep))
    row["seconds"] = time.perf_counter() - started
    if confirm or reduced.doubtful(row):
        full = full_row(case, task.compute, values, task.keep)
        return reduced.confirmed(row, full)
    return row


def died(batch: SampleBatch) -> dict[int, Row]:
    """Rows at which worker after worker died."""
    why = f"the worker process died {batch.tries + 1} times at this row: out of memory, or killed"
    return {number: failed(why) for number in batch.places}


@lru_cache(4)
def _case(text: str) -> Case:
    return loads(text)


@lru_cache(2)
def _reduced(path: str, case: str) -> FrictionModels:
    return FrictionModels.read(path, _case(case))
