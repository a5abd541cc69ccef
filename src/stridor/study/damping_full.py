"""The lowest onset of a case searched for in the full problem, and what two numbers of the case do to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..case import Case
from ..errors import AnalysisError
from ..modal.derivatives import HeldContacts, Mode, PencilChange, by_friction, pencil_of, rate_of, solve_mode
from ..modal.krylov.steady import touching_nodes
from ..modal.onsets import Onset
from ..modal.pencil import Pencil
from .analyses import found_onsets
from .sensitivities import number_at
from .workspace import Workspace

NOWHERE = (float("nan"), float("nan"))


@dataclass(frozen=True)
class LowestOnset:
    """The onset of least μ from which on something grows: where, at which frequency, dμ_c/dx and dμ_c/dy (NaN where
    there are none), its backward error (NaN where it is not known in the full problem) and the error estimated of μ
    (NaN where the full problem was solved)."""

    mu: float
    frequency_hz: float
    slopes: tuple[float, float] = NOWHERE
    residual: float = float("nan")
    error: float = float("nan")


@dataclass(frozen=True)
class FullSearch:
    """A search for onsets in the full problem at every point of the map."""

    case: Case
    paths: tuple[str, str]
    mu_range: tuple[float, float]
    max_frequency_hz: float

    def lowest(self, x: float, y: float) -> tuple[LowestOnset | None, tuple[str, ...]]:
        """The lowest onset at values of the two numbers, and what there is to be said. Raises AnalysisError."""
        varied = Workspace(self.case.with_(dict(zip(self.paths, (x, y), strict=True))))
        first = lowest_onset(varied, self.mu_range, self.max_frequency_hz)
        if first is None:
            return None, ()
        found = LowestOnset(first.mu, first.frequency_hz, residual=first.residual)
        if first.growth_slope is None:
            return found, ()  # undamped: the onset is an exceptional point; where nodes open or close it is no root
        try:
            slopes = onset_slopes(varied, first, self.paths, self.mu_range)
        except AnalysisError as error:
            return found, (f"no slopes: {error}",)
        return LowestOnset(first.mu, first.frequency_hz, (slopes[0], slopes[1]), first.residual), ()

    def undamped(self) -> LowestOnset | None:
        """The lowest onset without structural damping. Raises AnalysisError."""
        first = lowest_onset(Workspace(self.case), self.mu_range, self.max_frequency_hz, damped=False)
        return None if first is None else LowestOnset(first.mu, first.frequency_hz, residual=first.residual)


def lowest_onset(
    work: Workspace, mu_range: tuple[float, float], max_frequency_hz: float, *, damped: bool = True
) -> Onset | None:
    """The onset of least μ from which on something grows."""
    return found_onsets(work, mu_range, max_frequency_hz, damped=damped, check=False).first


def onset_slopes(
    work: Workspace, onset: Onset, paths: Sequence[str], mu_range: tuple[float, float]
) -> list[float]:
    """dμ_c/dp of an onset with damping for numbers of the case. Raises AnalysisError where it has no derivative."""
    options, mu = work.options, onset.mu
    system, held = work.system(mu), _held(work, mu, mu_range)
    pencil = pencil_of(system, mu, held, options)
    lam = 2j * np.pi * onset.frequency_hz
    if not abs(lam):
        raise AnalysisError("divergence at zero frequency; slopes of flutter onsets only")
    # How far the other mode of the meeting is: growth opens as κ √(μ − μ_e).
    point, kappa = onset.exceptional_mu, onset.square_root_coefficient
    gap = 2 * kappa * abs(mu - point) ** 0.5 if point is not None and kappa is not None else 1e-3 * abs(lam)
    mode = solve_mode(pencil, lam, min(gap, abs(lam)), solver=options.solver)
    by_mu = mode.derivative(_by_friction(work, mu, held, pencil)).real
    # Of growth that opens as a square rounding is all that is left.
    if by_mu == 0.0 or onset.growth_slope == 0.0:
        raise AnalysisError("growth does not change with friction there")
    return [-_derivative(work, mode, path, mu, held).real / by_mu for path in paths]


def _held(work: Workspace, mu: float, mu_range: tuple[float, float]) -> HeldContacts:
    """The nodes that touch where the search for onsets has them touch: in steady sliding at the μ of the onset, of
    matrices that depend on μ with the laws' own friction."""
    at = mu
    if work.varies:
        at = mu_range[0] if work.own_friction is None else work.own_friction
    system = work.system(at)
    nodes = system.contact_nodes()
    steady = touching_nodes(system, nodes, at, work.options.solver)
    return HeldContacts(np.flatnonzero(steady.active), steady.sense, steady.stuck, system.size, nodes.count)


def _by_friction(work: Workspace, mu: float, held: HeldContacts, pencil: Pencil) -> PencilChange:
    """What friction does to P, in contacts and in factors of imported matrices."""
    if not work.varies:
        return by_friction(work.system(), mu, held, work.options)
    return rate_of(lambda value: pencil_of(work.system(value), value, held, work.options), mu, base=pencil)[0]


def _derivative(work: Workspace, mode: Mode, path: str, mu: float, held: HeldContacts) -> complex:
    case = work.case("a slope")

    def at(value: float) -> Pencil:
        return pencil_of(Workspace(case.with_({path: value})).system(mu), mu, held, work.options)

    return mode.derivative(rate_of(at, number_at(case, path))[0])
