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
from ..study.workspace import Unsaved
from ..system import System, build_system
from ..typing import Array
from .checks import FRICTION
from .schema import Study

SETTINGS = ("modal", "temporal", "comparison", "phases", "steady")  # change what is computed, not the model
IN_TIME = ("simulate", "compare")
TRIES = 3  # samples, until one makes a model
SAME = 1e-12  # of the largest of a row and a column: matrices no further apart are the same
_SKIPPED = {"answers", "of_matrices", "stress_stiffness", "line_rows"}


def without_effect(study: Study, case: Case, samples: Array) -> list[str]:
    """Sentences about parameters that leave mass, damping, stiffness, contacts, loads and motions as they are, and so
    every row, or that leave the matrices of the modes so: with the others as in the case, and as in one sample, as a
    number that is multiplied by one that the case has as zero changes nothing there alone. None where a model cannot be
    built: its rows say so."""
    told: list[str] = []
    friction: float | None = None
    if FRICTION in study.parameters:
        # The largest: without friction nothing of its laws is left, and neither would be an effect.
        friction = float(samples[:, list(study.parameters).index(FRICTION)].max())
    for k, path in enumerate(study.parameters):
        table = path.split(".", 1)[0]
        values = np.unique(samples[:, k])
        if len(values) == 1:
            told.append(f"{path} has the one value {values[0]:g} in all samples")
            continue
        if path == FRICTION or (table in SETTINGS and not _idle(table, study)):
            continue
        if table in SETTINGS:
            told.append(f"{path} has no effect on {study.compute}: it changes nothing of the model")
            continue
        ends = float(values[0]), float(values[-1])
        if _same_model(case, path, *ends):
            sampled = _at_a_sample(study, case, samples, path)
            if sampled is None or _same_model(sampled, path, *ends):
                told.append(f"{path} has no effect on {study.compute}: it changes nothing of the model")
        elif study.compute in ("modes", "onsets") and _same_modes(study, case, path, values, friction):
            sampled = _at_a_sample(study, case, samples, path)
            if sampled is None or _same_modes(study, sampled, path, values, friction):
                same_there = "the matrices of the modes are the same at both ends and in the middle"
                others = "" if sampled is None else ", the others as in the case and as in a sample"
                told.append(f"{path} has no effect on {study.compute}: {same_there}{others}")
    return told


def _at_a_sample(study: Study, case: Case, samples: Array, path: str) -> Case | None:
    """The case with all parameters but this one, and but friction, as in one of the samples (n, p); None where there is
    no other, and where none of a few makes a case."""
    others = [k for k, name in enumerate(study.parameters) if name not in (path, FRICTION)]
    names = list(study.parameters)
    if not others:
        return None
    for row in np.random.default_rng(study.sampling.seed).permutation(len(samples))[:TRIES].tolist():
        try:
            found = case.with_({names[k]: float(samples[row, k]) for k in others})
            build_system(found)
        except StridorError:
            continue
        return found
    return None


def _same_modes(study: Study, case: Case, path: str, values: Array, friction: float | None) -> bool:
    """Whether the matrices that modes follow from are the same at the least, a middle and the largest value."""
    tried = [float(values[k]) for k in sorted({0, len(values) // 2, len(values) - 1})]
    try:
        first, *others = (_matrices(study, case.with_({path: value}), friction) for value in tried)
    except StridorError:
        return False
    roles = ("mass", "damping", "stiffness")
    pairs = [
        (getattr(one, role), getattr(two, role))
        for other in others
        for one, two in zip(first, other, strict=True)
        for role in roles
    ]
    return all(one.shape == two.shape and deviation(one, two) <= SAME for one, two in pairs)


def _matrices(study: Study, case: Case, friction: float | None) -> list[Quadratic]:
    """M, D, K with what contacts and friction add, at the friction coefficients that count."""
    work = Unsaved(case)
    mu = work.own_friction if friction is None else friction
    low, high = case.modal.friction_range
    at = [low, (low + high) / 2, high] if study.compute == "onsets" else [work.one_friction() if mu is None else mu]
    found: list[Quadratic] = []
    for one in at:
        system = work.system(one)
        system = system if case.modal.damped or not system.symmetric_definite else system.undamped()
        found.append(problem_of(system, one, work.options).pencil(one).condensed())
    return found


def _idle(table: str, study: Study) -> bool:
    """Whether a table of settings has no part in what is computed."""
    in_time = study.compute in IN_TIME
    return (table in ("temporal", "phases") and not in_time) or (table == "comparison" and study.compute != "compare")


def _same_model(case: Case, path: str, low: float, high: float) -> bool:
    try:
        one, other = (build_system(case.with_({path: value})) for value in (low, high))
    except StridorError:
        return False
    return same(one, other)


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
