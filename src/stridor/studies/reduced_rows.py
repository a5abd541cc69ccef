"""Rows answered by one certified reduced model over all parameters of a study, or one for each stretch of friction in
which the same nodes touch.

The model's own estimate says how far its eigenvalues may be off. Every row near the boundary of stability, every row
whose estimate is above the bound and a random share of all are solved in the full problem as well, which then counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..case import Case
from ..errors import AnalysisError, CaseError
from ..io.reduced_models import load_reduced, save_reduced
from ..modal.full import onsets_along
from ..modal.parametric import ReducedModel
from ..modal.parametric.line import Numbered, matched_numbers
from ..modal.tolerances import UNSTABLE_RELATIVE
from ..notebook import counted
from ..sliding.stretches import stretches
from ..study.options import options_of
from ..study.reduced import reduced_model
from ..system import build_system
from ..typing import Array, ComplexArray
from .checks import FRICTION
from .followed import anchors_noted, anchors_read, numbered
from .rows import Row, modes_row, onsets_row
from .schema import Study
from .tables import EMPTY, OF_ONSETS, ROUNDING, SAME, Compute, Keep

SAFE = 100.0  # how many times its estimated error a growth rate must be to have a sign
NEAR = 1e-6  # growth, of |λ|, below which stability is decided in full however small the error
SLOW = 0.01  # of the largest |λ|: below it differences are taken against that
WORTH = 50  # rows from which on a model is worth making
MOST_STRETCHES = 4  # of friction, each with a model of its own
EXTREMES, SOME = 12, 4  # samples on which models are proved


@dataclass(frozen=True)
class FrictionModels:
    """Models, each over a stretch of friction (one over all of it where friction is no parameter), and what is asked of
    them. names: of parameters of the study, those of the models. anchors: of each model, where numbers are known."""

    models: tuple[ReducedModel, ...]
    compute: Compute
    names: Mapping[str, str]
    anchors: tuple[tuple[Numbered, ...], ...] = ()

    @staticmethod
    def read(path: str, case: Case) -> FrictionModels:
        """Models that `made` wrote into a folder. Raises CaseError where one is damaged."""
        folder = Path(path)
        compute: Compute = "onsets" if folder.name.endswith("onsets") else "modes"
        files = sorted(folder.glob("*.npz"))
        models = tuple(map(load_reduced, files))
        anchors = tuple(anchors_read(m, _numbers(f)) for m, f in zip(models, files, strict=True))
        return FrictionModels(models, compute, _named(case), anchors)

    def row(self, values: Mapping[str, float], keep: Keep) -> Row | None:
        """A row of the model that holds these values, None where none does."""
        point = {self.names.get(path, path): value for path, value in values.items()}
        for k, model in enumerate(self.models):
            if model.problem.inside(model.problem.point(point)):
                if self.compute == "onsets":
                    return self._onsets(model, point, keep)
                return self._modes(model, self.anchors[k] if self.anchors else (), point, keep)
        return None

    def _modes(
        self, model: ReducedModel, anchors: tuple[Numbered, ...], point: Mapping[str, float], keep: Keep
    ) -> Row:
        found = model.modes(point)
        upper = found.values.imag >= 0
        lam, error = found.values[upper], found.error[upper]
        row = modes_row(lam, numbered(anchors, found)[upper], keep.modes, model.searched)
        near = np.abs(lam.real) <= np.maximum(SAFE * error, NEAR) * np.abs(lam)
        if not np.any(model.problem.powers == 1):
            # Without damping what is stable lies on the axis, but for rounding.
            near &= (np.abs(lam.real) > UNSTABLE_RELATIVE * np.abs(lam)) | (error > UNSTABLE_RELATIVE / SAFE)
        return row | {
            "status": 1, "source": "reduced", "estimated_error": float(error.max(initial=0.0)),
            "_doubtful": bool(near.any() or np.any(error > model.bound)),
        }  # fmt: skip

    def _onsets(self, model: ReducedModel, point: Mapping[str, float], keep: Keep) -> Row:
        found = onsets_along(model, FRICTION, point, confirm=False)
        low = next(p.low for p in model.problem.parameters if p.name == FRICTION)
        modes = model.modes({**point, FRICTION: low})
        growing = int(np.count_nonzero(modes.unstable & (modes.values.imag >= 0)))
        row = onsets_row(found, keep.onsets, complete=found.complete, growing_at_start=growing)
        error = float(modes.error.max(initial=0.0))
        # Where growth begins at an end of the range, or has a hair's breadth before it, the full problem says so.
        ends = np.abs(row["onset_mu"][:, None] - np.array(found.between)).min(initial=np.inf)
        doubtful = not found.complete or ends <= NEAR * (found.between[1] - found.between[0])
        return row | {"status": 1, "source": "reduced", "estimated_error": error, "_doubtful": bool(doubtful)}

    @staticmethod
    def doubtful(row: Row) -> bool:
        """Whether the full problem is to decide; said once."""
        return bool(row.pop("_doubtful", False))

    def confirmed(self, row: Row, full: Row) -> Row:
        """The row of the full problem, with what the model's was away from it."""
        if full["status"] != 1:
            return full
        off = difference(row, full, self.compute)
        allowed = max(SAME * float(row["estimated_error"]), ROUNDING)
        if self.compute == "onsets":
            allowed = max(allowed, OF_ONSETS)
        agrees = off <= allowed and _same_counts(row, full, self.compute)
        # Of an estimate that allows for anything there is nothing to confirm.
        confirmed = 0 if not float(row["estimated_error"]) <= EMPTY else 1 if agrees else 2
        told = {"estimated_error": row["estimated_error"], "difference": off, "confirmed": confirmed}
        if self.compute == "modes":
            # One numbering throughout: that of the branches of the models.
            near = max(allowed, ROUNDING)
            told["branch"] = matched_numbers(_eigenvalues(row), row["branch"], _eigenvalues(full), near)
        return full | told

    @staticmethod
    def outside(full: Row) -> Row:
        """A row of the full problem where no model holds: numbers of its own would be others than those of the rest."""
        return full | {"branch": np.zeros_like(full["branch"])} if "branch" in full else full


def difference(row: Row, full: Row, compute: Compute) -> float:
    """Largest relative difference of eigenvalues, or of onsets, of two answers; infinite where their number differs.

    Eigenvalues below a hundredth of the largest are taken against that: of slow modes of stiff meshes rounding leaves
    ε(ω/|λ|)², ω the fastest of the mesh, which is 1e-8 at 100 Hz of the two beams.
    """
    if compute == "onsets":
        one, other = row["onset_mu"], full["onset_mu"]
        if len(one) != len(other):
            return float("inf")
        return float((np.abs(one - other) / np.maximum(np.abs(other), 1e-3)).max(initial=0.0))
    ours, theirs = _eigenvalues(row), _eigenvalues(full)
    if not len(ours) or not len(theirs):
        return 0.0 if len(ours) == len(theirs) else float("inf")
    size = np.maximum(np.abs(theirs), max(SLOW * float(np.abs(theirs).max()), 1e-300))
    apart: Array = np.abs(theirs[:, None] - ours[None, :]).min(axis=1) / size
    return float(apart.max())


def _eigenvalues(row: Row) -> ComplexArray:
    """λ (k,) [1/s] of the modes kept in a row."""
    return row["growth_rate"] + 2j * np.pi * row["frequency_hz"]


def _same_counts(row: Row, full: Row, compute: Compute) -> bool:
    names = ("onsets",) if compute == "onsets" else ("modes_of_band",)
    return all(row[name] == full[name] for name in names)


def _named(case: Case) -> dict[str, str]:
    """Paths of values of [parameters], which models call by their names."""
    return {f"parameters.{name}.value": name for name in case.parameters}


def box_of(study: Study, case: Case, samples: Array) -> dict[str, tuple[float, float]]:
    """Ranges (low, high) that hold all samples, by the names that a model gives them; a value that is the same
    everywhere is no range."""
    named = _named(case)
    box: dict[str, tuple[float, float]] = {}
    for k, path in enumerate(study.parameters):
        low, high = float(samples[:, k].min()), float(samples[:, k].max())
        if low < high:
            box[named.get(path, path)] = (low, high)
    if study.compute == "onsets":
        box[FRICTION] = case.modal.friction_range
    return box


def unfit(study: Study, case: Case, rows: int) -> str:
    """Why no reduced model is tried, "" where one is."""
    if study.answers.source == "full":
        return "the study asks for full solves"
    if study.compute not in ("modes", "onsets"):
        return f"{study.compute} has no reduced model"
    if not case.modal.damped:
        return "modal.damped = false: a reduced model keeps the damping"
    if study.answers.source == "auto" and rows < WORTH:
        return f"{counted(rows, 'row')} {'is' if rows == 1 else 'are'} fewer than a model is worth"
    return ""


def made(study: Study, case: Case, samples: Array, path: Path) -> FrictionModels:
    """The models over all samples, kept in a folder. Raises CaseError and AnalysisError where there is none."""
    box = box_of(study, case, samples)
    constant = [p for k, p in enumerate(study.parameters) if samples[:, k].min() == samples[:, k].max()]
    if constant:
        raise CaseError("parameters", constant[0], "has one value only; set it by a table [set]")
    named = _named(case)
    path.mkdir(parents=True, exist_ok=True)
    for number, (own, low, high) in enumerate(_by_touching(study, case, box.get(FRICTION))):
        part = box if FRICTION not in box else {**box, FRICTION: (low, high)}
        model = reduced_model(own, part, bound=study.answers.bound, whole=False)
        if model.whole and model.states is None:
            raise AnalysisError("damping is so strong that the reduced model is no faster")
        location = path / f"{number:02}.npz"
        save_reduced(model, location, case=own)
        if study.compute == "modes":
            anchors_noted(model, own, {name: named.get(name, name) for name in study.parameters}, _numbers(location))
    return FrictionModels.read(str(path), case)


def in_words_of(study: Study, case: Case, error: CaseError) -> CaseError:
    """What is wrong with the box of a model, by the parameters that the study has: nobody gave it a box."""
    named = _named(case)
    asked = {f"box.{named.get(path, path)}": f"parameters.{path}" for path in study.parameters}
    if study.compute == "onsets":
        asked[f"box.{FRICTION}"] = "modal.friction_range"
    return CaseError.many(replace(item, where=asked.get(item.where, item.where)) for item in error.problems)


def _numbers(model: Path) -> Path:
    """Where the numbers of the branches of a model lie."""
    return model.with_name(f"{model.stem}-branches.json")


def _by_touching(study: Study, case: Case, friction: tuple[float, float] | None) -> list[tuple[Case, float, float]]:
    """Ranges of friction, each with a case in whose steady sliding the nodes touch that do so all over it. Raises
    AnalysisError where there are too many, and where no case has them."""
    if friction is None:
        return [(case, 0.0, 0.0)]
    found = stretches(build_system(case), *friction, solver=options_of(case).solver)
    if len(found) > MOST_STRETCHES or (len(found) > 1 and study.compute == "onsets"):
        raise AnalysisError(f"other nodes touch as friction grows, {len(found) - 1} times in its range")
    if any(s.reason or s.others for s in found):
        raise AnalysisError("somewhere in the range of friction nothing slides steadily, or nodes change all along it")
    if len(found) > 1 and any(c.friction.law != "coulomb" for c in case.contacts.values()):
        raise AnalysisError("other nodes touch as friction grows, and friction is not constant")
    parts: list[tuple[Case, float, float]] = []
    for stretch in found:
        changes = {f"contacts.{name}.friction.coefficient": stretch.at for name in case.contacts}
        parts.append((case if stretch.at is None else case.with_(changes), stretch.low, stretch.high))
    return parts


def proofs(samples: Array, seed: int) -> list[int]:
    """Places of samples (n, p) on which models are proved before they answer: where each number is least and largest,
    which is where other nodes touch if they do anywhere, and some at random."""
    extreme = [int(extreme_of(samples[:, k])) for k in range(samples.shape[1]) for extreme_of in (np.argmin, np.argmax)]
    some = np.random.default_rng(seed).permutation(len(samples))[:SOME].tolist()
    return list(dict.fromkeys([*extreme[:EXTREMES], *some]))
