"""Complex modes of systems with matrices of any structure: gyroscopic, circulatory, with friction of another program.

λ²M + λD + K of such a system, the contacts that touch in steady sliding at μ put in, is one quadratic problem per μ:

    penalty contact:  K + (N + μS)ᵀ c⁻¹ N
    rigid contact:    a row N u = 0 and a column −(N + μS)ᵀ, whose unknowns, the normal forces, have no mass

and `quadratic.find_modes` finds every eigenvalue of a band and says what speaks for its being all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy.sparse as sp

from ..errors import CaseError
from ..system import System
from ..threads import one_thread_if_small
from ..typing import Array, ComplexArray, Sparse
from .assembled.problem import ContactProblem, problem_of
from .assembled.steady import Options
from .complex_modes import ComplexModes
from .quadratic import Quadratic, Region, find_modes

DECAY = 0.5  # of the highest angular frequency: modes that decay faster are not listed


@dataclass(frozen=True)
class Found:
    """Eigenvalues (k,) at one μ by frequency, right and left vectors (n, k), backward errors (k,)."""

    values: ComplexArray
    right: ComplexArray
    left: ComplexArray | None
    residual: Array
    sentence: str
    open_contacts: tuple[str, ...]


def general_modes(
    system_at: Callable[[float], System],
    mu: float | Sequence[float] | Array,
    *,
    count: int | None = 20,
    max_frequency_hz: float = 40e3,
    damped: bool = True,
    vectors: bool | Literal["right"] = False,
    options: Options | None = None,
) -> ComplexModes:
    """Modes at the friction coefficients ``mu`` up to max_frequency_hz, at each the ``count`` lowest (None: all).

    system_at gives the system at a μ, on which its matrices may depend. Numbers of modes count by frequency at each μ;
    they do not follow a mode from one μ to the next, and where fewer are found the rest is NaN. Raises CaseError for
    friction coefficients that are none, AnalysisError where contacts do not slide or eigenvalues do not settle.
    """
    values = np.atleast_1d(np.asarray(mu, dtype=float))
    if values.ndim != 1 or not len(values) or not np.all(np.isfinite(values)) or np.any(values < 0):
        raise CaseError("mu", mu, "friction coefficients are numbers ≥ 0, at least one")
    options = options or Options()
    found = [
        _modes(system_at(float(m)), float(m), count, max_frequency_hz, options, damped=damped, left=vectors is True)
        for m in values
    ]
    most, n = max(len(f.values) for f in found), found[0].right.shape[0]
    eigenvalues = np.full((len(values), most), complex(np.nan, np.nan))
    residual = np.full((len(values), most), np.nan)
    right, left = (np.full((len(values), most, n if wanted else 0), complex(np.nan, np.nan)) for wanted in
                   (bool(vectors), vectors is True))  # fmt: skip
    for row, f in enumerate(found):
        mine = slice(len(f.values))
        eigenvalues[row, mine], residual[row, mine] = f.values, f.residual
        if vectors:
            right[row, mine] = f.right.T
        if f.left is not None:
            left[row, mine] = f.left.T
    return ComplexModes(
        mu=values,
        eigenvalues=eigenvalues,
        branch=np.arange(1, most + 1),
        residual=residual,
        damped=damped,
        right=right if vectors else None,
        left=left if vectors is True else None,
        open_contacts=tuple(dict.fromkeys(name for f in found for name in f.open_contacts)),
        completeness=tuple(f.sentence for f in found),
    )


@one_thread_if_small
def _modes(
    system: System, mu: float, count: int | None, limit: float, options: Options, *, damped: bool, left: bool
) -> Found:
    problem = problem_of(system, mu, options, damped=True)
    whole = quadratic_of(problem, mu)
    if not damped:
        # Gyroscopic forces do no work and are no damping.
        whole = replace(whole, damping=sp.csr_array((whole.damping - whole.damping.T) / 2))
    top = 2 * np.pi * limit
    spectrum = find_modes(whole, Region.band(0.0, limit, above=-DECAY * top), left=left, solver=options.solver)
    n = problem.size
    chosen = slice(None if count is None else count)
    told = spectrum.completeness.sentence
    sentence = f"Modes up to {limit:g} Hz that decay at less than {DECAY * top:.4g} 1/s. {told}"
    return Found(
        spectrum.values[chosen],
        _normed(spectrum.right[:n, chosen]),
        None if spectrum.left is None else _normed(spectrum.left[:n, chosen]),
        spectrum.residual[chosen],
        sentence,
        problem.open_contacts,
    )


def quadratic_of(problem: ContactProblem, mu: float) -> Quadratic:
    """λ²M + λD + K with the contacts at μ; of rigid ones the normal forces are unknowns after the displacements."""
    extras = problem.at(mu)
    damping, stiffness = problem.damping, problem.stiffness
    if extras.damping is not None:
        damping = damping + extras.damping
    if extras.stiffness is not None:
        stiffness = stiffness + extras.stiffness
    if extras.weakening is not None:
        damping = damping + problem.slide.T @ sp.diags_array(extras.weakening) @ problem.slide
    push = sp.csr_array(problem.normal + mu * problem.slide)
    soft = problem.compliance > 0
    if soft.any():
        springs = sp.diags_array(1.0 / problem.compliance[soft])
        stiffness = stiffness + push[soft].T @ springs @ problem.normal[soft]
    if soft.all():
        return Quadratic(problem.mass, sp.csr_array(damping), sp.csr_array(stiffness))
    # Forces in units of the stiffness, so that the bordered matrix is well balanced.
    unit = float(np.abs(problem.stiffness.data).max(initial=0.0)) or 1.0
    rigid = int(np.count_nonzero(~soft))
    bordered = sp.block_array([[stiffness, -unit * push[~soft].T], [unit * problem.normal[~soft], None]], format="csr")
    empty = sp.csr_array((rigid, rigid))

    def widened(matrix: Sparse) -> Sparse:
        return sp.csr_array(sp.block_diag([matrix, empty], format="csr"))

    return Quadratic(widened(problem.mass), widened(damping), sp.csr_array(bordered))


def _normed(shapes: ComplexArray) -> ComplexArray:
    """Vectors of unit norm, the normal forces left out."""
    return shapes / np.maximum(np.linalg.norm(shapes, axis=0), 1e-300)
