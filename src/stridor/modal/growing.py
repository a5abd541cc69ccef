"""What grows in a band at one friction coefficient, sought anew in the full problem.

Branches are followed from μ = 0, and what starts beyond the band may sink into it with friction, or be born on the real
axis. What counts at a μ is every mode of the band there, wherever it began. It is sought with `quadratic.band_modes` on

    λ²M + λ(C + friction's slope) + K + (N + μS)ᵀ c⁻¹ N

(rigid contact as in `full`), which shares with the followed branches nothing but these matrices.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..stages import passing, stage
from ..system import System
from ..threads import one_thread
from ..typing import Array, BoolArray, ComplexArray, IntArray
from .at_rest import SLOW, rest_limit
from .krylov.problem import problem_of
from .krylov.shifted import standing_at
from .onset import refuted
from .options import Options
from .quadratic import Quadratic, band_modes, is_stiff
from .quadratic.polish import pairs
from .quadratic.problem import times
from .quadratic.reach import searched
from .tolerances import AFFORDABLE, SPLIT_RELATIVE, UNSTABLE_RELATIVE

BESIDE = 1e-3  # of the band: how much faster than that modes may decay that are looked at
NEAR = 1e-3  # of the band: eigenvalues further apart are not the same mode
SAME = 1e-6  # of |λ|: what two ways of solving leave of one eigenvalue
CHECKED, UNCHECKED = "Checked at", "Not checked"
SURE = 3.0  # times a correction: growth that is more than what is left to correct
WIDER = (1.4, 2.0)  # times the band: from where branches are followed that are missing in it


@dataclass(frozen=True)
class Growing:
    """Growing modes of a band at one μ: λ (k,) [1/s], right (n, k) of unit norm, backward errors residual (k,).

    beside (l,): eigenvalues within rounding and a little below of the axis. complete: whether the search vouches for
    there being no other; sentence: what speaks for that. top [1/s]: how far the band had to be searched.
    shapes (n, l): right vectors of all modes found, whether they grow or not, and of others found on the way.
    fastest [1/s]: up to which growth it was. sought: whether it was; else these are branches, which agree with what
    was found beside them. still [1/s]: up to which |λ| eigenvalues may be motions as a whole.
    """

    mu: float
    values: ComplexArray
    right: ComplexArray
    residual: Array
    beside: ComplexArray
    complete: bool
    sentence: str
    top: float
    sought: bool = True
    fastest: float = np.inf
    still: float = 0.0
    shapes: ComplexArray | None = None

    @property
    def words(self) -> str:
        """How many, of which kind."""
        return modes_grow(self.values)


@one_thread
def growing_modes(
    system: System,
    mu: float,
    max_frequency_hz: float,
    *,
    touching_at: float | None,
    damped: bool = True,
    options: Options | None = None,
) -> Growing:
    """Every mode that grows at ``mu`` with a frequency up to max_frequency_hz.

    touching_at: the μ of the steady sliding that says which nodes touch (None: the laws' own). Searched once and kept
    with the system. Raises AnalysisError where contacts do not slide or the search does not settle.
    """
    chosen = options or Options()
    asked = ("growing modes", mu, max_frequency_hz, touching_at, damped, chosen)
    return system.once(asked, lambda: _searched_for(system, mu, max_frequency_hz, touching_at, damped, chosen))


@passing()
def _searched_for(
    system: System, mu: float, max_frequency_hz: float, touching_at: float | None, damped: bool, options: Options
) -> Growing:
    stage(f"growing modes sought anew at μ = {mu:.6g}")
    system = system if damped else system.undamped()
    problem = problem_of(system, touching_at, options)
    whole = problem.pencil(mu).condensed()
    top = searched(whole, 2 * np.pi * max_frequency_hz)

    def stands(rate: float) -> bool:
        if touching_at is None and standing_at(system, options) <= rate:
            return True
        asked = ("stands", rate, touching_at, options)
        return system.once(asked, lambda: is_stiff(problem.pencil(0.0).condensed(), rate, options.solver))

    return growing_in(
        whole, mu, top, damped=problem.damped, stands=stands, freedoms=problem.size, solver=options.solver
    )


def growing_in(
    whole: Quadratic,
    mu: float,
    top: float,
    *,
    damped: bool,
    stands: Callable[[float], bool],
    freedoms: int,
    solver: str | None,
) -> Growing:
    """Every mode of a problem's matrices that grows with a frequency up to top [1/s], called by ``mu``. stands: as of
    `band_modes`; freedoms: of the vectors, without what multipliers there are.

    Raises AnalysisError where the search does not settle.
    """
    found = band_modes(whole, top / (2 * np.pi), above=-BESIDE * top, stands=stands, solver=solver, others=True)
    size = np.abs(found.values)
    rounding = UNSTABLE_RELATIVE if damped else SPLIT_RELATIVE
    limit = rest_limit([whole], top, solver) if np.any(size <= SLOW * top) else 0.0
    grows = (found.values.real > rounding * size) & (size > limit)
    # Slow modes of stiff meshes are found to fewer digits: what one more correction would change is no growth.
    grows &= ~(found.values.real <= SURE * _correction(whole, found.values, found.right))
    right = found.right[:freedoms, grows]
    return Growing(
        mu,
        found.values[grows],
        right / np.maximum(np.linalg.norm(right, axis=0), 1e-300),
        found.residual[grows],
        found.values[~grows],
        found.completeness.complete,
        found.completeness.sentence,
        top,
        fastest=found.completeness.searched.re_max,
        still=limit,
        shapes=np.hstack([found.right, *([] if found.beside is None else [found.beside])])[:freedoms],
    )


def _correction(problem: Quadratic, values: ComplexArray, right: ComplexArray) -> Array:
    """By how much (k,) [1/s] a step of Newton's method on xᴴ P(λ) x = 0 would still change each λ."""
    if not len(values):
        return np.zeros(0)
    slope = 2 * values * times(problem.mass, right) + times(problem.damping, right)
    rest = problem.residual(values, right)
    with np.errstate(all="ignore"):
        return np.abs(np.sum(right.conj() * rest, axis=0)) / np.abs(np.sum(right.conj() * slope, axis=0))


def affordable(system: System) -> bool:
    """Whether the full problem is solved unasked."""
    return system.size <= AFFORDABLE


def modes_grow(values: ComplexArray) -> str:
    """How many grow: "1 mode grows", or "3 modes grow, 1 of them without oscillating"."""
    still = int(np.count_nonzero(values.imag == 0.0))
    text = "no mode grows" if not len(values) else "1 mode grows" if len(values) == 1 else f"{len(values)} modes grow"
    if not still:
        return text
    return f"{text} without oscillating" if still == len(values) else f"{text}, {still} of them without oscillating"


def missing(found: Growing, listed: ComplexArray, unstable: BoolArray) -> IntArray:
    """Places (k,) of growing modes that are not among the eigenvalues ``listed`` (l,), of which some are unstable."""
    ours, _ = pairs(found.values, listed[unstable], NEAR * found.top)
    rest = np.setdiff1d(np.arange(len(found.values)), ours)
    # Growth so slow that one way of solving sees it and the other does not.
    stable = listed[~unstable & np.isfinite(listed)]
    distance = np.abs(found.values[rest][:, None] - stable).min(axis=1, initial=np.inf)
    return rest[distance > SAME * np.abs(found.values[rest])]


def unconfirmed(found: Growing, listed: ComplexArray, unstable: BoolArray) -> int:
    """How many of the modes listed as unstable are none in the full problem."""
    mine, top = listed[unstable], found.top
    mine = mine[(mine.real > SAME * np.abs(mine)) & (np.abs(mine) > found.still)]
    # On the very border of what was searched a mode may count on one side only.
    mine = mine[(mine.imag <= top * (1 - SAME)) & (mine.real <= found.fastest * (1 - SAME))]
    ours, _ = pairs(mine, found.values, NEAR * top)
    return len(mine) - len(ours)


def doubt(completeness: str) -> str:
    """What is said of a list of modes or onsets where it is not known to hold everything; empty where it is."""
    return completeness if UNCHECKED in completeness or refuted(completeness) else ""


def too_large(system: System) -> str:
    """Why what grows is not sought unasked."""
    return too_many(system.size)


def too_many(freedoms: int) -> str:
    """The same of so many freedoms."""
    return f"with {freedoms} freedoms what grows is not sought anew in the full problem (up to {AFFORDABLE} it is)"
