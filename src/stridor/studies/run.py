"""From a study to its store: samples, who answers them, rows written as they come."""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ..asking import FUNCTION, PATH, SWITCH, TEXT, WHOLE, takes
from ..case import Case
from ..case.units import unit_at
from ..errors import AnalysisError, CaseError, kind_of
from ..interrupts import held
from ..io.claims import claimed
from ..notebook import counted
from ..stages import stage
from ..study.case_key import files_of
from ..study.fingerprint import contents
from ..study.provenance import provenance
from ..threads import available_cores
from ..typing import Array, IntArray
from . import reduced_rows
from .checks import negative_friction
from .effect import without_effect
from .parts import Part
from .result import StudyResult, open_study
from .rows import Row, full_row, lengths, variables
from .sampling import samples
from .schema import Study
from .store import DONE, FAILED, PENDING, Head, OpenStore
from .task import SampleBatch, Task, program
from .uncertainty import Probability, missing_samples, probability
from .workers import LocalWorkers

NAME = "study.zarr"
SECONDS = 1.0  # of work in a batch, and between two writings
MANY = 100  # workers, from which on batches grow with their number
LARGEST = 10_000  # rows of a batch

Progress = Callable[[int, int], None]


class Workers(Protocol):
    """Who answers batches of rows: `LocalWorkers`, `ClusterWorkers`. A context."""

    count: int
    lost: int

    @property
    def words(self) -> str: ...
    def __enter__(self) -> Workers: ...
    def __exit__(self, *_: object) -> None: ...
    def answers(self, batches: Iterator[SampleBatch]) -> Iterator[dict[int, Row]]: ...


@takes(
    folder=PATH.or_none(), workers=WHOLE.or_none(), scheduler=TEXT.or_none(), go_on=SWITCH, progress=FUNCTION,
    say=FUNCTION,
)  # fmt: skip
def run_study(
    study: Study | str | PathLike[str],
    folder: str | Path | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    part: Part | None = None,
    go_on: bool = False,
    progress: Progress | None = None,
    say: Callable[[str], None] | None = None,
) -> StudyResult:
    """Compute what is missing of a study, or of the one in a file, in a folder (default: FILE.out), in which
    ``study.zarr`` has a row for each sample.

    workers: processes of this computer (default: one for each core); scheduler: the address of a Dask scheduler
    ("tcp://host:port") instead. part: only these samples, in a folder of their own. go_on: also with a store that
    another version of stridor has begun. progress is called with rows done and of all, say with what is to be known.

    Ctrl-C ends it with what is done (`StudyResult.interrupted`); the same call goes on from there, as it does after the
    process was killed. Raises CaseError for the store of another study and where another process is at it,
    AnalysisError where the store cannot be written, a scheduler does not answer or a worker has another stridor.
    """
    if not isinstance(study, Study):
        if not isinstance(study, str | PathLike):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise CaseError("study", kind_of(study), "a study, or the path of its file")
        folder = Path(study).with_suffix(".out") if folder is None else folder
        study = Study.load(study)
    if folder is None:
        raise CaseError("folder", None, "missing – give the folder that the study's store is to lie in")
    location = Path(folder) if part is None else Path(folder) / part.folder
    with claimed(location):
        return _Run(study, location, part, go_on, progress, say or (lambda _: None)).all(workers, scheduler)


@dataclass
class _Run:
    study: Study
    folder: Path
    part: Part | None
    go_on: bool
    progress: Progress | None
    say: Callable[[str], None]
    rows: dict[int, Row] = field(default_factory=dict[int, Row])
    rate: float = 0.0  # seconds of a row
    interrupted: bool = False

    def all(self, workers: int | None, scheduler: str | None) -> StudyResult:
        """Open or make the store, answer what is missing, and more where the goal asks for it."""
        started = time.perf_counter()
        stage("samples of the study")
        case = self.study.base()
        store = self._store(case)
        if self.study.goal is not None and self.part is not None:
            self.say(f"warning: {NO_GOAL}")
        for line in store.told("without_effect") or ():
            self.say(f"warning: {line}")
        if not self._open_rows(store.status).size and not self._more(store):
            self.say("all rows are there")
        task = self._task(case, store) if self._open_rows(store.status).size else None
        while task is not None:
            with _workers(task, workers, scheduler, self.say) as who:
                self.say(f"{who.words}")
                self._answer(store, who)
            store.note(lost_workers=(store.told("lost_workers") or 0) + who.lost)
            if self.interrupted or not self._more(store):
                break
        store.note(seconds=(store.told("seconds") or 0.0) + time.perf_counter() - started)
        return open_study(store.path, interrupted=self.interrupted)

    # -- the store ---------------------------------------------------------------------------------------------------
    def _store(self, case: Case) -> OpenStore:
        path = self.folder / NAME
        columns = variables(self.study.compute)
        digest = digest_of(self.study, case)
        if path.exists():
            store = OpenStore.opened(path, columns)
            self._check(store, digest)
            if added := store.complete():
                computed = int(np.count_nonzero(store.status == DONE))
                line = f"{', '.join(added)}: not known of {counted(computed, 'row')} of an earlier stridor (NaN)"
                store.note(completed=[*(store.told("completed") or ()), line])
                self.say(f"warning: {line}")
            return store
        if problems := negative_friction(self.study):
            raise CaseError.many(problems)
        values = samples(self.study)
        numbers = np.arange(len(values)) if self.part is None else self.part.numbers(len(values))
        made = provenance(case, "study", 0.0) | {"programs": [program()]}
        head = Head(self.study.document(), digest, made, "" if self.part is None else str(self.part))
        parameters = {name: unit_at(case, name) for name in self.study.parameters}
        store = OpenStore.made(
            path, head, values[numbers], parameters, columns, lengths(self.study.compute, self.study.keep),
            numbers=numbers,
        )  # fmt: skip
        store.note(without_effect=without_effect(self.study, case, values))
        return store

    def _check(self, store: OpenStore, digest: str) -> None:
        """Raises CaseError where the store is not one of this study and this program."""
        head = store.head
        if head.part != ("" if self.part is None else str(self.part)):
            raise CaseError(str(store.path), None, f"holds part {head.part or 'all'} of the study; name another folder")
        if head.digest != digest:
            raise CaseError(str(store.path), None, f"is of another study: {_differences(head.study, self.study)}")
        programs = store.told("programs") or head.provenance.get("programs", [])
        if program() not in programs:
            if not self.go_on:
                raise CaseError(
                    str(store.path), None,
                    f"was begun by another stridor ({', '.join(programs)}; this is {program()}), which may give other "
                    "numbers: remove the store, name another folder (--out), or go on all the same (--go-on)",
                )  # fmt: skip
            store.note(programs=[*programs, program()])

    def _open_rows(self, status: IntArray) -> IntArray:
        """Places of the rows that are to be computed."""
        return np.flatnonzero((status == PENDING) | ((status == FAILED) & self.study.restart_failed))

    # -- who answers -------------------------------------------------------------------------------------------------
    def _task(self, case: Case, store: OpenStore) -> Task:
        """The full problem, or a reduced model where there is one that agrees with it."""
        plain = Task(case.to_toml(), self.study.compute, tuple(self.study.parameters), self.study.keep, "", program())
        path = (self.folder / f"reduced-{self.study.compute}").resolve()
        answers = store.told("answers")
        if answers is None:
            why = self._reduced(case, store, path)
            models = 0 if why else len(list(path.glob("*.npz")))
            answers = {"source": "full" if why else "reduced", "why": why, "models": models}
            store.note(answers=answers)
        if answers["source"] == "full":
            self.say(f"every sample is solved in full: {answers['why']}")
            return plain
        if len(list(path.glob("*.npz"))) != answers["models"]:
            reduced_rows.made(self.study, case, self._whole(store), path)
        self.say("samples are answered by a reduced model; a share of them is solved in full as well")
        return Task(plain.case, plain.compute, plain.names, plain.keep, str(path), plain.program)

    def _whole(self, store: OpenStore) -> Array:
        """All samples of the study, of a part those of the others, too: models are over the same ranges in each."""
        return store.samples if self.part is None else samples(self.study)

    def _reduced(self, case: Case, store: OpenStore, path: Path) -> str:
        """Make a reduced model and prove it on some samples; why there is none, "" where there is."""
        if why := reduced_rows.unfit(self.study, case, len(store.status)):
            return why
        values = self._whole(store)
        asked = self.study.answers.source == "reduced"
        stage("reduced model over all samples")
        try:
            model = reduced_rows.made(self.study, case, values, path)
            why = self._proved(case, values, model)
        except (CaseError, AnalysisError) as error:
            told = reduced_rows.in_words_of(self.study, case, error) if isinstance(error, CaseError) else error
            if asked:
                raise told from error
            return f"there is no reduced model: {told}"
        if why and asked:
            raise AnalysisError(why)
        return why

    def _proved(self, case: Case, values: Array, model: reduced_rows.FrictionModels) -> str:
        """What speaks against a model on a few samples solved in full, "" where they agree."""
        chosen, compared = reduced_rows.proofs(values, self.study.sampling.seed), 0
        for done, k in enumerate(chosen):
            stage(f"reduced model against the full problem, sample {done + 1} of {len(chosen)}")
            point = dict(zip(self.study.parameters, values[k].tolist(), strict=True))
            row = model.row(point, self.study.keep)
            full = full_row(case, self.study.compute, point, self.study.keep)
            if row is None:
                continue  # outside of the model: such rows are solved in full
            if full["status"] != DONE:
                return f"at a sample that a reduced model would answer there is no answer: {full['error']}"
            model.doubtful(row)
            found = model.confirmed(row, full)
            if found["confirmed"] == 0:
                continue  # nor is what has no estimate of its error
            compared += 1
            if found["confirmed"] != 1:
                return f"the reduced model and the full problem differ by {found['difference']:.1e} at a sample"
        if compared:
            return ""
        return "the reduced model has an answer with an estimate of its error at none of the samples it is proved on"

    # -- the work ----------------------------------------------------------------------------------------------------
    def _answer(self, store: OpenStore, who: Workers) -> None:
        """Have every open row answered and written."""
        status = store.status
        places = self._open_rows(status)
        total, done = len(status), len(status) - len(places)
        if self.progress is not None:
            self.progress(done, total)
        written = time.monotonic()
        with held() as signals:
            try:
                for rows in who.answers(self._batches(store, places, who.count)):
                    self.rows |= rows
                    done += len(rows)
                    self._learned(rows)
                    if time.monotonic() - written > SECONDS:
                        self._write(store)
                        written = time.monotonic()
                    if self.progress is not None:
                        self.progress(done, total)
                    if signals.asked:
                        signals.met = self.interrupted = True
                        break
            finally:
                self._write(store)

    def _write(self, store: OpenStore) -> None:
        rows, self.rows = self.rows, {}
        store.write(rows)

    def _learned(self, rows: Mapping[int, Row]) -> None:
        seconds = [float(row["seconds"]) for row in rows.values() if "seconds" in row]
        if seconds:
            mean = float(np.mean(seconds))
            self.rate = mean if not self.rate else 0.7 * self.rate + 0.3 * mean

    def _batches(self, store: OpenStore, places: IntArray, workers: int) -> Iterator[SampleBatch]:
        """Open rows in batches of about a second, smaller towards the end so that all workers end together."""
        values = store.samples
        draws = np.random.default_rng(self.study.sampling.seed + 1).random(len(values))
        share = self.study.answers.confirm
        chosen = draws < share
        if share > 0.0 and not chosen.any():
            chosen = draws == draws.min()  # of few rows one at least
        at = 0
        while at < len(places):
            # A scheduler hands out some hundred tasks a second: with more workers they are longer.
            seconds = SECONDS * max(1.0, workers / MANY)
            size = 1 if not self.rate else int(np.clip(seconds / max(self.rate, 1e-6), 1, LARGEST))
            size = max(1, min(size, (len(places) - at) // (2 * workers) or 1))
            part = places[at : at + size]
            at += size
            yield SampleBatch(
                tuple(part.tolist()), tuple(map(tuple, values[part].tolist())), tuple(chosen[part].tolist())
            )

    def _more(self, store: OpenStore) -> bool:
        """Add samples where the probability of instability is not known as well as asked for."""
        goal = self.study.goal
        if goal is None or self.part is not None:
            return False
        found = open_study(store.path)
        known: Probability = probability(found.unstable, goal.confidence)
        have = len(found.status)
        if not known.of or known.half_width <= goal.half_width:
            return False
        # Rows that fail are expected to go on failing as often.
        wanted = min(math.ceil(missing_samples(known, goal.half_width) * have / known.of), goal.most)
        if self.study.sampling.method == "sobol":
            wanted = min(1 << (wanted - 1).bit_length(), goal.most)
        if wanted <= have:
            self.say(
                f"the goal is not reached: the interval at {100 * goal.confidence:g} % is "
                f"± {100 * known.half_width:.3g} % with the {have} samples that goal.most allows, "
                f"not ± {100 * goal.half_width:g} %"
            )
            return False
        self.say(f"{known.words}; {wanted - have} samples more")
        store.extend(samples(self.study, wanted))
        return True


NO_GOAL = "[goal] is not pursued in parts: each has the samples of the study; without --part more are added"
NOT_COUNTED = ("title", "restart_failed", "goal")  # of a study: rows do not follow from them


def digest_of(study: Study, case: Case) -> str:
    """SHA-256 of what the rows follow from: samples, case, the files that it names; not of who computes them."""
    document = study.document()
    for name in NOT_COUNTED:
        document.pop(name, None)
    data = case.model_dump(mode="json", exclude_none=True)
    files = {path: contents(Path(path)) for path in sorted(set(files_of(data)))}
    text = json.dumps([document, files], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _differences(before: Mapping[str, Any], study: Study) -> str:
    """What of a study differs from that in the store, in a few words, and what to do."""
    return f"{differing(before, study)}; remove it, or name another folder (--out)"


def differing(before: Mapping[str, Any], study: Study) -> str:
    """What of a study differs from that in a store, in a few words."""
    now = study.document()
    names = [n for n in dict.fromkeys([*before, *now]) if n not in NOT_COUNTED and before.get(n) != now.get(n)]
    what = ", ".join(names) or "a file that the case names"
    return f"{what} differ{'s' if len(names) < 2 else ''}"


def _workers(task: Task, count: int | None, scheduler: str | None, say: Callable[[str], None]) -> Workers:
    if scheduler is None:
        return LocalWorkers(task, count or available_cores())
    from .cluster import ClusterWorkers

    return ClusterWorkers(task, scheduler, say)
