"""Modes and onsets from a reduced model over μ, each solved in the full problem.

The model is made once for a range of μ and a band (`parametric`); at each μ its eigenpairs are near those of the full
problem, where the two-sided Rayleigh functional takes off what is left to first order, and inverse iteration what is
not rounding yet. Whether the model lacks a mode is not known here: what grows is sought anew by whoever asks
(`growing`), as it is for branches.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from ...errors import AnalysisError, CaseError
from ...system import System
from ...threads import one_thread
from ...typing import Array
from ..onset import Onsets
from ..options import Options
from ..quadratic import RegionModes
from ..quadratic.dense import unit
from ..quadratic.inverse_iteration import solved_beside
from ..quadratic.reach import searched
from ..results import ComplexModes, Progress
from ..unfit import Unfit
from .basis import DECAY, Along, Projected, along
from .branches import ends_of
from .family import Family, SystemFamily, family_of
from .follow import BEYOND
from .growth import unstable, without_rounding
from .modes import ModesAtFriction, family_over, modes_at_each, table_of
from .numbers import numbered
from .search import search

CONVERGED = 2e-11  # backward error at which a pair is taken as it is: eigenvalues are right to 1e-9 then
STRAYED = 1e-3  # of λ: what is further from the model's eigenvalue is another one


def reduced_modes(
    system: System, values: Array, *, max_frequency_hz: float, damped: bool, vectors: bool | Literal["right"],
    options: Options, progress: Progress | None,
) -> ComplexModes:  # fmt: skip
    """Modes at the friction coefficients values (k,), as `full_modes` gives them, from a reduced model over μ.

    Raises Unfit where there is none, and where a mode of it is none of the full problem.
    """
    family = family_over(lambda _: system, values, options, damped=damped, own=None)
    top = searched(family.built(float(values.max())), 2 * np.pi * max_frequency_hz)
    source = _model(family, top, max_frequency_hz)
    values, found, planned = modes_at_each(
        values, lambda mu: _confirmed(family, source, mu, top, max_frequency_hz), family.freedoms, progress, vectors
    )
    numbers = numbered(family, values, [f.values for f in found], top, source=source)
    table = table_of(family, values, found, numbers, damped=damped, vectors=vectors)
    return replace(table, max_frequency_hz=max_frequency_hz, planned=planned, completeness=())


@one_thread
def reduced_onsets(
    system: System, friction_range: tuple[float, float], *, max_frequency_hz: float, damped: bool, options: Options,
    beyond: float = BEYOND,
) -> Onsets:  # fmt: skip
    """Every critical μ up to ``max_frequency_hz`` in a range, found on a reduced model and solved in the full problem.

    beyond: branches are followed that start up to so many times the band. Raises CaseError for an empty range, Unfit
    where there is no such model.
    """
    low, high = (float(v) for v in friction_range)
    if not (0 <= low < high and np.isfinite(high)):
        raise CaseError("friction_range", friction_range, "two numbers 0 ≤ a < b")
    family = family_of(lambda _: system, (low, high), options, damped=damped, own=low)
    top = searched(family.built(high), 2 * np.pi * max_frequency_hz)
    source = _model(family, beyond * top / BEYOND, max_frequency_hz)
    small = Family((family.low, family.high), lambda mu: source.sparse(mu - family.low), options)
    first, last = ends_of(small, low, high, top)
    ends = _lifted(source, first, low), _lifted(source, last, high)
    answer = search(family, [lambda: source], (low, high), ends, top)
    at_start, at_end = (tuple(end.values[unstable(family, end.values, top)].tolist()) for end in ends)
    return Onsets(
        answer.onsets, (low, high), max_frequency_hz, family.dissipates, family.open_contacts, at_start=at_start,
        at_end=at_end, entering=answer.entering, contact_state=family.contacts.contact_state,
        unexplained=0 if answer.vouched else max(len(answer.lacks), 1),
    )  # fmt: skip


def _lifted(source: Projected, end: RegionModes, mu: float) -> RegionModes:
    """Modes of the reduced model at μ, their vectors those of the full problem."""
    if end.left is None or not len(end.right):
        return end
    t = mu - source.family.low
    return replace(end, right=source.vectors(end.right, t), left=source.vectors(end.left, t, left=True))


def _model(family: SystemFamily, top: float, band_hz: float) -> Projected:
    """A reduced model over μ, or all freedoms of what is small."""
    try:
        source: Along = along(family, BEYOND * top)
    except AnalysisError as error:
        raise Unfit(str(error), band_hz) from error
    if not isinstance(source, Projected):
        raise Unfit("no reduced model over μ can be made of these matrices", band_hz)
    if source.at_rest:
        raise Unfit("the structure moves as a whole, and reduced models leave that out", band_hz)
    return source


def _confirmed(
    family: SystemFamily, source: Projected, mu: float, top: float, band_hz: float
) -> ModesAtFriction:
    """The modes of the band at μ in the full problem."""
    problem, t = family.built(mu), mu - family.low
    found = source.eigenpairs(t)
    inside = (found.values.imag <= top * (1 + 1e-12)) & (found.values.real >= -DECAY * top)
    chosen = np.flatnonzero(inside & (found.values.imag >= 0))
    lam = found.values[chosen].copy()
    right = unit(source.vectors(found.right[:, chosen], t))
    left = unit(source.vectors(found.left[:, chosen], t, left=True))
    with np.errstate(all="ignore"):
        slope = np.sum(left * problem.slope(lam, right), axis=0)
        better = lam - np.sum(left * problem.residual(lam, right), axis=0) / slope
    near = np.isfinite(better) & (np.abs(better - lam) <= STRAYED * np.abs(lam))
    lam[near] = better[near]
    residual = np.maximum(problem.backward_error(lam, right), problem.transposed.backward_error(lam, left))
    for k in np.flatnonzero(~(residual <= CONVERGED)):
        solved = solved_beside(problem, complex(lam[k]), right[:, k], left[:, k], solver=family.options.solver)
        if solved is None or abs(solved.lam - lam[k]) > STRAYED * abs(lam[k]):
            said = f"at {lam[k].imag / (2 * np.pi):.6g} Hz the reduced model has a mode that the full problem has not"
            raise Unfit(f"{said}, at μ = {mu:g}", band_hz)
        lam[k], right[:, k], left[:, k] = solved.lam, solved.right, solved.left
        residual[k] = solved.residual(problem).max()
    order, n = np.lexsort((lam.real, lam.imag)), family.freedoms
    lam, right, left = lam[order], unit(right[:n, order]), unit(left[:n, order])
    return ModesAtFriction(without_rounding(family, lam, top), right, left, residual[order], "")
