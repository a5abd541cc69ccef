"""Which parameters of a study change nothing of the model, or nothing of what its modes follow from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, cast

import numpy as np
import scipy.sparse as sp

from ..case import Case
from ..errors import StridorError
from ..modal.full.family import deviation
from ..modal.krylov.problem import problem_of
from ..modal.quadratic import Quadratic
from ..study.workspace import Unsaved, Workspace
from ..system import System, build_system
from ..typing import Array
from .checks import FRICTION
from .schema import Study

SETTINGS = ("modal", "temporal", "comparison", "phases", "steady")  # change what is computed, not the model
IN_TIME = ("simulate", "compare")
ROLES = ("mass", "damping", "stiffness")
TRIES = 3  # samples, until one makes a model
SAME = 1e-12  # of the largest of a row and a column: matrices no further apart are the same
_SKIPPED = {"answers", "of_matrices", "stress_stiffness", "line_rows"}


def without_effect(study: Study, case: Case, samples: Array) -> list[str]:
    """Sentences about parameters that leave mass, damping, stiffness, contacts, loads and motions as they are, and so
    every row, or that leave the matrices of the modes so: at their least, a middle and their largest value and at the
    friction that counts, with the others as in the case and elsewhere, as a number that is multiplied by one that the
    case, the friction or a sample has as zero changes nothing there alone. None where that cannot be looked at."""
    told: list[str] = []
    frictions = _frictions(study, case, samples)
    for k, path in enumerate(study.parameters):
        table = path.split(".", 1)[0]
        values = np.unique(samples[:, k])
        if len(values) == 1:
            told.append(f"{path} has the one value {values[0]:g} in all samples")
            continue
        if path == FRICTION or (table in SETTINGS and not _idle(path, study)):
            continue
        if table in SETTINGS:
            told.append(f"{path} has no effect on {study.compute}: it changes nothing of the model")
            continue
        tried = _three(values)
        same_model, by_modes = _same_model(case, path, tried, frictions), study.compute in ("modes", "onsets")
        if not same_model and not (by_modes and _same_modes(case, path, tried, frictions)):
            continue
        others = _elsewhere(study, case, samples, path)
        if others is None:
            continue
        if same_model and all(_same_model(other, path, tried, frictions) for other in others):
            told.append(f"{path} has no effect on {study.compute}: it changes nothing of the model")
        elif by_modes and all(_same_modes(one, path, tried, frictions) for one in (case, *others)):
            same_there = "the matrices of the modes are the same at both ends and in the middle"
            with_others = ", the others as in the case and as in a sample" if others else ""
            told.append(f"{path} has no effect on {study.compute}: {same_there}{with_others}")
    return told


def _three(values: Array) -> list[float]:
    """The least, the largest and a middle one of values (k,), ascending; of two the two."""
    return [float(values[k]) for k in dict.fromkeys((0, len(values) - 1, len(values) // 2))]


def _frictions(study: Study, case: Case, samples: Array) -> list[float | None]:
    """The friction coefficients that rows are computed at: least, largest and middle of those that the samples name or
    that onsets are solved for between, the largest first, as without friction nothing that is multiplied by it shows;
    None for the case's own."""
    if FRICTION in study.parameters:
        found = _three(np.unique(samples[:, list(study.parameters).index(FRICTION)]))
    elif study.compute == "onsets":
        low, high = case.modal.friction_range
        found = _three(np.unique([low, (low + high) / 2, high]))
    else:
        return [None]
    return [*sorted(found, reverse=True)]


def _elsewhere(study: Study, case: Case, samples: Array, path: str) -> list[Case] | None:
    """The case with all parameters, but this one, friction and idle settings, as in one of the samples (n, p) and at a
    point of no special numbers between them; where that makes no case, as in a few samples. Empty where there is no
    other parameter; None where none of the samples tried makes a case."""
    names = list(study.parameters)
    others = [k for k, name in enumerate(names) if name not in (path, FRICTION) and not _idle(name, study)]
    if not others:
        return []
    generator = np.random.default_rng(study.sampling.seed)
    order = generator.permutation(len(samples))[:TRIES]
    share = generator.random(samples.shape[1])  # a sample may have as zero what others have not
    low, high = samples.min(axis=0), samples.max(axis=0)
    between = _at(case, {names[k]: float(low[k] + share[k] * (high[k] - low[k])) for k in others})
    found: list[Case] = []
    for row in order.tolist():
        sampled = _at(case, {names[k]: float(samples[row, k]) for k in others})
        if sampled is not None and between is not None:
            return [sampled, between]
        found += [] if sampled is None else [sampled]
    return found or None


def _at(case: Case, values: Mapping[str, float]) -> Case | None:
    """The case with these values; None where a model cannot be built."""
    try:
        found = case.with_(values)
        build_system(found)
    except StridorError:
        return None
    return found


def _same_modes(case: Case, path: str, tried: list[float], frictions: list[float | None]) -> bool:
    """Whether the matrices that modes follow from are the same at all values, at each of the friction coefficients."""
    try:
        works = [Unsaved(case.with_({path: value})) for value in tried]
        for mu in frictions:
            first = _matrices(works[0], mu)
            if not all(_alike(first, _matrices(work, mu)) for work in works[1:]):
                return False
    except StridorError:
        return False
    return True


def _alike(first: Quadratic, other: Quadratic) -> bool:
    """Whether the matrices are the same but for rounding."""
    pairs = [(getattr(first, role), getattr(other, role)) for role in ROLES]
    return all(one.shape == two.shape and deviation(one, two) <= SAME for one, two in pairs)


def _matrices(work: Workspace, mu: float | None) -> Quadratic:
    """M, D, K with what contacts and friction add, at a friction coefficient; None for the case's own."""
    one = work.one_friction() if mu is None else mu
    system = work.system(one)
    system = system if work.modal.damped or not system.symmetric_definite else system.undamped()
    return problem_of(system, one, work.options).pencil(one).condensed()


def _idle(path: str, study: Study) -> bool:
    """Whether a parameter is of a table of settings that has no part in what is computed."""
    table, in_time = path.split(".", 1)[0], study.compute in IN_TIME
    return (table in ("temporal", "phases") and not in_time) or (table == "comparison" and study.compute != "compare")


def _same_model(case: Case, path: str, tried: list[float], frictions: list[float | None]) -> bool:
    """Whether the systems are the same at all values, at each of the friction coefficients: those of contacts are
    compared as numbers of their laws, those in factors of imported matrices by what they make of these."""
    try:
        cases = [case.with_({path: value}) for value in tried]
        for mu in frictions if FRICTION in case.factor_names else [None]:
            first = build_system(cases[0], mu)
            if not all(same(first, build_system(other, mu)) for other in cases[1:]):
                return False
    except StridorError:
        return False
    return True


def same(one: Any, other: Any) -> bool:
    """Whether two descriptions hold the same numbers; what cannot be told apart counts as different."""
    if type(one) is not type(other):
        return False
    if one is other:
        return True
    if sp.issparse(one):
        return one.shape == other.shape and (one != other).nnz == 0
    if isinstance(one, np.ndarray):
        return one.shape == other.shape and bool(np.array_equal(one, other, equal_nan=one.dtype.kind in "fc"))
    if isinstance(one, Mapping):
        mine, theirs = cast("Mapping[Any, Any]", one), cast("Mapping[Any, Any]", other)
        return mine.keys() == theirs.keys() and all(same(mine[k], theirs[k]) for k in mine)
    if isinstance(one, list | tuple):
        first, second = cast("tuple[Any, ...]", one), cast("tuple[Any, ...]", other)
        return len(first) == len(second) and all(same(a, b) for a, b in zip(first, second, strict=True))
    if is_dataclass(one):
        names = [f.name for f in fields(one) if not (isinstance(one, System) and f.name in _SKIPPED)]
        return all(same(getattr(one, name), getattr(other, name)) for name in names)
    try:
        return bool(one == other)
    except ValueError:
        return False
