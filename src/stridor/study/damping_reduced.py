"""The lowest onset over two dampings from one reduced model for the whole map.

Onsets are those of the model along μ. At one of them Re λ(μ, d) = 0 with right and left vectors z and w of the model,
and every factor θ_j of its terms has an exact derivative:

    ∂λ/∂d = − wᵀ (Σ_j ∂θ_j/∂d λ^k A_j) z / wᵀ P'(λ) z,      dμ_c/dd = − Re(∂λ/∂d) / Re(∂λ/∂μ) .
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..case import Case
from ..case.overrides import split_path
from ..errors import AnalysisError, CaseError
from ..modal.full import ParametricOnset, onsets_along
from ..modal.parametric import Parameter, ReducedModel
from ..modal.parametric.contacts import ContactsProblem
from ..modal.parametric.dense import assembled
from ..modal.parametric.model import ReducedModes
from ..system import System, build_system
from ..typing import Array, Sparse
from .damping_full import FullSearch, LowestOnset
from .options import options_of
from .reduced import reduced_model

FRICTION = "mu"
BEYOND = 1.25  # how much further than a neighbour's onset is looked first
AROUND = 1e-3  # of the range of μ: where an onset is confirmed
SAMPLES = 6  # friction coefficients at which growing modes are counted
STRICTLY = 1e-6  # of the range of μ: below an onset
BISECTED, NEWTON = 1e-6, 4


@dataclass
class ReducedSearch:
    """A reduced model over (μ, x, y), asked for onsets at every point of the map."""

    case: Case
    model: ReducedModel
    names: tuple[str, str]
    full: FullSearch
    _near: float | None = None
    _undamped: list[LowestOnset | None] = field(default_factory=list[LowestOnset | None])

    @classmethod
    def of(cls, full: FullSearch, ends: tuple[tuple[float, float], tuple[float, float]], bound: float) -> ReducedSearch:
        """Makes the model. Raises CaseError for numbers that are no dampings and where there is no reduced model,
        AnalysisError where it does not settle."""
        case = full.case
        _dampings_only(case, full.paths, ends)
        names = tuple(box_name(case, path) for path in full.paths)
        box = {FRICTION: full.mu_range, **dict(zip(names, ends, strict=True))}
        model = reduced_model(case, box, max_frequency_hz=full.max_frequency_hz, bound=bound, whole=False)
        return cls(case, model, (names[0], names[1]), full)

    @property
    def notes(self) -> tuple[str, ...]:
        """What the model's user should know."""
        problem = self.model.problem
        return problem.notes if isinstance(problem, ContactsProblem) else ()

    def lowest(self, x: float, y: float) -> tuple[LowestOnset | None, tuple[str, ...]]:
        """The lowest onset at values of the two numbers, and what there is to be said. Raises AnalysisError."""
        fixed = dict(zip(self.names, (x, y), strict=True))
        if not np.any(self._matrices(self.model.problem.point(fixed))[1]):
            return self.undamped(), ()
        low, high = self.full.mu_range
        told: tuple[str, ...] = ()
        near = high if self._near is None else min(low + BEYOND * (self._near - low), high)
        for end in (near, high) if near < high else (high,):
            onsets = onsets_along(_between(self.model, low, end), FRICTION, fixed, confirm=False)
            first = next((o.value for o in onsets if not o.stabilising), None)
            missed, told = self._missed(fixed, onsets, end if first is None else first)
            first = first if missed is None else missed
            if first is not None:
                self._near = first
                return self._onset({**fixed, FRICTION: first}), told
        self._near = None
        return None, told

    def _missed(
        self, fixed: Mapping[str, float], onsets: Sequence[ParametricOnset], end: float
    ) -> tuple[float | None, tuple[str, ...]]:
        """An onset below ``end`` that is not among those found, as more modes grow there than these say; and what is to
        be said where they do and there is no onset either."""
        low, high = self.full.mu_range
        below, start = low, self._growing(fixed, low)
        for mu in np.linspace(low, end - STRICTLY * (high - low), SAMPLES + 1)[1:].tolist():
            known = start + sum(-1 if o.stabilising else 1 for o in onsets if o.value < mu)
            if self._growing(fixed, mu) > known:
                found = self._bisected(fixed, below, mu, known)
                if found is None:
                    return None, (f"something grows at μ = {mu:.4g} that no onset below explains",)
                return found, ()
            below = mu
        return None, ()

    def _bisected(self, fixed: Mapping[str, float], low: float, high: float, known: int) -> float | None:
        """Where, between two μ, more than ``known`` modes begin to grow; None where that is no crossing of the axis, as
        of a mode that comes into the band from above."""
        width = BISECTED * (high - low)
        while high - low > width:
            middle = (low + high) / 2
            if self._growing(fixed, middle) > known:
                high = middle
            else:
                low = middle
        # What grows counts from some way above the axis on: Newton goes back to it.
        modes = self.model.modes({**fixed, FRICTION: high})
        growing = np.flatnonzero(modes.unstable)
        lam = complex(modes.values[growing[np.argmin(modes.values[growing].real)]])
        mu = high
        for _ in range(NEWTON):
            modes, k = self._mode({**fixed, FRICTION: mu}, lam)
            lam, slope = complex(modes.values[k]), self._rate(modes, k, FRICTION)
            step = -lam.real / slope if slope else 0.0
            if not abs(step) <= 1e3 * width:
                return None
            mu, lam = mu + step, 1j * lam.imag
        return float(mu)

    def _growing(self, fixed: Mapping[str, float], mu: float) -> int:
        return int(np.count_nonzero(self.model.modes({**fixed, FRICTION: float(mu)}).unstable))

    def _onset(self, point: Mapping[str, float]) -> LowestOnset:
        """An onset of the model with its slopes and the error estimated of μ."""
        modes = self.model.modes(point)
        k = int(np.argmin(np.abs(modes.values.real)))
        by_mu = self._rate(modes, k, FRICTION)
        x, y = (-self._rate(modes, k, name) / by_mu if by_mu else float("nan") for name in self.names)
        error = float(modes.error[k]) * abs(modes.values[k]) / abs(by_mu) if by_mu else float("nan")
        return LowestOnset(point[FRICTION], float(modes.frequency_hz[k]), (x, y), error=error)

    def confirmed(self, x: float, y: float, found: LowestOnset) -> LowestOnset:
        """An onset solved for again in the full problem. Raises AnalysisError where it is none there."""
        if np.isfinite(found.residual):
            return found
        low, high = self.full.mu_range
        reach = AROUND * (high - low)
        around = _between(self.model, max(low, found.mu - reach), min(high, found.mu + reach))
        fixed = dict(zip(self.names, (x, y), strict=True))
        again = onsets_along(around, FRICTION, fixed, solver=options_of(self.case).solver)
        if not again:
            raise AnalysisError("the onset of the reduced model is not found again")
        onset = min(again, key=lambda o: abs(o.reduced_value - found.mu))
        residual = float("nan") if onset.residual is None else onset.residual
        return replace(found, mu=onset.value, frequency_hz=onset.frequency_hz, residual=residual)

    def undamped(self) -> LowestOnset | None:
        """The lowest onset without structural damping, solved in the full problem. Raises AnalysisError."""
        if not self._undamped:
            self._undamped.append(self._without_damping())
        return self._undamped[0]

    def _without_damping(self) -> LowestOnset | None:
        problem = self.model.problem
        fixed = problem.reference
        low, high = self.full.mu_range
        damping = problem.powers == 1
        for mu in np.linspace(low, high, 7):
            if np.any(problem.factor_slopes({**fixed, FRICTION: float(mu)}, FRICTION)[damping]):
                # Friction has a part in damping, which stays: that is no undamped problem.
                return self.full.undamped()
        found = onsets_along(without_damping(self.model), FRICTION, solver=options_of(self.case).solver)
        if not found.complete:
            return self.full.undamped()
        first = next((onset for onset in found if not onset.stabilising), None)
        if first is None:
            return None
        residual = float("nan") if first.residual is None else first.residual
        return LowestOnset(first.value, first.frequency_hz, residual=residual)

    def _matrices(self, point: Mapping[str, float]) -> tuple[Array, Array, Array]:
        problem = self.model.problem
        return assembled(self.model.projected, problem.factors(point), problem.powers)

    def _mode(self, point: Mapping[str, float], lam: complex) -> tuple[ReducedModes, int]:
        modes = self.model.modes(point)
        return modes, int(np.argmin(np.abs(modes.values - lam)))

    def _rate(self, modes: ReducedModes, k: int, name: str) -> float:
        """∂ Re λ / ∂ a number."""
        problem, lam = self.model.problem, complex(modes.values[k])
        z, w = modes.right[:, k], modes.left[:, k]
        mass, damping, _ = self._matrices(modes.point)
        change = assembled(self.model.projected, problem.factor_slopes(modes.point, name), problem.powers)
        moved = lam**2 * (change[0] @ z) + lam * (change[1] @ z) + change[2] @ z
        return float((-(w @ moved) / (w @ (2 * lam * (mass @ z) + damping @ z))).real)


def without_damping(model: ReducedModel) -> ReducedModel:
    """The model of the problem that is left without terms that work on velocities."""
    kept = np.flatnonzero(model.problem.powers != 1)
    terms = tuple(model.problem.terms[k] for k in kept)
    return replace(
        model, problem=replace(model.problem, terms=terms), projected=model.projected[kept],
        right_sketch=model.right_sketch[kept], left_sketch=model.left_sketch[kept], states=None,
    )  # fmt: skip


def _between(model: ReducedModel, low: float, high: float) -> ReducedModel:
    """The same model with another range of μ."""
    parameters = tuple(
        Parameter(FRICTION, low, high, (low + high) / 2) if p.name == FRICTION else p for p in model.problem.parameters
    )
    return replace(model, problem=replace(model.problem, parameters=parameters))


def box_name(case: Case, path: str) -> str:
    """What a box calls the number at a path."""
    steps = split_path(path)
    return steps[1] if len(steps) == 3 and steps[0] == "parameters" and steps[1] in case.parameters else path


def _dampings_only(case: Case, paths: tuple[str, str], ends: tuple[tuple[float, float], tuple[float, float]]) -> None:
    """Raise CaseError for a number that is no damping: touching nodes, normal forces and shapes would change with it,
    which a reduced model holds."""
    at = dict(zip(paths, (low for low, _ in ends), strict=True))
    own = build_system(case.with_(at))
    for path, (_, high) in zip(paths, ends, strict=True):
        other = build_system(case.with_({**at, path: high}))
        same = _same(own.mass, other.mass) and _same(own.stiffness, other.stiffness) and _same_contacts(own, other)
        if not same or _same(own.damping, other.damping):
            raise CaseError("method", "reduced", f"for dampings only, and {path} is none")


def _same(one: Sparse, other: Sparse) -> bool:
    return one.shape == other.shape and (one != other).nnz == 0


def _same_contacts(one: System, other: System) -> bool:
    a, b = one.contact_nodes(), other.contact_nodes()
    return a.count == b.count and np.array_equal(a.compliance, b.compliance) and a.laws == b.laws
