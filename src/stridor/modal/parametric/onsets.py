"""Onsets of instability along any parameter of a reduced model, each confirmed in the full problem."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from ...errors import AnalysisError, CaseError
from ...threads import one_thread
from ...typing import Array, ComplexArray
from ..assembled.critical import crossing
from ..assembled.follow import Follower, State
from ..assembled.passages import Passage, crossings
from ..assembled.reduced import Reduced
from ..assembled.shifted import Pair
from ..quadratic.problem import times
from .dense import assembled
from .full import refined, rounding
from .model import ReducedModel
from .problem import ParametricProblem

STEPS = (30, 120, 480)  # at least, over the range of the parameter; more where onsets do not balance
ROUNDS = 6
STALLED = 0.5  # of Re λ one step before: what is left is rounding
ON_AXIS = 1e-13  # |Re λ| / |λ| of the full problem at which an onset is confirmed
BELIEVED = 1e-10


@dataclass(frozen=True)
class ParametricOnset:
    """A mode becomes unstable (or stable, ``stabilising``, as the parameter grows) at ``value`` of ``parameter``.

    point: values of all parameters there. growth_slope: dRe λ/dp [1/s per unit]. residual: backward error in the full
    problem. reduced_value: what the reduced model alone said; None of both where it was not confirmed.
    """

    parameter: str
    value: float
    point: Mapping[str, float]
    frequency_hz: float
    growth_slope: float
    stabilising: bool
    residual: float | None
    reduced_value: float


class _Along(Reduced):
    """The reduced problem along one parameter, counted from its low end, as the branch follower sees it."""

    def __init__(self, model: ReducedModel, name: str, point: Mapping[str, float]) -> None:
        self._model, self.parameter, self._point = model, name, dict(point)
        (own,) = (p for p in model.problem.parameters if p.name == name)
        self.low, self.high = own.low, own.high
        self.problem = SimpleNamespace(damped=True, extras=None)  # type: ignore[assignment]
        self.frequency = model.frequency
        self.pairs = Pair(np.zeros((0, model.size)), np.zeros((0, model.size)))
        self.forces = np.zeros((0, 0))
        self._known = {}

    def at(self, t: float) -> dict[str, float]:
        """All parameters at ``t`` above the low end."""
        return {**self._point, self.parameter: self.low + t}

    def matrices(self, mu: complex) -> tuple[Array, Any, Any]:
        problem = self._model.problem
        return assembled(self._model.projected, problem.factors(self.at(float(mu.real))), problem.powers)

    def slopes(self, mu: float) -> tuple[Array, Array]:
        _, damping, stiffness = self._change(mu)
        return damping, stiffness

    def mass_slope(self, mu: float) -> Array | None:
        return self._change(mu)[0]

    def tangents(
        self, mu: float, coordinate: ComplexArray, values: ComplexArray, right: ComplexArray, left: ComplexArray
    ) -> ComplexArray:
        change = _applied(self._change(mu), values, right)
        mass, damping, _ = self.matrices(mu)
        with np.errstate(all="ignore"):
            by_lambda = np.einsum("ij,ij->j", left, 2 * values * (mass @ right) + damping @ right)
            return -np.einsum("ij,ij->j", left, change) / by_lambda

    def _change(self, mu: float) -> tuple[Array, Array, Array]:
        problem = self._model.problem
        slopes = problem.factor_slopes(self.at(mu), self.parameter)
        return assembled(self._model.projected, slopes, problem.powers)


def _applied(matrices: tuple[Array, Array, Array], lam: ComplexArray, z: ComplexArray) -> ComplexArray:
    mass, damping, stiffness = matrices
    result: ComplexArray = lam**2 * (mass @ z) + lam * (damping @ z) + stiffness @ z
    return result


@one_thread
def onsets_along(
    model: ReducedModel,
    parameter: str,
    fixed: Mapping[str, float] | None = None,
    *,
    confirm: bool = True,
    solver: str | None = None,
) -> tuple[ParametricOnset, ...]:
    """Every change of stability along a parameter's range up to the model's frequency, the others held at ``fixed`` (or
    their own values), in ascending order.

    confirm solves each again in the full problem, two or three factorisations for one. Raises CaseError for unknown
    parameters, AnalysisError where an onset cannot be confirmed.
    """
    names = [p.name for p in model.problem.parameters]
    if parameter not in names:
        raise CaseError("parameter", parameter, f"no such parameter; there are: {', '.join(names)}")
    along = _Along(model, parameter, model.problem.point(fixed or {}))
    length = along.high - along.low
    found: list[ParametricOnset] = []
    balance = sum(sign * _growing(model, along.at(t)) for sign, t in ((1, length), (-1, 0.0)))
    for steps in STEPS:
        finer: list[ParametricOnset] = []
        for passage in _passages(along, length / steps):
            onset = _located(along, model, passage)
            if onset is not None and not any(_same(onset, other, length) for other in finer):
                finer.append(onset)
        if len(finer) >= len(found):
            found = finer
        # As many modes must turn unstable as grow at the end and not at the start; else steps have been too long, as
        # beside a point where two modes meet. Modes that leave the band while they grow may leave it unbalanced.
        if sum(-1 if o.stabilising else 1 for o in found) == balance:
            break
    found.sort(key=lambda o: o.value)
    return tuple(_confirmed(model, o, solver) if confirm else o for o in found)


def _growing(model: ReducedModel, point: Mapping[str, float]) -> int:
    """How many modes grow at a point."""
    return int(model.modes(point).unstable.sum())


def _passages(along: _Along, longest: float) -> list[Passage]:
    """Enclosed changes of stability over the parameter's range, in steps of at most ``longest``."""
    passages: list[Passage] = []

    def watch(old: State, new: State) -> None:
        passages.extend(crossings(old, new))

    Follower(along, longest=longest, watch=watch).advance(along.high - along.low)
    return passages


def _same(one: ParametricOnset, other: ParametricOnset, length: float) -> bool:
    near = abs(one.reduced_value - other.reduced_value) <= 1e-9 * length
    return near and abs(one.frequency_hz - other.frequency_hz) <= 1e-7 * one.frequency_hz


def _located(along: _Along, model: ReducedModel, passage: Passage) -> ParametricOnset | None:
    """The onset of a passage in the reduced problem; None where it was none, or above the model's frequency."""
    found = crossing(along, passage)
    if found is None or found.slope is None or abs(found.lam) > model.frequency:
        return None
    t, lam = found.mu, found.lam
    if not 0 <= t <= along.high - along.low:
        return None
    point = along.at(t)
    slope, name = found.slope, along.parameter
    return ParametricOnset(
        name, point[name], point, abs(lam.imag) / (2 * np.pi), slope, slope < 0, None, point[name]
    )


def _confirmed(model: ReducedModel, onset: ParametricOnset, solver: str | None) -> ParametricOnset:
    """The same in the full problem, by Newton on Re λ over the parameter."""
    problem, name = model.problem, onset.parameter
    point = dict(onset.point)
    lam = 2j * np.pi * onset.frequency_hz
    modes = model.modes(point)
    k = int(np.argmin(np.abs(modes.values - lam)))
    x, y = model.expand(modes)[:, k], model.expand(modes, left=True)[:, k]
    lam, before = complex(modes.values[k]), np.inf
    for _ in range(ROUNDS):
        full = problem.at(point)
        lam, x, y = refined(full, lam, x, y, solver)
        slope = _full_slope(problem, point, name, lam, x, y)
        off = abs(lam.real)
        # Rounding of a stiff problem may leave more; Newton goes on as long as that helps.
        stalled = off > STALLED * before and off <= rounding(full, lam, x, y)
        before = off
        on_axis = stalled or off <= ON_AXIS * abs(lam)
        if on_axis or abs(lam.real / slope) <= 1e-14 * max(abs(point[name]), 1e-300):
            residual = float(full.backward_error(np.array([lam]), x[:, None])[0])
            if residual > BELIEVED:
                break
            frequency = abs(lam.imag) / (2 * np.pi)
            return ParametricOnset(
                name, point[name], dict(point), frequency, slope, slope < 0, residual, onset.reduced_value
            )
        point[name] -= lam.real / slope
    raise AnalysisError(
        f"the onset at {name} = {onset.reduced_value:.6g} and {onset.frequency_hz:.6g} Hz is not confirmed in the full "
        "problem; ask the reduced model for a smaller bound"
    )


def _full_slope(
    problem: ParametricProblem, point: Mapping[str, float], name: str, lam: complex, x: ComplexArray, y: ComplexArray
) -> float:
    """dRe λ/dp of the full problem, from right and left vectors (n,)."""
    slopes = problem.factor_slopes(point, name)
    change = sum(
        s * lam**power * (y @ times(t.matrix, x))
        for t, s, power in zip(problem.terms, slopes, problem.powers.tolist(), strict=True)
        if s
    )
    full = problem.at(point)
    by_lambda = y @ (2 * lam * times(full.mass, x) + times(full.damping, x))
    return float((-change / by_lambda).real)
