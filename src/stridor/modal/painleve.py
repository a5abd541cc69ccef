"""Up to which friction coefficient rigid contact determines the motion.

Forces p of rigid contacts accelerate the gaps of all of them by A(μ) p, A(μ) = N M⁻¹ (N + μS)ᵀ = A₀ (1 + μΦ). Sliding
goes on where they can be found that keep the gaps closed. At the least μ > 0 at which 1 + μΦ is singular they cannot,
an eigenvalue λ runs to infinity, and beyond it a force opens what it presses on: Painlevé's paradox. With springs of
compliance εA₀ in the contacts λ² → −(1 + μφ)/ε for each eigenvalue φ of Φ, growth without bounds as ε vanishes, at that
μ and every larger one. What stiffness, damping and elastic contacts do is finite, and of no matter.
"""

from __future__ import annotations

from collections.abc import Hashable

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from ..direct import factorise
from ..direct.factor import BLOCK
from ..errors import AnalysisError
from ..system import System
from ..typing import Array, IntArray, Sparse
from .krylov.steady import TouchingNodes, contact_rows, touching_nodes
from .options import Options

REAL = 1e-7  # of |φ|: an imaginary part that two equal ones may get by rounding
SEEN = 1e-12  # of the largest: what of A₀, scaled to a unit diagonal, tells contacts apart
REACHED = 1e-12  # of μ
SAME = 1e-12  # of the largest friction coefficient


def refuse_undetermined(system: System, high: float, options: Options, *, touching_at: float | None = None) -> None:
    """Raise AnalysisError where rigid contact with friction no longer determines the motion at some μ up to ``high``.

    touching_at: the μ of the steady sliding whose nodes touch, where the system says none (None: the laws' own).
    """
    limit = undetermined_from(system, options, touching_at=touching_at)
    if limit <= high * (1 + REACHED):
        raise AnalysisError(undetermined(limit))


def undetermined(mu: float, where: str = "") -> str:
    """What is said of an eigenvalue that runs to infinity; where: what else has which value, " (at damping = 3)"."""
    return (
        f"an eigenvalue grows beyond all bounds at μ = {mu:.9g}{where}: from there on rigid contact "
        "with friction no longer determines the motion (Painlevé's paradox); stay below, or give the "
        "contact a stiffness"
    )


def undetermined_from(system: System, options: Options, *, touching_at: float | None = None) -> float:
    """The least μ > 0 at which A(μ) is singular; infinite where there is none.

    Infinite as well where it cannot be judged by the masses: rigid contacts that act on freedoms without one, that are
    given twice, that are closed nowhere or do not slide, and masses without an inverse.
    """
    asked = ("undetermined from", touching_at if system.touching_at is None else system.touching_at, options.solver)
    return _judged(system, options, touching_at, asked)


def steps_undetermined(system: System, mu: float | None, options: Options) -> str:
    """What is to be said of a run in time with rigid contact that does not determine steady sliding at ``mu`` (None:
    the laws' own friction), "" of others."""
    nodes = system.contact_nodes()
    own = nodes.friction_coefficients(nodes.speed)
    rubs = own[nodes.rubs]
    if mu is None and len(rubs) and np.ptp(rubs) <= SAME * rubs.max():
        mu = float(rubs[0])
    if mu is not None:
        limit, reached = undetermined_from(system, options, touching_at=mu), mu
        said = f"from μ = {limit:.6g} on, and it has μ = {mu:.6g} here"
    else:
        # Each contact has its own: by which factor of all of them.
        limit, reached = _judged(system, options, None, ("undetermined by own friction", options.solver), own), 1.0
        said = f"from {limit:.6g} times the friction of the case on"
    if limit > reached * (1 + REACHED):
        return ""
    return (
        f"rigid contact with friction does not determine the motion (Painlevé's paradox) {said}: where no forces keep "
        "contacts sliding, an impulse of a single step stops them, and its force grows as the step gets smaller; give "
        "the contact a stiffness, or stay below"
    )


def _judged(
    system: System, options: Options, touching_at: float | None, asked: tuple[Hashable, ...],
    friction: Array | None = None,
) -> float:  # fmt: skip
    """The least factor of ``friction`` (m,) of all nodes (None: 1) at which A is singular; ``asked`` once."""
    nodes = system.contact_nodes()
    if not nodes.count or not np.any(nodes.compliance == 0.0):
        return np.inf

    def found() -> float:
        try:
            touching = touching_nodes(system, nodes, touching_at, options.solver)
        except AnalysisError:
            return np.inf  # whoever solves there says so
        # Over a range of μ mostly the same nodes touch.
        same = (asked[0], touching.active.tobytes(), touching.sense.tobytes(), touching.stuck.tobytes(), options.solver)
        return system.once(same, lambda: _of_touching(system, touching, friction, options.solver))

    return system.once(asked, found)


def _of_touching(system: System, touching: TouchingNodes, friction: Array | None, solver: str | None) -> float:
    nodes, chosen = system.contact_nodes(), np.flatnonzero(touching.active)
    rows = contact_rows(nodes, chosen, touching.sense, touching.stuck)
    slide = rows.slide
    if friction is not None:
        held = np.zeros(rows.normal.shape[0] - len(chosen))
        slide = sp.csr_array(sp.diags_array(np.concatenate([friction[chosen], held])) @ rows.slip)
    rigid = np.flatnonzero(rows.compliance == 0.0)
    return singular_from(system.mass, rows.normal[rigid], slide[rigid], solver)


def singular_from(mass: Sparse, normal: Sparse, slide: Sparse, solver: str | None = None) -> float:
    """The least μ > 0 at which N M⁻¹ (N + μS)ᵀ is singular, N and S (m, n); infinite where there is none, or where it
    cannot be judged."""
    # A node that no freedom moves along its normal can neither press nor give way.
    presses = np.flatnonzero(abs(normal).sum(axis=1) > 0)
    reached = _reached(mass, normal[presses], slide[presses])
    if reached is None:
        return np.inf
    seen = _accelerations(*reached, solver)
    if seen is None:
        return np.inf
    still, moved = seen
    size = np.sqrt(np.abs(np.diag(still)))
    if not np.all(size > 0.0):
        return np.inf
    scale = np.outer(size, size)
    still, moved = still / scale, moved / scale
    strengths = np.linalg.svd(still, compute_uv=False)
    if strengths[-1] <= SEEN * strengths[0]:
        return np.inf
    values = sl.eigvals(np.linalg.solve(still, moved))
    real = values[np.abs(values.imag) <= REAL * np.abs(values)].real
    real = real[real < 0.0]
    return float(-1.0 / real.min()) if len(real) else np.inf


def _reached(mass: Sparse, normal: Sparse, slide: Sparse) -> tuple[Sparse, Sparse, Sparse] | None:
    """M, N and S on the freedoms that normal forces accelerate; None where friction works on none of these, and where
    the contacts act on freedoms without mass."""
    if not normal.shape[0] or not slide.nnz:
        return None
    entries = abs(mass)
    heavy = (entries.sum(axis=0) > 0) & (entries.sum(axis=1) > 0)
    acts, rubs = (abs(rows).sum(axis=0) > 0 for rows in (normal, slide))
    if np.any((acts | rubs) & ~heavy):
        return None
    parts: IntArray = connected_components(mass, directed=False)[1]
    if not len(np.intersect1d(parts[acts], parts[rubs])):
        return None  # as where a plane surface has one mass for each direction
    chosen = np.flatnonzero(np.isin(parts, parts[acts]))
    return sp.csr_array(mass[chosen][:, chosen]), sp.csr_array(normal[:, chosen]), sp.csr_array(slide[:, chosen])


def _accelerations(mass: Sparse, normal: Sparse, slide: Sparse, solver: str | None) -> tuple[Array, Array] | None:
    """N M⁻¹ Nᵀ and N M⁻¹ Sᵀ (m, m), None where M has no inverse."""
    count = normal.shape[0]
    own = mass.diagonal()
    if np.count_nonzero(own) == mass.nnz == len(own):
        light = normal @ sp.diags_array(1.0 / own)
        return (light @ normal.T).toarray(), (light @ slide.T).toarray()
    still, moved = np.empty((count, count)), np.empty((count, count))
    try:
        with factorise(sp.csr_array(mass.T), solver=solver) as factor:
            for start in range(0, count, BLOCK):
                part = slice(start, start + BLOCK)
                answer = factor.solve(normal[part].toarray().T)
                still[part], moved[part] = (normal @ answer).T, (slide @ answer).T
    except AnalysisError:
        return None
    return still, moved
