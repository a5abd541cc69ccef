"""Eigenpairs sharpened on the assembled matrices, where the modal sum has lost digits.

A root that almost coincides with a pole of the receptance (a mode that hardly feels its contact) makes
T the small difference of large numbers. Inverse iteration on the assembled problem, the normal forces
kept as unknowns so that rigid contact is nothing special, restores what was lost.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from ..typing import ComplexArray, Sparse
from .coupling import Coupling

STEPS = 3


def refine(
    coupling: Coupling, lam: complex, right: ComplexArray, left: ComplexArray, mu: float
) -> tuple[complex, ComplexArray, ComplexArray]:
    """λ and unit right and left vectors (n,) after inverse iteration from the given ones."""
    system, count = coupling.system, coupling.contacts
    size = system.size
    rows = system.contact_rows()
    normal, tangent = sp.csr_array(rows[0::2]), sp.csr_array(rows[1::2])
    friction = tangent.T @ sp.diags_array(coupling.friction_damping(mu)) @ tangent
    damping = system.damping + friction
    push = (normal + sp.diags_array(mu * coupling.sense) @ tangent).T
    scale = float(np.abs(system.stiffness).max())
    empty = sp.csr_array((count, count))
    edge = sp.csr_array((size, count))
    compliance = sp.diags_array(coupling.compliance)

    def problem(at: complex) -> Sparse:
        dynamic = at**2 * system.mass + at * damping + system.stiffness
        return sp.csc_array(
            sp.block_array([[dynamic, -push * scale], [normal * scale, compliance * scale**2]]), dtype=complex
        )

    def slope(at: complex) -> Sparse:
        return sp.csc_array(
            sp.block_array([[2 * at * system.mass + damping, edge], [edge.T, empty]]), dtype=complex
        )

    def forced(vector: ComplexArray) -> ComplexArray:
        return np.concatenate([vector, np.zeros(count, dtype=complex)])

    matrix, by_lambda = problem(lam), slope(lam)
    try:
        # A hair off, so that an exact eigenvalue can be factorised too.
        solver = spl.splu(problem(lam * (1 + 1e-13)))
    except RuntimeError:
        return lam, right, left
    # Some of every direction: on a pole the modal sum may lack the very one that is sought.
    rng = np.random.default_rng(0)
    spread = rng.standard_normal(size) / np.sqrt(size)
    x, y = (forced(spread if not np.all(np.isfinite(v)) else v + 1e-3 * spread) for v in (right, left))
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            x = solver.solve(by_lambda @ x)
            y = solver.solve(by_lambda.T @ y, trans="T")
            x, y = x / np.linalg.norm(x[:size]), y / np.linalg.norm(y[:size])
    product = y @ (by_lambda @ x)
    if product == 0 or not (np.all(np.isfinite(x)) and np.all(np.isfinite(y))):
        return lam, right, left
    better = lam - complex(y @ (matrix @ x)) / complex(product)
    if not abs(better - lam) <= 1e-6 * abs(lam):
        better = lam
    return better, x[:size], y[:size]
