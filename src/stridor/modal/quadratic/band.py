"""The modes of a band of frequencies, those among them that grow faster than anything oscillates in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import scipy.sparse as sp

from ...direct import negative_eigenvalues
from ...errors import AnalysisError
from ...typing import Array
from .find import DENSE, RegionModes, find_modes
from .polish import pairs
from .problem import Quadratic
from .region import Region

FASTER = (1.0, 8.0, 64.0)  # times the band: growth rates between neighbours are searched by a disc of its own
QUIET = 0.25  # of the band: a system that diverges no faster without friction is not searched beyond the band
SAME = 1e-8  # of the band: one eigenvalue, found from both sides of a border


def band_modes(
    problem: Quadratic,
    max_hz: float,
    *,
    above: float,
    stands: Callable[[float], bool],
    left: bool = False,
    solver: str | None = None,
    still: float = 0.0,
    others: bool = False,
) -> RegionModes:
    """All eigenvalues with frequencies up to ``max_hz`` [Hz] and growth rates over ``above`` [1/s].

    `find_modes` cuts an endless region off at the size of its frequencies, which holds all where stiffness is positive.
    A negative one lets motions diverge at any rate, at frequency zero and so in every band. stands: whether the problem
    at the least friction diverges at no more than a rate [1/s] (`is_stiff`); where it may, or where a negative damping,
    XX for each factor of eight. Small problems are solved whole. still, others: as in `find_modes`.
    What was not searched the completeness says.
    """
    band = Region.band(0.0, max_hz, above=above)
    found = find_modes(problem, band, left=left, solver=solver, still=still, others=others)
    top = 2 * np.pi * max_hz
    if problem.size <= DENSE or (stands(QUIET * top) and not driven(problem, QUIET * top, solver)):
        return found
    cut = f" Growth rates above {found.completeness.searched.re_max:.6g} 1/s were not searched."
    for low, high in pairwise(FASTER):
        region = Region.box(low * top, high * top, 0.0, top)
        found = _joined(found, find_modes(problem, region, left=left, solver=solver, count=False), SAME * top)
    told = found.completeness
    last = f" Growth rates above {FASTER[-1] * top:.6g} 1/s were not searched."
    reached = replace(told.searched, re_max=FASTER[-1] * top)
    return replace(found, completeness=replace(told, searched=reached, sentence=told.sentence.replace(cut, last)))


def driven(problem: Quadratic, rate: float, solver: str | None = None) -> bool:
    """Whether a negative damping may drive real motions faster than ``rate`` [1/s]: xᵀ(rate M/2 + D)x > 0 of all is not
    known. Looked at where D has negative numbers on its diagonal, as falling friction on light nodes leaves them."""
    if not np.any(problem.damping.diagonal() < 0.0):
        return False
    moving = np.flatnonzero(problem.mass.diagonal() > 0.0)
    part = sp.csr_array(0.5 * rate * problem.mass + problem.damping)[moving][:, moving]
    try:
        return negative_eigenvalues(sp.csr_array(0.5 * (part + part.T)), solver=solver) != 0
    except AnalysisError:
        return True


def is_stiff(problem: Quadratic, rate: float, solver: str | None = None) -> bool:
    """Whether xᵀ(σ²M + K)x > 0 of every real x at σ = ``rate`` [1/s], so that nothing diverges faster unless friction
    or damping drives it. Rows without mass (multipliers of rigid contacts, which only hold) are left out."""
    moving = np.flatnonzero(problem.mass.diagonal() > 0.0)
    whole = rate**2 * problem.mass + problem.stiffness
    part = sp.csr_array(whole)[moving][:, moving]
    try:
        return negative_eigenvalues(sp.csr_array(0.5 * (part + part.T)), solver=solver) == 0
    except AnalysisError:
        return False


def _joined(slow: RegionModes, fast: RegionModes, near: float) -> RegionModes:
    """Both, what is in both once; by imaginary, then real part."""
    _, known = pairs(slow.values, fast.values, near)
    fresh = np.setdiff1d(np.arange(len(fast.values)), known)
    values = np.concatenate([slow.values, fast.values[fresh]])
    order = np.lexsort((values.real, values.imag))

    def rates(one: Array, other: Array) -> Array:
        return np.concatenate([one, other[fresh]])[order]

    left, left_residual = slow.left, slow.left_residual
    if left is not None and fast.left is not None:
        left = np.concatenate([left, fast.left[:, fresh]], axis=1)[:, order]
    if left_residual is not None and fast.left_residual is not None:
        left_residual = rates(left_residual, fast.left_residual)
    told = slow.completeness
    if not fast.completeness.complete:
        told = replace(told, complete=False, sentence=f"{fast.completeness.sentence} {told.sentence}")
    return RegionModes(
        values[order], np.concatenate([slow.right, fast.right[:, fresh]], axis=1)[:, order], left,
        rates(slow.residual, fast.residual), left_residual, told, slow.factorisations + fast.factorisations,
        slow.solves + fast.solves, slow.seconds + fast.seconds, max(slow.memory_bytes, fast.memory_bytes), slow.beside,
    )  # fmt: skip
